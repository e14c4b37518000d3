"""Prescribed displacements: which degrees of freedom, and where they are at a load."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from elastune.app.body.motions import Motion
from elastune.app.errors import UserError
from elastune.geometry import Geometry

Array = NDArray[np.float64]


class Constraints:
    """The faces and points that hold a body.

    Attributes:
        motions: By face, weakest first.
        held: Mask of the prescribed degrees of freedom, owned and ghost.
        conditions: dolfinx's view of them, for assembly; they prescribe `increment`.
        increment: Any displacement; dolfinx reads it where it is prescribed.
        faces: Nodes on this rank, owned and ghost, of the faces that hold.
    """

    def __init__(
        self,
        geometry: Geometry,
        V: fem.FunctionSpace,
        motions: Mapping[str, Motion],
        pins: Sequence[Sequence[float]] = (),
    ) -> None:
        """Finds them.

        Args:
            geometry: With the named faces.
            V: Displacement space.
            motions: By face.
            pins: Points whose nodes stay where they are at rest.

        Raises:
            UserError: If a pinned point is no node.
        """
        self._geometry, self._V, self._d = geometry, V, V.dofmap.index_map_bs
        # A stable sort: of two motions of one kind the later face wins, as it is written.
        self.motions = dict(sorted(motions.items(), key=lambda item: item[1].precedence))
        self.increment = fem.Function(V)
        self.held = np.zeros(len(self.increment.x.array), dtype=bool)
        self.conditions: list[Any] = []
        self.faces: dict[str, NDArray[np.int32]] = {}
        for face, motion in self.motions.items():
            self.faces[face] = fem.locate_dofs_topological(V, self._facet_dimension, geometry.facets(face))
            self._hold(self.faces[face], motion.components(self._d))
        pinned = self._nodes_at(pins)
        if geometry.mesh.comm.allreduce(len(pinned)):
            self._hold(pinned, list(range(self._d)))

    @property
    def _facet_dimension(self) -> int:
        return self._geometry.mesh.topology.dim - 1

    def _hold(self, nodes: NDArray[np.int32], components: list[int]) -> None:
        if len(components) == self._d:
            self.conditions.append(fem.dirichletbc(self.increment, nodes))
        else:
            # What slides along the other axes has nowhere to be moved to.
            for i in components:
                dofs = (nodes * self._d + i).astype(np.int32)
                self.conditions.append(fem.dirichletbc(np.float64(0.0), dofs, self._V.sub(i)))
        self.held[(nodes[:, None] * self._d + np.array(components)).ravel()] = True

    def _nodes_at(self, pins: Sequence[Sequence[float]]) -> NDArray[np.int32]:
        """Nodes on this rank, owned and ghost, at points; in ascending order, which dolfinx relies on."""
        points, comm = self.points[:, : self._d], self._geometry.mesh.comm
        found: list[NDArray[np.int32]] = [np.empty(0, dtype=np.int32)]
        for pin in pins:
            distance = np.linalg.norm(points - np.array(pin), axis=1)
            farthest = max(comm.allgather(float(distance.max(initial=0.0))))
            nodes = np.flatnonzero(distance < 1e-6 * farthest)
            if not comm.allreduce(len(nodes)):
                raise UserError(f"start.pins: {list(pin)} is no node of the mesh")
            found.append(nodes.astype(np.int32))
        return np.unique(np.concatenate(found))

    @cached_property
    def points(self) -> Array:
        """Places of the nodes at rest, owned and ghost, shape (n, 3)."""
        return self._V.tabulate_dof_coordinates()

    def displacements(self, load: float, others: Mapping[type[Motion], float] | None = None) -> Array:
        """Displacements at a load factor, owned and ghost: right where `held`, zero elsewhere.

        Args:
            load: The load factor.
            others: That of motions of another kind.
        """
        values = np.zeros((len(self.points), self._d))
        for face, motion in self.motions.items():
            at = (others or {}).get(type(motion), load)
            nodes, components = self.faces[face], motion.components(self._d)
            values[nodes[:, None], components] = motion.displacements(self.points[nodes], at)[:, components]
        return values.ravel()
