"""Minimises Π at one load: PETSc's SNES around Newton's method with an energy line search."""

from dataclasses import dataclass
from typing import Any, Literal

import dolfinx.fem.petsc
import numpy as np
from petsc4py import PETSc

from app.problem import Array, Problem

# Above this many unknowns a factorisation in 3D costs more than CG with algebraic multigrid.
DIRECT_LIMIT = 60_000


class NotConverged(Exception):
    """The minimiser stopped short.

    Attributes:
        kind: One word: "undefined", "indefinite", "stalled", "iterations", "linear".
    """

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind


@dataclass
class Count:
    """What was spent."""

    newton: int = 0
    linear: int = 0


class Minimizer:
    """Finds the displacement of least Π under prescribed displacements.

    SNES holds the state, the norms and the reasons; the method is ours (`_Newton`) unless PETSc's options name
    another with -snes_type.
    """

    def __init__(self, problem: Problem) -> None:
        """Creates SNES, KSP and the matrix for a problem."""
        self.problem = problem
        self.count = Count()
        solve = problem.scene.solve
        comm = problem.comm
        self.matrix = dolfinx.fem.petsc.create_matrix(problem.potential.tangent[0])
        self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, problem.potential.loads.conservative)
        self.direct = solve.linear == "direct" or solve.linear == "auto" and problem.size <= DIRECT_LIMIT
        self.x = _vector(problem)
        self.f = self.x.duplicate()

        self.snes = PETSc.SNES().create(comm)
        self.snes.setFunction(self._function, self.f)
        self.snes.setJacobian(self._jacobian, self.matrix)
        if problem.potential.loads.conservative:
            self.snes.setObjective(self._objective)
        self.newton = _Newton(self)
        self.snes.setType("python")
        self.snes.setPythonContext(self.newton)
        self.snes.setTolerances(rtol=0.0, atol=0.0, stol=0.0, max_it=solve.max_iterations)
        _configure(self.snes.getKSP(), problem, self.matrix, self.direct)
        self.snes.setFromOptions()

    # ------------------------------------------------------------------ SNES callbacks

    def _full(self, x: PETSc.Vec) -> Array:
        values = np.zeros_like(self.problem.u.x.array)
        values[: self.problem.owned] = x.array_r
        return values

    def _objective(self, snes: PETSc.SNES, x: PETSc.Vec) -> float:
        return self.problem.energy_at(self._full(x))

    def _function(self, snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        residual = self.problem.residual_at(self._full(x))
        residual[self.problem.held] = 0.0
        f.array[:] = residual[: self.problem.owned]

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, matrix: PETSc.Mat, preconditioner: PETSc.Mat) -> None:
        self.problem.set_state(self._full(x))
        self.assemble("none")

    def assemble(self, filtering: Literal["none", "clamp", "absolute"]) -> None:
        """Assembles the tangent at the current state, rows and columns of prescribed displacements aside."""
        problem, matrix = self.problem, self.matrix
        problem.potential.set_filter(filtering)
        matrix.zeroEntries()
        for form in problem.potential.tangent:
            dolfinx.fem.petsc.assemble_matrix(matrix, form, problem.conditions, 0.0)  # type: ignore[arg-type]
        matrix.assemble()
        # A diagonal of the size of the others keeps the prescribed rows out of the conditioning.
        diagonal = matrix.getDiagonal()
        diagonal.array[problem.held[: problem.owned]] = self._typical(diagonal)
        matrix.setDiagonal(diagonal)

    def _typical(self, diagonal: PETSc.Vec) -> float:
        largest = diagonal.norm(PETSc.NormType.INFINITY)
        return largest if largest > 0 else 1.0

    # ------------------------------------------------------------------ the steps of a load increment

    def predict(self, values: Array, load: float) -> Array:
        """First-order prediction of the state at a new load.

        Args:
            values: State in balance at the load the potential holds now.
            load: The new load factor; the potential takes it.
        """
        problem = self.problem
        increment = np.where(problem.held, problem.prescribed(load) - values, 0.0)
        problem.potential.load.value = load
        residual = problem.residual_at(values)
        residual[problem.held] = 0.0
        # The lift is the kernel's tangent too: unfiltered first.
        rhs = problem.lift(increment) - residual
        self.assemble("none")
        step = self.linear_solve(rhs, 1e-6)
        if step is None and problem.potential.can_filter:
            self.assemble("clamp")
            rhs = problem.lift(increment) - residual
            step = self.linear_solve(rhs, 1e-6)
        if step is None:
            raise NotConverged("indefinite", "the prediction's tangent is not positive definite")
        return np.where(problem.held, values + increment, values + step)

    def minimize(self, values: Array) -> Array:
        """The minimiser from a state whose prescribed displacements are right.

        Raises:
            NotConverged: With the kind of failure; the problem's state is then of no use.
        """
        self.x.array[:] = values[: self.problem.owned]
        self.newton.failure = None
        self.snes.solve(None, self.x)
        if self.newton.failure is not None:
            raise self.newton.failure
        reason = self.snes.getConvergedReason()
        if reason < 0:
            raise NotConverged("stalled", f"SNES stopped with reason {reason}")
        if self.snes.getType() != "python":
            self.count.newton += self.snes.getIterationNumber()
            self.count.linear += self.snes.getLinearSolveIterations()
        result = self._full(self.x)
        self.problem.set_state(result)
        return self.problem.u.x.array.copy()

    def linear_solve(self, rhs: Array, rtol: float) -> Array | None:
        """Solves with the assembled tangent; None if it turned out not to be positive definite."""
        problem, ksp = self.problem, self.snes.getKSP()
        b = self.x.duplicate()
        b.array[:] = rhs[: problem.owned]
        y = self.x.duplicate()
        ksp.setOperators(self.matrix)
        ksp.setTolerances(rtol=rtol)
        ksp.solve(b, y)
        self.count.linear += max(ksp.getIterationNumber(), 1)
        reason = ksp.getConvergedReason()
        if reason in (PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_MAT, PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_PC):
            return None
        if reason == PETSc.KSP.ConvergedReason.DIVERGED_PCSETUP_FAILED:
            return None
        if self.direct and problem.potential.loads.conservative and self._negative_pivots() > 0:
            return None
        if reason < 0 and reason != PETSc.KSP.ConvergedReason.DIVERGED_MAX_IT:
            raise NotConverged("linear", f"the linear solver stopped with reason {reason}")
        step = np.zeros_like(rhs)
        step[: problem.owned] = y.array_r
        return step if np.isfinite(problem.norm(step)) else None

    def _negative_pivots(self) -> int:
        """Sylvester: as many as the tangent has negative eigenvalues."""
        pc = self.snes.getKSP().getPC()
        if pc.getType() != "cholesky" or pc.getFactorSolverType() != "mumps":
            return 0
        return pc.getFactorMatrix().getMumpsInfog(12)


