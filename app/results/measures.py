"""What is recorded of a state in balance: reactions, volume, the least volume ratio, the largest displacement."""

from functools import cached_property

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from elastune.app.body.body import Body
from elastune.app.results.quantities import force, moment

Array = NDArray[np.float64]
Nodes = NDArray[np.int32]


class Measures:
    """Functionals of a body's state."""

    def __init__(self, body: Body) -> None:
        """Of a body."""
        self.body = body

    def volume_ratio(self) -> float:
        """Deformed over reference volume of the body."""
        return self.body.volume.ratio()

    def min_J(self) -> float:
        """Least volume ratio at any quadrature point."""
        return self.body.volume.least_J()

    def largest_displacement(self) -> float:
        """Largest displacement of any node."""
        nodal = self.body.layout.nodal(self.body.state.values)
        return self.body.comm.allreduce(float(np.sqrt(np.max(np.sum(nodal**2, axis=1), initial=0.0))), op=MPI.MAX)

    def reactions(self) -> dict[str, list[float]]:
        """Force of each place that holds the body, or of its springs, on the body, by component.

        A place has the components that it holds; where places meet the one that holds most has them. So all of them
        together are in balance with the loads.
        """
        u, d = self.body.u, self.body.dimension
        return {name: force(u, own, nodes)[:d].tolist() for name, (nodes, own) in self._forces().items()}

    def moments(self) -> dict[str, list[float]]:
        """Their moments about the centroid of each place at rest, as the nodes lie now; in 2D about z alone."""
        u, first = self.body.u, 2 if self.body.dimension == 2 else 0
        found = {}
        for name, (nodes, own) in self._forces().items():
            turned = np.cross(self._centroids[name], force(u, own, nodes))
            found[name] = (moment(u, own, nodes) - turned)[first:].tolist()
        return found

    @property
    def places(self) -> list[str]:
        """Names of the places that have reactions."""
        return list(self._centroids)

    def _forces(self) -> dict[str, tuple[Nodes, Array]]:
        """Nodes of each place, owned and ghost, and its share of the forces on all nodes of this rank, shape (n, d)."""
        body = self.body
        reactions = body.layout.nodal(body.assembly.residual(body.state))
        found: dict[str, tuple[Nodes, Array]] = {}
        for part, weights in zip(body.constraints.parts, self._weights, strict=True):
            nodes, forces = found.setdefault(part.place.name, (part.nodes, np.zeros_like(reactions)))
            own = nodes < len(forces)
            at = (nodes[own][:, None], list(part.components))
            forces[at] = weights[own] * reactions[at]
        for place, term in body.foundations:
            nodes, forces = found.setdefault(place.name, (place.nodes(body.geometry, body.V), np.zeros_like(reactions)))
            forces -= body.layout.nodal(body.assembly.of(term, body.state))
        return found

    @cached_property
    def _weights(self) -> list[Array]:
        return self.body.constraints.weights()

    @cached_property
    def _centroids(self) -> dict[str, Array]:
        body = self.body
        places = {part.place.name: part.place for part in body.constraints.parts}
        places |= {place.name: place for place, _ in body.foundations}
        return {name: place.centroid(body.geometry, body.V) for name, place in places.items()}
