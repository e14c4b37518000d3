"""Minimises Π at one load: PETSc's SNES around Newton's method with an energy line search, or a trust region."""

import time
from collections.abc import Callable
from functools import cached_property
from typing import Any

import dolfinx.fem.petsc
import numpy as np
from petsc4py import PETSc

from app.errors import NotConverged
from app.newton import Count, Filter, Newton
from app.problem import Array, Problem
from app.start import uniform

# Above this many unknowns a factorisation in 3D costs more than CG with algebraic multigrid.
DIRECT_LIMIT = 60_000

# The trust region hands over where the forces have fallen to this share: the differences of the energy that it
# lives on are lost in rounding near the minimum, where Newton's method needs no help.
HANDOVER = 1e-4

# How often the trust region takes over where Newton's method cannot go on, and the noise that moves the body off a
# saddle point before, relative to its extent.
ROAMS, NOISE = 3, 1e-4

# Filtered steps in a row after which steps that know negative curvature do better.
PATIENCE = 12

__all__ = ["DIRECT_LIMIT", "Count", "Minimizer", "NotConverged", "rigid_motions"]


class Minimizer:
    """Finds the displacement of least Π under prescribed displacements.

    SNES holds the state, the norms and the reasons; the method is ours (`Newton`) unless the scene asks for a
    trust region or PETSc's options name another with -snes_type.

    The trust region is SNES's, with Steihaug's conjugate gradients on the raw tangent: they follow negative
    curvature to the region's edge instead of filtering it away. The filtered tangent is their preconditioner,
    so that near the minimum, where both agree, one factorisation gives the step.

    Reference:
        Steihaug 1983, SIAM J. Numer. Anal. 20:626.
    """

    def __init__(self, problem: Problem) -> None:
        """Creates SNES, KSP and the matrix for a problem."""
        self.problem = problem
        self.count = Count()
        solve = problem.scene.solve
        self._deadline = None if solve.time_limit is None else time.monotonic() + solve.time_limit
        self.direct = solve.linear == "direct" or (solve.linear == "auto" and problem.size <= DIRECT_LIMIT)
        self.matrix = self._create_matrix()
        self.x = _vector(problem)
        self._failure: NotConverged | None = None
        self._until: Callable[[], bool] | None = None
        self._watchful, self._patience = False, np.inf

        self.snes = self._create_snes(self.matrix)
        self.snes.setType("python")
        self.snes.setPythonContext(self)
        _configure(self.snes.getKSP(), problem, self.direct)
        self.snes.setFromOptions()

    def _create_matrix(self) -> PETSc.Mat:
        matrix = dolfinx.fem.petsc.create_matrix(self.problem.potential.tangent[0])
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, self.problem.potential.loads.conservative)
        if not self.direct:
            matrix.setNearNullSpace(rigid_motions(self.problem))
        return matrix

    def _create_snes(self, preconditioner: PETSc.Mat) -> PETSc.SNES:
        problem = self.problem
        snes = PETSc.SNES().create(problem.comm)
        snes.setFunction(self._function, self.x.duplicate())
        snes.setJacobian(self._jacobian, self.matrix, preconditioner)
        if problem.potential.loads.conservative:
            snes.setObjective(self._objective)
        snes.setTolerances(rtol=0.0, atol=0.0, stol=0.0, max_it=problem.scene.solve.max_iterations)
        return snes

    @cached_property
    def _trust_region(self) -> PETSc.SNES:
        snes = self._create_snes(self._create_matrix())
        snes.setOptionsPrefix("trust_")
        snes.setType("newtontr")
        snes.setConvergenceTest(self._in_balance)
        ksp, pc = snes.getKSP(), snes.getKSP().getPC()
        ksp.setType("stcg")
        ksp.setTolerances(rtol=1e-2, max_it=200)
        pc.setType("cholesky" if self.direct else "gamg")
        if self.direct:
            pc.setFactorSolverType("mumps")
        snes.setFromOptions()
        return snes

    # ------------------------------------------------------------------ SNES callbacks

    def _full(self, x: PETSc.Vec) -> Array:
        values = np.zeros_like(self.problem.u.x.array)
        values[: self.problem.owned] = x.array_r
        return values

    def _objective(self, snes: PETSc.SNES, x: PETSc.Vec) -> float:
        energy = self.problem.energy_at(self._full(x))
        return energy if np.isfinite(energy) else np.inf

    def _function(self, snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        residual = self.problem.residual_at(self._full(x))
        self._scale = max(self._scale, self.problem.norm(residual))
        residual[self.problem.held] = 0.0
        f.array[:] = residual[: self.problem.owned]

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, matrix: PETSc.Mat, preconditioner: PETSc.Mat) -> None:
        self.problem.set_state(self._full(x))
        self.assemble("none")
        if preconditioner.handle != matrix.handle:
            self.assemble("clamp" if self.problem.potential.can_filter else "none", preconditioner)

    def _in_balance(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]) -> int:
        solve = self.problem.scene.solve
        try:
            self._check_time()
        except NotConverged as failure:
            self._failure = failure
            return PETSc.SNES.ConvergedReason.DIVERGED_FUNCTION_COUNT
        # Where the last step met no negative curvature and stayed inside, Newton's would be the same.
        inside = snes.getKSP().getConvergedReason() == PETSc.KSP.ConvergedReason.CONVERGED_RTOL
        if inside and norms[2] <= max(HANDOVER, solve.tolerance) * self._scale:
            return PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE
        self.problem.set_state(self._full(snes.getSolution()))
        if self._until is not None and self._until():
            return PETSc.SNES.ConvergedReason.CONVERGED_ITS
        return PETSc.SNES.ConvergedReason.CONVERGED_ITERATING

    def solve(self, snes: PETSc.SNES, b: Any, x: PETSc.Vec) -> None:
        """SNES's call to the type "python"; leaves the solution in x, or the reason in `_failure`."""

        def monitor(iteration: int, norm: float) -> None:
            self._check_time()
            snes.setIterationNumber(iteration)
            snes.setFunctionNorm(norm)
            snes.monitor(iteration, norm)

        try:
            values = Newton(self, self._full(x), self._watchful, self._patience).run(monitor, self._until)
            x.array[:] = values[: self.problem.owned]
            snes.setConvergedReason(PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE)
        except NotConverged as failure:
            self._failure = failure
            snes.setConvergedReason(PETSc.SNES.ConvergedReason.DIVERGED_LINE_SEARCH)

    def _check_time(self) -> None:
        if self._deadline is None:
            return
        late = time.monotonic() > self._deadline
        if self.problem.comm.allreduce(late):
            limit = self.problem.scene.solve.time_limit
            raise NotConverged("time", f"stopped after the {limit:g} s of solve.time_limit", self.problem.state)

    def assemble(self, filtering: Filter, into: PETSc.Mat | None = None) -> None:
        """Assembles the tangent at the current state, rows and columns of prescribed displacements aside.

        Args:
            filtering: What is done to negative eigenvalues, point by point.
            into: The matrix; by default the one that `linear_solve` reads.
        """
        problem, matrix = self.problem, self.matrix if into is None else into
        problem.potential.set_filter("clamp" if filtering == "shifted" else filtering)
        matrix.zeroEntries()
        for form in problem.potential.tangent:
            dolfinx.fem.petsc.assemble_matrix(matrix, form, problem.conditions, 0.0)  # type: ignore[arg-type]
        matrix.assemble()
        if filtering == "shifted":
            matrix.shift(self._shift)
        # A diagonal of the size of the others keeps the prescribed rows out of the conditioning.
        diagonal = matrix.getDiagonal()
        diagonal.array[problem.held[: problem.owned]] = self._typical(diagonal)
        matrix.setDiagonal(diagonal)

    @cached_property
    def _shift(self) -> float:
        """A thousandth of the mean diagonal of the tangent at rest."""
        kept = self.problem.state
        self.problem.set_state(np.zeros_like(kept))
        matrix = self._create_matrix()
        self.assemble("none", matrix)
        self.problem.set_state(kept)
        return 1e-3 * matrix.getDiagonal().sum() / self.problem.size

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

    def minimize(
        self, values: Array, until: Callable[[], bool] | None = None, patience: float = PATIENCE
    ) -> Array:
        """The minimiser from a state whose prescribed displacements are right.

        Args:
            values: The state.
            until: Stops early where it holds of the problem's state.
            patience: Filtered steps in a row before the trust region takes over.

        Raises:
            NotConverged: With the kind of failure; the problem's state is then of no use.
        """
        problem = self.problem
        if problem.scene.solve.method == "trust-region":
            values = self.roam(values, until)
        can_roam = problem.potential.loads.conservative and problem.potential.can_filter
        for seed in range(ROAMS if can_roam else 0):
            try:
                # A prediction may well be in balance: at rest, without loads.
                self._watchful, self._patience = True, patience
                return self._solve(self.snes, values, until)
            except NotConverged as failure:
                if failure.kind not in ("saddle", "crawling", "stalled", "indefinite"):
                    raise
                noise = NOISE * problem.extent * (2 * uniform(problem, seed) - 1)
                shaken = failure.values + problem.joined(noise.ravel())
                values = self.roam(np.where(problem.held, values, shaken), until)
        self._watchful, self._patience = False, np.inf
        return self._solve(self.snes, values, until)

    def roam(self, values: Array, until: Callable[[], bool] | None = None) -> Array:
        """Goes by the trust region to where Newton's method can take over, or as far as it gets.

        Raises:
            NotConverged: If the time is up, or the loads have no potential.
        """
        if not self.problem.potential.loads.conservative:
            raise NotConverged("undefined", "a trust region needs loads with a potential", values)
        return self._solve(self._trust_region, values, until)

    def _solve(self, snes: PETSc.SNES, values: Array, until: Callable[[], bool] | None) -> Array:
        self.x.array[:] = values[: self.problem.owned]
        self._failure, self._until, self._scale = None, until, 0.0
        try:
            snes.solve(None, self.x)
        finally:
            if snes.getType() != "python":
                self.count.newton += snes.getIterationNumber()
                self.count.linear += snes.getLinearSolveIterations()
        if self._failure is not None:
            raise self._failure
        result = self._full(self.x)
        self.problem.set_state(result)
        reason = snes.getConvergedReason()
        if reason < 0 and snes.getType() != "newtontr":
            kind = "iterations" if reason == PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT else "stalled"
            raise NotConverged(kind, f"SNES {snes.getType()} stopped with reason {reason}", self.problem.state)
        return self.problem.state

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
            # A factorisation that met a singular matrix would stay failed.
            ksp.getPC().reset()
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


def _configure(ksp: PETSc.KSP, problem: Problem, direct: bool) -> None:
    pc = ksp.getPC()
    if direct:
        ksp.setType("preonly")
        pc.setType("cholesky" if problem.potential.loads.conservative else "lu")
        pc.setFactorSolverType("mumps")
        return
    ksp.setType("cg" if problem.potential.loads.conservative else "gmres")
    ksp.setTolerances(max_it=2000)
    pc.setType("gamg")


def rigid_motions(problem: Problem) -> PETSc.NullSpace:
    """Translations and rotations of the reference body: what algebraic multigrid must represent."""
    d, owned = problem.dimension, problem.owned_displacements
    coordinates = PETSc.Vec().createMPI((owned, PETSc.DETERMINE), bsize=d, comm=problem.comm)
    nodes = owned // d
    points = problem.V.tabulate_dof_coordinates()[:nodes, : problem.dimension]
    coordinates.array[:] = points.ravel()
    return PETSc.NullSpace().createRigidBody(coordinates)
