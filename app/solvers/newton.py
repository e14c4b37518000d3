"""Newton's method for a minimum: the raw tangent where it is positive definite, a filtered one where it is not."""

from collections.abc import Callable

import numpy as np

from elastune.app.body.body import Array
from elastune.app.errors import NotConverged
from elastune.app.solvers.globalise.merit import Merit
from elastune.app.solvers.tangent import Filter, Tangent

# A raw tangent that was indefinite is tried again once the forces have fallen to this share.
RETRY = 0.3

# Forces so small, relative to the largest on the way, that a filtered tangent is heading for a saddle point if the
# raw one is indefinite.
NEARLY = 1e-6


# Where steps crawl with forces below this share, a saddle point is what they crawl along.
CLOSE = 1e-3


class Newton:
    """One minimisation: every step goes downhill, and the last ones, with the raw tangent, are quadratic."""

    def __init__(self, tangent: Tangent, values: Array, watchful: bool, patience: float) -> None:
        """Starts at a state whose prescribed displacements are right.

        Args:
            tangent: Gives directions.
            values: The state.
            watchful: Whether to stop at saddle points.
            patience: Filtered steps in a row before it stops too.

        Raises:
            NotConverged: If the energy is not finite there.
        """
        self._tangent = tangent
        self._problem = tangent.problem
        self._problem.set_state(values)
        self.merit = Merit(self._problem, self._problem.state)
        self._failed_at: float | None = None
        self._previous: float | None = None
        # A start may be in balance where it should not.
        self._doubtful = watchful
        self._watchful = watchful
        self._patience, self._filtered = patience, 0
        # Whether the tangent that was assembled last is unfiltered.
        self._raw = False

    def run(self, monitor: Callable[[int, float], None], until: Callable[[], bool] | None = None) -> Array:
        """Steps until the forces balance.

        Args:
            monitor: Told the number and the norm of the forces out of balance before each step.
            until: Stops early where it holds of the problem's state.

        Raises:
            NotConverged: With the kind of failure and the last iterate.
        """
        merit, solve = self.merit, self._problem.scene.solve
        for iteration in range(solve.max_iterations + 1):
            monitor(iteration, self._problem.norm(merit.gradient))
            self._problem.set_state(merit.values)
            if until is not None and until():
                return merit.values
            # Relative to the largest forces on the way: those at the prescribed displacements are among them.
            if self._doubtful and merit.error <= max(NEARLY, solve.tolerance) and self._on_saddle():
                raise NotConverged("saddle", f"a saddle point, residual {merit.error:.1e}", merit.values)
            if merit.error <= solve.tolerance:
                self._tangent.fresh = self._raw
                return merit.values
            if self._filtered > self._patience:
                if merit.error <= CLOSE and self._on_saddle():
                    raise NotConverged("saddle", f"near a saddle point, residual {merit.error:.1e}", merit.values)
                raise NotConverged("crawling", f"{iteration} Newton steps, residual {merit.error:.1e}", merit.values)
            if iteration < solve.max_iterations:
                self._step()
        raise NotConverged("iterations", f"{iteration} Newton steps, residual {merit.error:.1e}", merit.values)

    def _on_saddle(self) -> bool:
        """Whether the tangent has a negative eigenvalue at a state nearly in balance."""
        problem = self._problem
        self._tangent.assemble("none")
        # Conjugate gradients find a negative eigenvalue only where the right-hand side has a share of its vector.
        rhs = np.where(problem.held, 0.0, np.random.default_rng(0).standard_normal(len(problem.held)))
        if self._tangent.linear_solve(rhs, 1e-3) is None:
            return True
        self._doubtful, self._failed_at, self._raw = False, None, True
        return False

    def _step(self) -> None:
        merit, norm = self.merit, self._problem.norm(self.merit.gradient)
        ratio = None if self._previous is None else norm / self._previous
        forcing = 1e-2 if ratio is None else min(1e-2, max(0.1 * ratio**2, 1e-8))
        self._previous = norm
        self._tangent.count.newton += 1
        for name in self._filters(norm):
            self._problem.set_state(merit.values)
            self._tangent.assemble(name)
            step = self._tangent.linear_solve(-merit.gradient, forcing)
            if step is not None:
                step[self._problem.held] = 0.0
                if merit.descends(step) and merit.search(step, name != "none") is not None:
                    self._raw = name == "none"
                    self._doubtful = self._watchful and not self._raw
                    self._filtered = 0 if self._raw else self._filtered + 1
                    return
            if name == "none":
                self._failed_at = norm
        if step is None:
            raise NotConverged(
                "indefinite", "the tangent is not positive definite, and no filter is left to try", merit.values
            )
        raise NotConverged("stalled", f"no step lowers the energy, residual {merit.error:.1e}", merit.values)

    def _filters(self, norm: float) -> list[Filter]:
        """What to try, in this order."""
        asked = self._problem.scene.solve.filter
        if not self._problem.potential.can_filter:
            return ["none"]
        if asked != "auto":
            return [asked] if asked == "none" else [asked, "shifted"]
        promising = self._failed_at is None or norm <= RETRY * self._failed_at
        return ["none", "clamp", "shifted"] if promising else ["clamp", "shifted"]
