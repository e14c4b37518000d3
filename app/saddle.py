"""Newton's method for mixed elements: Π(u, p) is least in the displacement and greatest in the pressure."""

from collections.abc import Callable
from functools import cached_property
from typing import Literal, NamedTuple

import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from app.errors import NotConverged
from app.problem import Array, Problem
from app.tangent import DIRECT_LIMIT, Count, rigid_motions
from forms.mixed import MixedPotential

# Iterations of FGMRES; 30 to 60 are usual, and a tangent that takes more is likely not to be one of descent.
LONGEST = 200


class Convexity(NamedTuple):
    """What is done to the displacement block: the filter of the μ part, and the share of `stretching` added."""

    filter: Literal["none", "clamp", "absolute"]
    share: float


class SaddlePoint:
    """Finds the equilibrium of least energy under prescribed displacements and the pressure's constraint.

    A step is a direction of descent where the tangent, with its n displacements and m pressures, has exactly m
    negative eigenvalues: the displacement block is then positive definite on the motions that the pressures
    leave. MUMPS counts them; where there are more, the displacement block is made more convex.

    The step's length is chosen by the augmented Lagrangian Π(u, p̂) + γ/2 |∂Π/∂p (u, p̂)|² at the pressure p̂ that
    the step aims at. Newton's direction is a direction of descent of it for large enough γ, and its own Newton
    direction, so that steps end up whole; unlike the energy with the pressure eliminated, it does not punish a
    step for the volume that it changes to second order with an infinite λ.

    Reference:
        Nocedal & Wright 2006, Numerical Optimization, Theorem 16.3 and Sections 17.3, 18.4.
    """

    def __init__(self, problem: Problem) -> None:
        """Creates the matrices and the linear solver."""
        if not isinstance(problem.potential, MixedPotential):
            raise TypeError("expected a problem with pressures")
        self.problem, self.potential = problem, problem.potential
        self.count = Count()
        forms = problem.potential
        create = dolfinx.fem.petsc.create_matrix
        self._blocks = [
            (create(forms.tangent[0]), forms.tangent),
            (create(forms.coupling_transposed), [forms.coupling_transposed]),
            (create(forms.coupling), [forms.coupling]),
            (create(forms.compliance), [forms.compliance]),
        ]
        a, b, c, d = (matrix for matrix, _ in self._blocks)
        self._nest = PETSc.Mat().createNest([[a, b], [c, d]], comm=problem.comm)
        mass = dolfinx.fem.petsc.assemble_matrix(forms.mass)
        mass.assemble()
        self._volumes = mass.getDiagonal().array_r.copy()
        gradient = ufl.grad(problem.u)
        self._distortion = fem.form(ufl.inner(gradient, gradient) * ufl.dx)
        self._pressures = problem.comm.allreduce(problem.owned_pressures)

        linear = problem.scene.solve.linear
        self.direct = linear == "direct" or (linear == "auto" and problem.size <= DIRECT_LIMIT)
        self.ksp = PETSc.KSP().create(problem.comm)
        self.matrix = PETSc.Mat() if self.direct else self._nest
        if self.direct:
            self._configure_direct()
        else:
            self._configure_iterative(mass)
        self.ksp.setFromOptions()

    # ------------------------------------------------------------------ linear algebra

    def _configure_direct(self) -> None:
        self.ksp.setType("preonly")
        pc = self.ksp.getPC()
        pc.setType("cholesky" if self.potential.loads.conservative else "lu")
        pc.setFactorSolverType("mumps")

    def _configure_iterative(self, mass: PETSc.Mat) -> None:
        """A block triangle of algebraic multigrid and the pressures' mass matrix, scaled to the Schur complement."""
        stiffness = self._blocks[0][0]
        stiffness.setNearNullSpace(rigid_motions(self.problem))
        bulk = self.problem.split.bulk if self.problem.split is not None else np.inf
        mass.scale(-(1 / self.potential.shear_modulus + 1 / bulk))
        self.ksp.setType("fgmres")
        self.ksp.setGMRESRestart(LONGEST)
        self.ksp.setTolerances(max_it=LONGEST)
        pc = self.ksp.getPC()
        pc.setType("fieldsplit")
        rows, _ = self._nest.getNestISs()
        pc.setFieldSplitIS(("u", rows[0]), ("p", rows[1]))
        pc.setFieldSplitType(PETSc.PC.CompositeType.SCHUR)
        pc.setFieldSplitSchurFactType(PETSc.PC.SchurFactType.UPPER)
        pc.setFieldSplitSchurPreType(PETSc.PC.SchurPreType.USER, mass)
        self.ksp.setOperators(self.matrix)
        options = PETSc.Options()
        for key, value in {"u_ksp_type": "preonly", "u_pc_type": "gamg", "p_ksp_type": "preonly"}.items():
            name = f"fieldsplit_{key}"
            if not options.hasName(name):
                options[name] = value

    def assemble(self, convexity: Convexity) -> None:
        """Assembles the tangent at the current state, rows and columns of prescribed displacements aside."""
        problem, forms = self.problem, self.potential
        forms.set_filter(convexity.filter)
        forms.share.value = convexity.share
        stretching = [forms.stretching] if convexity.share > 0 else []
        for matrix, terms in self._blocks:
            matrix.zeroEntries()
            for form in [*terms, *(stretching if terms is forms.tangent else [])]:
                dolfinx.fem.petsc.assemble_matrix(matrix, form, problem.conditions, 0.0)  # type: ignore[arg-type]
                # Zeros inserted on the diagonal and what the next form adds must not meet.
                matrix.assemble(PETSc.Mat.AssemblyType.FLUSH)
            matrix.assemble()
        stiffness = self._blocks[0][0]
        # A diagonal of the size of the others keeps the prescribed rows out of the conditioning.
        diagonal = stiffness.getDiagonal()
        diagonal.array[problem.held[: problem.owned_displacements]] = diagonal.norm(PETSc.NormType.INFINITY) or 1.0
        stiffness.setDiagonal(diagonal)
        self._nest.assemble()
        if self.direct:
            self.matrix = self._nest.convert("aij", out=self.matrix)
            self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, self.potential.loads.conservative)

    def linear_solve(self, rhs: Array, rtol: float) -> Array | None:
        """Solves with the assembled tangent; None if the solution is of no use, or no direction of descent."""
        problem = self.problem
        b = PETSc.Vec().createMPI((problem.owned, problem.size), comm=problem.comm)
        y = b.duplicate()
        b.array[:] = rhs[: problem.owned]
        self.ksp.setOperators(self.matrix)
        self.ksp.setTolerances(rtol=rtol)
        self.ksp.solve(b, y)
        self.count.linear += max(self.ksp.getIterationNumber(), 1)
        pc = self.ksp.getPC()
        if self.ksp.getConvergedReason() < 0:
            return None
        counted = pc.getType() == "cholesky" and pc.getFactorSolverType() == "mumps"
        if counted and pc.getFactorMatrix().getMumpsInfog(12) != self._pressures:
            return None
        step = np.zeros_like(rhs)
        step[: problem.owned] = y.array_r
        step[problem.held] = 0.0
        return step if np.isfinite(problem.norm(step)) else None

    # ------------------------------------------------------------------ the steps of a load increment

    def predict(self, values: Array, load: float) -> Array:
        """First-order prediction of the state at a new load.

        Args:
            values: State in balance at the load the potential holds now.
            load: The new load factor; the potential takes it.

        Raises:
            NotConverged: If no tangent gives one.
        """
        problem = self.problem
        increment = np.where(problem.held, problem.prescribed(load) - values, 0.0)
        problem.potential.load.value = load
        residual = problem.residual_at(values)
        residual[problem.held] = 0.0
        for convexity in self._ladder:
            self.assemble(convexity)
            step = self.linear_solve(problem.lift(increment) - residual, 1e-4)
            if step is not None:
                guess = values + increment + step
                # A pressure may be predicted that no volume ratio of the material has.
                defined = np.isfinite(problem.norm(problem.residual_at(guess)))
                return guess if defined else problem.with_displacements(values, problem.displacements(guess))
        raise NotConverged("indefinite", "the prediction's tangent has negative eigenvalues, however filtered", values)

    @cached_property
    def _ladder(self) -> list[Convexity]:
        """From the true tangent to more and more convex ones."""
        filtering: Literal["none", "clamp"] = "clamp" if self.potential.can_filter else "none"
        return [Convexity("none", 0.0), *(Convexity(filtering, share) for share in (0.0, 0.25, 1.0, 4.0, 16.0))]

    def minimize(self, values: Array) -> Array:
        """The equilibrium from a state whose prescribed displacements are right.

        Raises:
            NotConverged: With the kind of failure; the problem's state is then of no use.
        """
        problem, solve = self.problem, self.problem.scene.solve
        problem.set_state(values)
        values = problem.state
        self._scale = 0.0
        previous, rung = None, 0
        for iteration in range(solve.max_iterations + 1):
            residual, error = self._residual(values)
            if not np.isfinite(error):
                raise NotConverged("undefined", "the forces are not finite at the start of the step", values)
            if error <= solve.tolerance:
                return values
            if iteration == solve.max_iterations:
                raise NotConverged("iterations", f"{iteration} Newton steps, residual {error:.1e}", values)
            # As exact as a quadratic step deserves, and no more than the tolerance asks for.
            wanted = 1e-2 if previous is None else 0.1 * (error / previous) ** 2
            forcing = min(1e-2, max(wanted, 0.1 * solve.tolerance / error))
            values, rung = self._step(values, residual, error, forcing, rung)
            self.count.newton += 1
            previous = error
        raise AssertionError("unreachable")

    def _residual(self, values: Array) -> tuple[Array, float]:
        """Forces out of balance and volume strains, and the larger of the two relative to their scales.

        Forces relative to the largest on the way, those at the prescribed displacements among them; strains
        relative to the displacement's gradient.
        """
        problem = self.problem
        residual = problem.residual_at(values)
        for forms in (problem.potential.internal, problem.potential.external):
            if forms:
                self._scale = max(self._scale, problem.norm_displacements(problem.force_at(values, forms)))
        residual[problem.held] = 0.0
        n = problem.owned_displacements
        force = problem.norm_displacements(residual) / (self._scale or 1.0)
        distortion = problem.comm.allreduce(float(fem.assemble_scalar(self._distortion)))
        strain = np.sqrt(self._squared(residual[n : problem.owned]) / (distortion or 1.0))
        return residual, float(np.maximum(force, strain))

    def _squared(self, strains: Array) -> float:
        """Square of a volume strain's norm, ∫θ² of its values at the pressures' nodes."""
        return self.problem.comm.allreduce(float(strains @ (strains / self._volumes)))

    def _step(self, values: Array, residual: Array, error: float, forcing: float, rung: int) -> tuple[Array, int]:
        """The state after a step, and the rung of the ladder to start from where the true tangent fails next."""
        for number in (0, *range(max(1, rung), len(self._ladder))):
            self.problem.set_state(values)
            self.assemble(self._ladder[number])
            step = self.linear_solve(-residual, forcing)
            length = None if step is None else self._length(values, step, error)
            if step is not None and length is not None:
                return values + length * step, number - 1
        raise NotConverged("stalled", "no step lowers the augmented energy, however convex the tangent is made", values)

    def _length(self, values: Array, step: Array, error: float) -> float | None:
        """The length of a step that lowers the merit by Armijo's rule; None if there is none.

        Without a potential (follower pressure) the relative error is the merit. The step's pressures are cut, in
        place, where they aim at what no volume ratio of the material has.
        """
        if not self.potential.loads.conservative:
            return _backtrack(lambda length: self._residual(values + length * step)[1], error, -error, 0.0)
        problem = self.problem
        n, owned = problem.owned_displacements, problem.owned
        motion = problem.joined(problem.displacements(step))
        residual = np.full_like(step, np.nan)
        for _ in range(30):
            aim = values + step - motion
            residual = problem.residual_at(aim)
            if np.isfinite(problem.norm(residual)):
                break
            step[n:owned] *= 0.5
        slope = problem.dot(residual, motion)
        squared = self._squared(residual[n:owned])
        weight = self.potential.shear_modulus
        if slope > 0:
            # Of a tangent whose eigenvalues nobody counted, a large weight is a sign that they are wrong.
            limit = np.inf if self.direct else 10 * weight
            weight = max(weight, 2 * slope / squared) if squared > 0 else np.inf
            if not weight < limit:
                return None

        def merit(length: float) -> float:
            trial = aim + length * motion
            strains = problem.residual_at(trial)[n:owned]
            return problem.energy_at(trial) + weight / 2 * self._squared(strains)

        start = problem.energy_at(aim) + weight / 2 * squared
        return _backtrack(merit, start, slope - weight * squared, 1e-13 * abs(start) + 1e-16)


def _backtrack(merit: Callable[[float], float], start: float, slope: float, rounding: float) -> float | None:
    """The first of 1 and shorter lengths that lowers a merit by Armijo's rule, or None."""
    length = 1.0
    for _ in range(30):
        value = merit(length)
        if not np.isfinite(value):
            length *= 0.5
            continue
        if value <= start + 1e-4 * length * slope + rounding:
            return length
        # The minimum of the parabola through what is known.
        curvature = 2 * (value - start - length * slope)
        best = -slope * length**2 / curvature if curvature > 0 else 0.5 * length
        length = float(np.clip(best, 0.1 * length, 0.5 * length))
    return None
