"""Newton's method: the true tangent where it is one of descent, a more convex one where it is not."""

from collections.abc import Callable

import numpy as np

from elastune.app.body.body import Body
from elastune.app.body.unknowns import State
from elastune.app.solvers.globalise.balance import Balance
from elastune.app.solvers.globalise.merit import choose
from elastune.app.solvers.linear.solver import LinearSolver
from elastune.app.solvers.options import Options
from elastune.app.solvers.outcome import Crawling, Indefinite, Saddle, Stalled, TooManySteps, Undefined
from elastune.forms.terms import RAW, Convexity

# A true tangent that failed is tried again once the error has fallen to this share.
RETRY = 0.3

# Forces so small, relative to the largest on the way, that a filtered tangent is heading for a saddle point if the
# true one has negative eigenvalues.
NEARLY = 1e-6

# Where steps crawl with forces below this share, a saddle point is what they crawl along.
CLOSE = 1e-3

# The least accurate solution of a linear system that is worth a step.
LOOSEST = 1e-2


def ladder(body: Body, options: Options) -> list[Convexity]:
    """From the true tangent to more and more convex ones.

    Filtered point by point, a tangent is convex; the membrane's share is for collapsed bodies, whose filtered tangent
    may be zero, and for mixed elements, whose pressures' part no filter sees.
    """
    if body.p is not None:
        filtering = "clamp" if body.parts.can_filter else "none"
        return [RAW, *(Convexity(filtering, share) for share in (0.0, 0.25, 1.0, 4.0, 16.0))]  # type: ignore[arg-type]
    if not body.parts.can_filter or options.filter == "none":
        return [RAW]
    if options.filter == "auto":
        return [RAW, Convexity("clamp"), Convexity("clamp", 0.02)]
    return [Convexity(options.filter), Convexity("clamp", 0.02)]


class Newton:
    """One minimisation: every step lowers the merit, and the last ones, with the true tangent, are quadratic."""

    def __init__(
        self,
        linear: LinearSolver,
        options: Options,
        start: State,
        watchful: bool,
        patience: float,
        unstable: Callable[[State], bool],
        suspicious: bool = False,
    ) -> None:
        """Starts at a state whose prescribed displacements are right.

        Args:
            linear: Gives directions.
            options: Tolerance, number of steps and filter.
            start: The state.
            watchful: Whether to stop at saddle points.
            patience: Filtered steps in a row before it stops too.
            unstable: Whether the tangent at a state has a negative eigenvalue that it should not have.
            suspicious: Whether to ask that of every true tangent whose linear solver does not tell: near a saddle point
                that was left its steps would lead back.

        Raises:
            Undefined: If the merit is not finite there.
        """
        self._linear, self._tangent, self._options = linear, linear.tangent, options
        self.body = linear.tangent.body
        self.state, self.balance = start, Balance(self.body)
        self._merit, self._ladder = choose(self.body, self.balance), ladder(self.body, options)
        self._watchful, self._unstable, self._patience = watchful, unstable, patience
        self._suspicious = suspicious
        # A start may be in balance where it should not.
        self._doubtful = watchful
        self._filtered, self._rung, self._failed_at = 0, 0, np.inf
        self._previous: float | None = None
        if not np.isfinite(self._merit.value(start)):
            raise Undefined("the energy or the forces are not finite at the start of the step", start)

    def run(self, monitor: Callable[[int, State, float], None], until: Callable[[], bool] | None = None) -> State:
        """Steps until the forces balance.

        Args:
            monitor: Told number, state and norm of the forces out of balance before each step; may stop it by raising.
            until: Stops early where it holds of the body's state.

        Raises:
            NotConverged: With the kind of failure and the last iterate.
        """
        options = self._options
        for iteration in range(options.max_iterations + 1):
            state = self.state
            self.body.take(state)
            self.balance.accept(state)
            error = self.balance.error(state)
            monitor(iteration, state, self.balance.parts(state)[0])
            if until is not None and until():
                return state
            if self._doubtful and error <= max(NEARLY, options.tolerance) and self._on_saddle(state):
                raise Saddle(f"a saddle point, residual {error:.1e}", state)
            if error <= options.tolerance:
                self._tangent.settled = self._tangent.convexity == RAW and self._tangent.state is not None
                return state
            if self._filtered > self._patience:
                if error <= CLOSE and self._on_saddle(state):
                    raise Saddle(f"near a saddle point, residual {error:.1e}", state)
                raise Crawling(f"{iteration} Newton steps, residual {error:.1e}", state)
            if iteration < options.max_iterations:
                self.state = self._step(state, error)
        raise TooManySteps(f"{iteration} Newton steps, residual {error:.1e}", self.state)

    def _on_saddle(self, state: State) -> bool:
        """Whether the tangent has a negative eigenvalue at a state nearly in balance."""
        if self._unstable(state):
            return True
        self._doubtful, self._failed_at = False, np.inf
        return False

    def _step(self, state: State, error: float) -> State:
        """The state after a step along the first direction, from the true tangent on, that lowers the merit."""
        self._linear.count.newton += 1
        forcing = self._forcing(error)
        residual = self.balance.out_of_balance(state)
        direction = None
        for number in self._rungs(error):
            raw = self._ladder[number] == RAW
            self._tangent.assemble(state, self._ladder[number])
            self._linear.setup()
            misleading = raw and self._suspicious and self._unstable(state)
            direction = None if misleading else self._linear.solve(-residual, forcing)
            if direction is not None:
                found = self._merit.search(state, direction.step, not raw, direction.counted)
                if found is not None:
                    # One less convex than what served will do for the next step, or the true one.
                    self._rung = number - 1
                    self._filtered = 0 if raw else self._filtered + 1
                    self._doubtful = self._watchful and not raw
                    return found
            if raw:
                self._failed_at = error
        if direction is None:
            raise Indefinite("the tangent gives no direction of descent, and no filter is left to try", state)
        raise Stalled(f"no step lowers the energy, residual {error:.1e}", state)

    def _forcing(self, error: float) -> float:
        """Relative residual of the linear solve: as small as a quadratic step deserves, and the tolerance asks for."""
        ratio = 1.0 if self._previous is None else error / self._previous
        self._previous = error
        return min(LOOSEST, max(0.1 * ratio**2, 0.1 * self._options.tolerance / error))

    def _rungs(self, error: float) -> list[int]:
        """What to try, in this order."""
        convex = [*range(max(1, self._rung), len(self._ladder))]
        hopeless = self._ladder[0] == RAW and RETRY * self._failed_at < error < np.inf
        return convex if convex and hopeless and self._failed_at < np.inf else [0, *convex]
