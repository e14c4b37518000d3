"""What is recorded of a state in balance: reactions, volume, the least volume ratio, the largest displacement."""

import numpy as np
from mpi4py import MPI

from elastune.app.body.body import Body
from elastune.app.results.quantities import force


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
        """Force of each held face on the body, by component; a shared edge counts for each of its faces."""
        body = self.body
        forces = body.layout.nodal(np.where(body.held, body.assembly.residual(body.state), 0.0))
        faces = body.constraints.faces
        return {face: force(body.u, forces, nodes)[: body.dimension].tolist() for face, nodes in faces.items()}
