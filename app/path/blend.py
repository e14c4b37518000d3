"""Carries the turning of faces into the body, harmonically."""

from functools import cached_property

import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem, la
from numpy.typing import NDArray
from petsc4py import PETSc

from elastune.app.body.body import Body
from elastune.app.body.motions import Roller, Rotation
from elastune.app.body.unknowns import State

Array = NDArray[np.float64]


class Blend:
    """Turns each point of a body by its share of a face's rotation.

    A straight line is a poor guess of a rotation: at a quarter turn, points in the middle of a twisted bar come
    near to its axis, and cells invert. Instead each point turns by its share of the angle, the harmonic
    function that is one on the turning face and zero on the others that are held.

    Attributes:
        turning: The rotations, by face.
    """

    def __init__(self, body: Body) -> None:
        """Solves for nothing yet."""
        self.body = body
        self.turning = {face: m for face, m in body.constraints.motions.items() if isinstance(m, Rotation)}

    @cached_property
    def _shares(self) -> dict[str, Array]:
        """Values between 0 and 1 at the nodes, owned and ghost, by turning face."""
        body = self.body
        W, to_vector = body.V.sub(0).collapse()
        u, v = ufl.TrialFunction(W), ufl.TestFunction(W)
        laplace = fem.form(ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx)
        facets = {
            face: fem.locate_dofs_topological(W, body.geometry.mesh.topology.dim - 1, body.geometry.facets(face))
            for face, motion in body.constraints.motions.items()
            if not isinstance(motion, Roller)
        }
        # One array, or from dolfinx 0.10 on one for each cell type.
        nodes = np.ravel(to_vector) // body.dimension
        shares: dict[str, Array] = {}
        for turning in self.turning:
            # The turning face last, so that it has its way at shared edges.
            order = [*(face for face in facets if face != turning), turning]
            conditions = [fem.dirichletbc(np.float64(face == turning), facets[face], W) for face in order]
            own = _solve(laplace, W, conditions)
            shares[turning] = np.zeros(len(nodes))
            shares[turning][nodes] = own
        return shares

    def turned(self, state: State, start: float) -> State:
        """A state at whose load faces have turned on since load `start`, with the body behind them."""
        body, d = self.body, self.body.dimension
        body.take(state)
        displacement = np.zeros_like(body.points)
        displacement[:, :d] = body.u.x.array.reshape(-1, d)
        moved = displacement.copy()
        for face, rotation in self.turning.items():
            angles = self._shares[face] * np.deg2rad((state.load - start) * rotation.angle)
            moved += rotation.turned(body.points + displacement, angles)
        values = body.layout.joined(moved[:, :d].ravel(), body.layout.split(state.values)[1])
        return body.placed(values, state.load)


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
    ksp.setOptionsPrefix("blend_")
    ksp.setOperators(A)
    ksp.setType("cg")
    ksp.getPC().setType("gamg")
    # A guess needs no more.
    ksp.setTolerances(rtol=1e-4)
    ksp.setFromOptions()
    ksp.solve(rhs, solution)
    result.array[:owned] = solution.array_r
    result.scatter_forward()
    return result.array.copy()
