"""Carries the turning of faces into the body, harmonically."""

from functools import cached_property

import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem, la
from numpy.typing import NDArray
from petsc4py import PETSc

from elastune.app.body.body import Body
from elastune.app.body.conditions.constraints import Held
from elastune.app.body.conditions.motions import Rotation
from elastune.app.body.conditions.stages import shares
from elastune.app.body.unknowns import State

Array = NDArray[np.float64]


class Blend:
    """Turns each point of a body by its share of a face's rotation.

    A straight line is a poor guess of a rotation: at a quarter turn, points in the middle of a twisted bar come
    near to its axis, and cells invert. Instead each point turns by its share of the angle, the harmonic
    function that is one on the turning face and zero on the others that are held.

    Attributes:
        turning: The places that turn.
    """

    def __init__(self, body: Body) -> None:
        """Solves for nothing yet."""
        self.body = body
        self.turning = [part for part in body.constraints.parts if isinstance(part.ends[0], Rotation)]

    @cached_property
    def _shares(self) -> list[Array]:
        """Values between 0 and 1 at the nodes, owned and ghost, of each turning place."""
        body = self.body
        W, to_vector = body.V.sub(0).collapse()
        u, v = ufl.TrialFunction(W), ufl.TestFunction(W)
        laplace = fem.form(ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx)
        # One array, or from dolfinx 0.10 on one for each cell type.
        nodes = np.ravel(to_vector) // body.dimension
        scalar = np.empty(len(nodes), dtype=np.int32)
        scalar[nodes] = np.arange(len(nodes), dtype=np.int32)
        whole = [part for part in body.constraints.parts if len(part.components) == body.dimension]
        found: list[Array] = []
        for turning in self.turning:
            # The turning place last, so that it has its way at shared edges.
            order = [*(part for part in whole if part is not turning), turning]
            ones = [(np.float64(part is turning), np.sort(scalar[part.nodes])) for part in order]
            own = _solve(laplace, W, [fem.dirichletbc(value, dofs, W) for value, dofs in ones])
            found.append(np.zeros(len(nodes)))
            found[-1][nodes] = own
        return found

    def turned(self, state: State, start: float) -> State:
        """A state at whose load faces have turned on since load `start`, with the body behind them."""
        body, d = self.body, self.body.dimension
        body.take(state)
        displacement = np.zeros_like(body.points)
        displacement[:, :d] = body.u.x.array.reshape(-1, d)
        moved = displacement.copy()
        for part, share in zip(self.turning, self._shares, strict=True):
            rotation = part.ends[0]
            assert isinstance(rotation, Rotation)
            angle = _angle(part, state.load) - _angle(part, start)
            moved += rotation.turned(body.points + displacement, share * angle)
        values = body.layout.joined(moved[:, :d].ravel(), body.layout.split(state.values)[1])
        return body.placed(values, state.load)


def _angle(part: Held, load: float) -> float:
    return Rotation.angle_between(part.ends, shares(load, len(part.ends)))


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
