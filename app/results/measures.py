"""What is recorded of a state in balance: reactions, volume, the least volume ratio."""

import basix
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from elastune.app.body.body import Problem
from elastune.forms.kinematics import deformation_gradient


class Measures:
    """Functionals of a problem's state, compiled once."""

    def __init__(self, problem: Problem) -> None:
        """Compiles the volume and the volume ratio at the quadrature points."""
        self.problem = problem
        mesh = problem.geometry.mesh
        dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": problem.quadrature})
        J = ufl.det(deformation_gradient(problem.u))
        self._volume = fem.form(J * dx)
        self._reference = self._total(fem.form(fem.Constant(mesh, 1.0) * dx))
        points, _ = basix.make_quadrature(mesh.basix_cell(), problem.quadrature)
        self._J = fem.Expression(J, points)
        self._cells = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local, dtype=np.int32)

    def _total(self, form: fem.Form) -> float:
        return self.problem.comm.allreduce(float(fem.assemble_scalar(form)))

    def volume_ratio(self) -> float:
        """Deformed over reference volume of the body."""
        return self._total(self._volume) / self._reference

    def min_J(self) -> float:
        """Least volume ratio at any quadrature point."""
        values = self._J.eval(self.problem.geometry.mesh, self._cells)
        return self.problem.comm.allreduce(float(values.min(initial=np.inf)), op=MPI.MIN)

    def reactions(self) -> dict[str, list[float]]:
        """Force of each held face on the body, by component; a shared edge counts for each of its faces."""
        problem, d = self.problem, self.problem.dimension
        forces = problem.displacements(problem.residual_at(problem.state))
        nodes = problem.owned_displacements // d
        forces = np.where(problem.displacements(problem.held), forces, 0.0).reshape(-1, d)
        reactions = {}
        for face, blocks in problem.faces.items():
            own = forces[blocks[blocks < nodes]].sum(axis=0)
            reactions[face] = [float(total) for total in problem.comm.allreduce(own)]
        return reactions
