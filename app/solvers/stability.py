"""Whether a state in balance is a minimum: the least eigenvalue of the tangent, whatever solver it has."""

from collections.abc import Callable
from functools import cached_property

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from elastune.app.body.regions.parts import Part
from elastune.app.body.shapes import noise
from elastune.app.body.unknowns import Array, State
from elastune.app.solvers.eigen import least
from elastune.app.solvers.linear.solver import LinearSolver
from elastune.app.solvers.tangent import Tangent
from elastune.forms.terms import RAW, Convexity

# Weight of the volume strains of incompressible bodies, over the shear modulus.
PENALTY = 1e4

# Two eigenvalues are alike if one is this share of the other; a motion goes along an axis if so much of it does.
ALIKE, ALONG = 0.9, 1e-2

# How much of an eigenvalue its error may be where two are compared.
FINE = 1e-2

# Of a state that may be moved without a force, such as a bent round column about its axis, θ is zero but for rounding
# and the mesh; what is above this is no loss of stability.
NEUTRAL = -1e-4


class Stability:
    """The least eigenvalue θ of K x = θ K₊ x, K the true tangent of the displacements and K₊ a convex one.

    The latter is that of the strain energy, filtered. θ has no unit, does not depend on the mesh, and is 1 where no
    point's tangent has negative eigenvalues: then K is K₊, one product tells, and nothing is solved. Of mixed elements
    K is A + Bᵀ S⁻¹ B, the pressures eliminated; S is their compliance, or where they have none a small multiple of
    their mass.
    """

    def __init__(self, tangent: Tangent, linear: LinearSolver) -> None:
        """Of a body.

        Args:
            tangent: Is assembled anew.
            linear: Its solver, which preconditions.
        """
        self.body, self._tangent, self._linear = tangent.body, tangent, linear
        self._last: Array | None = None
        self._known: tuple[int, float, Array] | None = None

    @cached_property
    def _filtered(self) -> Tangent:
        return Tangent(self.body)

    def downwards(self, state: State) -> Array | None:
        """The direction in which Π curves downwards most, a vector whose largest entry is one; None of a minimum.

        Args:
            state: In balance, or nearly so.
        """
        theta, direction = self.least(state)
        return direction if theta < NEUTRAL else None

    def least(self, state: State) -> tuple[float, Array]:
        """θ, one where nobody can tell, and its direction, a vector whose largest entry is one.

        Args:
            state: In balance, or nearly so.
        """
        body = self.body
        if not (body.conservative and body.parts.can_filter):
            return 1.0, np.zeros(body.layout.owned)
        # The iterate before the last tells as much, and is there already.
        at = self._tangent.state if self._tangent.settled else state
        assert at is not None
        if self._known is None or self._known[0] != at.stamp:
            if self._tangent.state is not at or self._tangent.convexity != RAW:
                self._tangent.assemble(at, RAW)
            theta, found = self._found(at)
            self._known = at.stamp, theta, body.layout.joined(self._unit(found))
        return self._known[1:]

    def valley(self, state: State) -> Array:
        """The direction in which Π curves downwards most; of two that are alike, what goes along x most.

        The sense is that of x too, or y, or z where it does not go along the ones before: the same on any number of
        ranks, and whatever the numbers of the nodes.

        Args:
            state: In balance, and no minimum.
        """
        body = self.body
        _, first = self.least(state)
        K, filtered = self._operator(self._tangent), self._operator(self._filtered)
        own = body.layout.split(first)[0]
        precondition = self._precondition()
        theta, own = least(K, filtered, precondition, own, body.layout.dot, FINE)
        image = filtered(own)

        # The first one lifted out of the way.
        def lifted(v: Array) -> Array:
            return K(v) - 2 * theta * body.layout.dot(image, v) * image

        start = precondition(self._at_random())
        other, second = least(lifted, filtered, precondition, start, body.layout.dot, FINE)
        modes = [own, second] if other < ALIKE * theta else [own]
        for axis in range(body.dimension):
            along = np.zeros_like(own)
            along[axis :: body.dimension] = 1.0
            along[self._held] = 0.0
            shares = [body.layout.dot(along, mode) / np.sqrt(body.layout.dot(mode, mode)) for mode in modes]
            if np.linalg.norm(shares) > ALONG * body.layout.norm(along):
                return body.layout.joined(sum(share * mode for share, mode in zip(shares, modes, strict=True)))
        return body.layout.joined(own * np.sign(body.layout.dot(own, self._at_random())))

    def _unit(self, displacements: Array) -> Array:
        return displacements / self.body.comm.allreduce(float(np.abs(displacements).max(initial=0.0)), op=MPI.MAX)

    def _found(self, at: State) -> tuple[float, Array]:
        body = self.body
        self._filtered.assemble(at, Convexity("clamp"), only_convex=True)
        K, filtered = self._operator(self._tangent), self._operator(self._filtered)
        start = self._at_random()
        image, other = K(start), filtered(start)
        if body.layout.norm(image - other) <= 1e-12 * body.layout.norm(other):
            return 1.0, start
        self._linear.setup()
        precondition = self._precondition()
        # Forces without order move a body along its soft modes above all.
        start = precondition(start) + (0.0 if self._last is None else self._last)
        theta, found = least(K, filtered, precondition, start, body.layout.dot)
        self._last = found / body.layout.norm(found) * body.layout.norm(start)
        return theta, found

    def _at_random(self) -> Array:
        random = 2 * noise(self.body, 0).ravel() - 1
        random[self._held] = 0.0
        return random

    @cached_property
    def _held(self) -> Array:
        return self.body.layout.split(self.body.held)[0]

    @cached_property
    def penalty(self) -> PETSc.Mat:
        """What the pressures of incompressible parts have for a compliance."""

        def compliance(part: Part) -> float:
            free = part.split is not None and np.isinf(part.split.bulk)
            return 1 / (PENALTY * part.shear_modulus) if free else 0.0

        return self.body.pressures.mass(compliance)

    def _operator(self, tangent: Tangent) -> Callable[[Array], Array]:
        """K on free displacements, the pressures eliminated."""
        matrix: PETSc.Mat | _Condensed = tangent.blocks["u", "u"]
        if self.body.p is not None:
            matrix = _Condensed(self, tangent)
        x, y = tangent.displacement_vector(), tangent.displacement_vector()

        def product(values: Array) -> Array:
            x.array[:] = values
            matrix.mult(x, y)
            return np.where(self._held, 0.0, y.array_r)

        return product

    def _precondition(self) -> Callable[[Array], Array]:
        """One application of the linear solver's preconditioner, to forces on displacements."""
        b, y, pc = self._tangent.vector(), self._tangent.vector(), self._linear.ksp.getPC()
        pc.setUp()

        def apply(values: Array) -> Array:
            b.array[: len(values)] = values
            pc.apply(b, y)
            return np.where(self._held, 0.0, y.array_r[: len(values)])

        return apply