def _vector(problem: Problem) -> PETSc.Vec:
    return PETSc.Vec().createMPI((problem.owned, problem.size), bsize=problem.dimension, comm=problem.comm)


def _configure(ksp: PETSc.KSP, problem: Problem, matrix: PETSc.Mat, direct: bool) -> None:
    pc = ksp.getPC()
    if direct:
        ksp.setType("preonly")
        pc.setType("cholesky" if problem.potential.loads.conservative else "lu")
        pc.setFactorSolverType("mumps")
        return
    ksp.setType("cg" if problem.potential.loads.conservative else "gmres")
    ksp.setTolerances(max_it=2000)
    pc.setType("gamg")
    matrix.setNearNullSpace(rigid_motions(problem))


def rigid_motions(problem: Problem) -> PETSc.NullSpace:
    """Translations and rotations of the reference body: what algebraic multigrid must represent."""
    d, owned = problem.dimension, problem.owned_displacements
    coordinates = PETSc.Vec().createMPI((owned, PETSc.DETERMINE), bsize=d, comm=problem.comm)
    nodes = owned // d
    points = problem.V.tabulate_dof_coordinates()[:nodes, : problem.dimension]
    coordinates.array[:] = points.ravel()
    return PETSc.NullSpace().createRigidBody(coordinates)


