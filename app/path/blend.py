"""Where a load increment starts from: the tangent's prediction, or the prescribed motions blended through the body."""

from functools import cached_property

import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem, la
from petsc4py import PETSc

from elastune.app.body.body import Array, Problem
from elastune.app.body.constraints import rotated


class Blend:
    """Carries the turning of faces into the body.

    A straight line is a poor guess of a rotation: at a quarter turn, points in the middle of a twisted bar come
    near to its axis, and cells invert. Instead each point turns by its share of the angle, the harmonic
    function that is one on the turning face and zero on the others that are held.
    """

    def __init__(self, problem: Problem) -> None:
        """Solves for nothing yet."""
        self.problem = problem
        self.turning = {face: c.rotate for face, c in problem.scene.boundary.items() if c.rotate is not None}

    @cached_property
    def _shares(self) -> dict[str, Array]:
        """Values between 0 and 1 at the nodes, owned and ghost, by turning face."""
        problem = self.problem
        W, to_vector = problem.V.sub(0).collapse()
        u, v = ufl.TrialFunction(W), ufl.TestFunction(W)
        laplace = fem.form(ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx)
        facets = {
            face: fem.locate_dofs_topological(W, problem.geometry.mesh.topology.dim - 1, problem.geometry.facets(face))
            for face, condition in problem.scene.boundary.items()
            if condition.holds and condition.roller is None
        }
        # One array, or from dolfinx 0.10 on one for each cell type.
        nodes = np.ravel(to_vector) // problem.dimension
        shares: dict[str, Array] = {}
        for turning in self.turning:
            # The turning face last, so that it has its way at shared edges.
            order = [*(face for face in facets if face != turning), turning]
            conditions = [fem.dirichletbc(np.float64(face == turning), facets[face], W) for face in order]
            own = _solve(laplace, W, conditions)
            shares[turning] = np.zeros(len(nodes))
            shares[turning][nodes] = own
        return shares

    def predict(self, values: Array, start: float, end: float) -> Array:
        """The displacements at load `end` of a body in balance at load `start`, the prescribed ones right."""
        problem, d = self.problem, self.problem.dimension
        rest = problem.V.tabulate_dof_coordinates()
        displacement = np.zeros_like(rest)
        displacement[:, :d] = problem.displacements(values).reshape(-1, d)
        moved = displacement.copy()
        for face, condition in self.turning.items():
            angles = self._shares[face] * np.deg2rad((end - start) * condition.angle)
            moved += rotated(condition, rest + displacement, angles)
        guess = problem.with_displacements(values, moved[:, :d].ravel())
        return np.where(problem.held, problem.prescribed(end), guess)


def _solve(laplace: fem.Form, W: fem.FunctionSpace, conditions: list[fem.DirichletBC]) -> Array:
    """A harmonic function with the given boundary values; its values over owned and ghost nodes."""
    A = dolfinx.fem.petsc.assemble_matrix(laplace, conditions)
    A.assemble()
    b = la.vector(W.dofmap.index_map)
    b.array[:] = 0.0
    fem.apply_lifting(b.array, [laplace], [conditions])
    b.scatter_reverse(la.InsertMode.add)
    for condition in conditions:
        condition.set(b.array)
    result = la.vector(W.dofmap.index_map)
    result.array[:] = 0.0
    owned = W.dofmap.index_map.size_local
    rhs, solution = A.createVecLeft(), A.createVecRight()
    rhs.array[:] = b.array[:owned]
    ksp = PETSc.KSP().create(W.mesh.comm)
    ksp.setOperators(A)
    ksp.setType("cg")
    ksp.getPC().setType("gamg")
    # A guess needs no more.
    ksp.setTolerances(rtol=1e-4)
    ksp.solve(rhs, solution)
    result.array[:owned] = solution.array_r
    result.scatter_forward()
    return result.array.copy()