class _Condensed:
    """A + Bᵀ S⁻¹ B."""

    def __init__(self, stability: Stability, tangent: Tangent) -> None:
        body = stability.body
        self._A, self._B = tangent.blocks["u", "u"], tangent.blocks["p", "u"]
        S = tangent.blocks["p", "p"].copy()
        S.scale(-1.0)
        S.axpy(1.0, stability.penalty)
        self._ksp = PETSc.KSP().create(body.comm)
        self._ksp.setOperators(S)
        self._ksp.setType("cg")
        self._ksp.setTolerances(rtol=1e-8)
        self._ksp.getPC().setType("bjacobi")
        self._strains, self._pressures = self._B.createVecLeft(), self._B.createVecLeft()
        self._forces = self._A.createVecLeft()

    def mult(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """As of a matrix of PETSc's."""
        self._B.mult(x, self._strains)
        self._ksp.solve(self._strains, self._pressures)
        self._A.mult(x, y)
        self._B.multTranspose(self._pressures, self._forces)
        y.axpy(1.0, self._forces)


def random_forces(tangent: Tangent) -> Array:
    """A vector with a share of every eigenvector, zero where the body is held."""
    return np.where(tangent.body.held, 0.0, np.random.default_rng(0).standard_normal(len(tangent.body.held)))
