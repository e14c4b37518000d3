"""Minimises Π at one load: PETSc's SNES around Newton's method with an energy line search, or a trust region."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from petsc4py import PETSc

from elastune.app.body.body import Array, Problem
from elastune.app.body.shapes import uniform
from elastune.app.errors import NotConverged
from elastune.app.solvers.globalise.escape import escape
from elastune.app.solvers.newton import Newton
from elastune.app.solvers.tangent import Count, Deadline, Tangent, vector

# The trust region hands over where the forces have fallen to this share: the differences of the energy that it
# lives on are lost in rounding near the minimum, where Newton's method needs no help.
HANDOVER = 1e-4

# How often Newton's method is led on where it cannot go on, and the noise that moves the body before the trust
# region takes over, relative to its extent.
ATTEMPTS, NOISE = 6, 1e-4

# Filtered steps in a row after which steps that know negative curvature do better.
PATIENCE = 12


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
        self._deadline = Deadline(problem)
        snes = PETSc.SNES().create(problem.comm)
        self.tangent = Tangent(problem, snes.getKSP())
        self.x = vector(problem)
        self._failure: NotConverged | None = None
        self._until: Callable[[], bool] | None = None
        self._watchful, self._patience, self._scale = False, np.inf, 0.0

        self.snes = self._prepared(snes, self.tangent.matrix)
        self.snes.setType("python")
        self.snes.setPythonContext(self)
        self.snes.setFromOptions()

    def _prepared(self, snes: PETSc.SNES, preconditioner: PETSc.Mat) -> PETSc.SNES:
        problem = self.problem
        snes.setFunction(self._function, self.x.duplicate())
        snes.setJacobian(self._jacobian, self.tangent.matrix, preconditioner)
        if problem.potential.loads.conservative:
            snes.setObjective(self._objective)
        snes.setTolerances(rtol=0.0, atol=0.0, stol=0.0, max_it=problem.scene.solve.max_iterations)
        return snes

    @cached_property
    def _trust_region(self) -> PETSc.SNES:
        snes = self._prepared(PETSc.SNES().create(self.problem.comm), self.tangent.create_matrix())
        snes.setOptionsPrefix("trust_")
        snes.setType("newtontr")
        snes.setConvergenceTest(self._in_balance)
        ksp, pc = snes.getKSP(), snes.getKSP().getPC()
        ksp.setType("stcg")
        ksp.setTolerances(rtol=1e-2, max_it=200)
        pc.setType("cholesky" if self.tangent.direct else "gamg")
        if self.tangent.direct:
            pc.setFactorSolverType("mumps")
        snes.setFromOptions()
        return snes

    @property
    def count(self) -> Count:
        """What was spent."""
        return self.tangent.count

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
        self.tangent.assemble("none")
        if preconditioner.handle != matrix.handle:
            self.tangent.assemble("clamp" if self.problem.potential.can_filter else "none", preconditioner)

    def _in_balance(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]) -> int:
        solve = self.problem.scene.solve
        try:
            self._deadline.check()
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
            self._deadline.check()
            snes.setIterationNumber(iteration)
            snes.setFunctionNorm(norm)
            snes.monitor(iteration, norm)

        try:
            values = Newton(self.tangent, self._full(x), self._watchful, self._patience).run(monitor, self._until)
            x.array[:] = values[: self.problem.owned]
            snes.setConvergedReason(PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE)
        except NotConverged as failure:
            self._failure = failure
            snes.setConvergedReason(PETSc.SNES.ConvergedReason.DIVERGED_LINE_SEARCH)

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
        problem.potential.set_filter("none")
        rhs = problem.lift(increment) - residual
        if not self.tangent.fresh:
            self.tangent.assemble("none")
        step = self.tangent.linear_solve(rhs, 1e-6)
        if step is None and problem.potential.can_filter:
            self.tangent.assemble("clamp")
            rhs = problem.lift(increment) - residual
            step = self.tangent.linear_solve(rhs, 1e-6)
        if step is None:
            raise NotConverged("indefinite", "the prediction's tangent is not positive definite")
        return np.where(problem.held, values + increment, values + step)

    def minimize(self, values: Array, until: Callable[[], bool] | None = None, patience: float = PATIENCE) -> Array:
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
        for seed in range(ATTEMPTS if can_roam else 0):
            try:
                # A prediction may well be in balance: at rest, without loads.
                self._watchful, self._patience = True, patience
                return self._solve(self.snes, values, until)
            except NotConverged as failure:
                if failure.kind not in ("saddle", "crawling", "stalled", "indefinite"):
                    raise
                values = self._led_on(failure, values, seed, until)
        self._watchful, self._patience = False, np.inf
        return self._solve(self.snes, values, until)

    def _led_on(self, failure: NotConverged, values: Array, seed: int, until: Callable[[], bool] | None) -> Array:
        """Where to start again from, after Newton's method has set out from `values` and failed."""
        problem = self.problem
        lower = escape(self.tangent, failure.values) if failure.kind == "saddle" else None
        if lower is not None:
            return lower
        noise = NOISE * problem.extent * (2 * uniform(problem, seed) - 1)
        shaken = failure.values + problem.joined(noise.ravel())
        return self.roam(np.where(problem.held, values, shaken), until)

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
                self.tangent.count.newton += snes.getIterationNumber()
                self.tangent.count.linear += snes.getLinearSolveIterations()
        if self._failure is not None:
            raise self._failure
        result = self._full(self.x)
        self.problem.set_state(result)
        reason = snes.getConvergedReason()
        if reason < 0 and snes.getType() != "newtontr":
            kind = "iterations" if reason == PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT else "stalled"
            raise NotConverged(kind, f"SNES {snes.getType()} stopped with reason {reason}", self.problem.state)
        return self.problem.state