class _Newton:
    """Newton's method for a minimum, as a SNES type.

    The raw tangent serves where it is positive definite and the filtered one where it is not: the last steps
    are then quadratic, and every step goes downhill.
    """

    def __init__(self, owner: Minimizer) -> None:
        self.owner = owner
        self.failure: NotConverged | None = None

    def solve(self, snes: PETSc.SNES, b: Any, x: PETSc.Vec) -> None:
        """Called by SNES; leaves the solution in x, or the reason in `failure`."""
        try:
            self._iterate(snes, x)
        except NotConverged as failure:
            self.failure = failure
            snes.setConvergedReason(PETSc.SNES.ConvergedReason.DIVERGED_LINE_SEARCH)

    def _iterate(self, snes: PETSc.SNES, x: PETSc.Vec) -> None:
        owner, problem = self.owner, self.owner.problem
        solve = problem.scene.solve
        values = owner._full(x)
        problem.set_state(values)
        values = problem.u.x.array.copy()
        merit = _Merit(problem, values)
        wanted = "none" if solve.filter == "auto" else solve.filter
        previous = None
        for iteration in range(solve.max_iterations + 1):
            norm = problem.norm(merit.gradient)
            snes.setIterationNumber(iteration)
            snes.setFunctionNorm(norm)
            snes.monitor(iteration, norm)
            # Relative to the largest forces on the way: those at the prescribed displacements are among them.
            if norm <= solve.tolerance * merit.scale:
                x.array[:] = merit.values[: problem.owned]
                snes.setConvergedReason(PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE)
                return
            if iteration == solve.max_iterations:
                raise NotConverged("iterations", f"{iteration} Newton steps, residual {norm / merit.scale:.1e}")
            forcing = 1e-2 if previous is None else min(1e-2, max(0.1 * (norm / previous) ** 2, 1e-8))
            step, used = self._direction(merit, wanted, forcing)
            length = merit.search(step)
            owner.count.newton += 1
            if length is None and used == "none" and solve.filter == "auto" and problem.potential.can_filter:
                step, used = self._direction(merit, "clamp", forcing)
                length = merit.search(step)
            if length is None:
                raise NotConverged("stalled", f"no step lowers the energy, residual {norm / merit.scale:.1e}")
            # Where the raw tangent failed it will likely fail again, until the steps are taken whole.
            if solve.filter == "auto":
                wanted = "none" if used == "none" or length == 1.0 else "clamp"
            previous = norm

    def _direction(self, merit: "_Merit", wanted: str, forcing: float) -> tuple[Array, str]:
        """A descent direction, and the filter that gave it."""
        owner, problem = self.owner, self.owner.problem
        filters = [wanted] if wanted != "none" or problem.scene.solve.filter != "auto" else ["none", "clamp"]
        if not problem.potential.can_filter:
            filters = ["none"]
        for name in filters:
            problem.set_state(merit.values)
            owner.assemble(name)  # type: ignore[arg-type]
            step = owner.linear_solve(-merit.gradient, forcing)
            if step is None:
                continue
            step[problem.held] = 0.0
            if not merit.conservative or problem.dot(merit.gradient, step) < 0:
                return step, name
        raise NotConverged("indefinite", "the tangent is not positive definite, and no filter is left to try")


class _Merit:
    """Π and its gradient at the iterate, and the line search along a step.

    Without a potential (follower pressure) the residual's norm takes the energy's place.
    """

    def __init__(self, problem: Problem, values: Array) -> None:
        self.problem = problem
        self.conservative = problem.potential.loads.conservative
        self.values = values
        self.scale = 0.0
        self.gradient = self._gradient(values)
        self.value = self._value(values, self.gradient)
        if not np.isfinite(self.value):
            raise NotConverged("undefined", "the energy is not finite at the start of the step")

    def _gradient(self, values: Array) -> Array:
        problem = self.problem
        internal = problem.force_at(values, problem.potential.internal)
        gradient = internal
        if problem.potential.external:
            external = problem.force_at(values, problem.potential.external)
            self.scale = max(self.scale, problem.norm(external))
            gradient = internal + external
        else:
            gradient = internal.copy()
        self.scale = max(self.scale, problem.norm(internal))
        gradient[problem.held] = 0.0
        return gradient

    def _value(self, values: Array, gradient: Array) -> float:
        if self.conservative:
            return self.problem.energy_at(values)
        return 0.5 * self.problem.norm(gradient) ** 2

    def search(self, step: Array) -> float | None:
        """Moves along a step; its accepted length, or None if no length lowers the merit.

        Backtracking with the sufficient decrease of Armijo; where the decrease drowns in the rounding of Π the
        slope decides instead (the approximate Wolfe condition of Hager & Zhang 2005).
        """
        problem = self.problem
        slope = problem.dot(self.gradient, step) if self.conservative else -2 * self.value
        rounding = 1e-14 * abs(self.value) + 1e-16
        length = 1.0
        for _ in range(30):
            trial = self.values + length * step
            value = problem.energy_at(trial) if self.conservative else np.nan
            gradient = None
            if not self.conservative:
                gradient = self._gradient(trial)
                value = self._value(trial, gradient)
            if np.isfinite(value):
                accepted = value <= self.value + 1e-4 * length * slope
                if not accepted and self.conservative and value <= self.value + rounding:
                    gradient = self._gradient(trial)
                    accepted = abs(problem.dot(gradient, step)) <= 0.9 * abs(slope)
                if accepted:
                    self.values, self.value = trial, value
                    self.gradient = self._gradient(trial) if gradient is None else gradient
                    return length
                curvature = 2 * (value - self.value - length * slope)
                best = -slope * length**2 / curvature if curvature > 0 else 0.5 * length
                length = float(np.clip(best, 0.1 * length, 0.5 * length))
            else:
                length *= 0.5
        return None
