"""One increment of the load, and what happens on its way: states that lose their stability, and limit loads."""

from itertools import islice

from elastune.app.body.unknowns import State
from elastune.app.path.blend import Blend
from elastune.app.path.predict import predict
from elastune.app.solvers.branches.corrector import Point
from elastune.app.solvers.minimizer import Minimizer
from elastune.app.solvers.outcome import Event, Failed, LimitLoad

# Points of a branch that are looked at on the way to a load.
LOOKED_AT = 20

# How often the part of a branch on which stability is lost is halved.
HALVINGS = 5

# How far from its prediction a state may be, over the increment, before the way to it is looked at.
FAR = 1.0


class Survey:
    """Increments of a body's load that know the branch they are on.

    Where Newton's method meets no difficulty and ends near its prediction, nothing more is done. Otherwise the branch
    is followed. If it leads to the new load and is stable there, that is the state; if it loses its stability on the
    way, the body goes off along the branch of its softest motion; if it turns back, the load has a limit.

    Attributes:
        events: What happened so far.
        stable: Whether the last state is a minimum; None where nobody tells.
    """

    def __init__(self, minimizer: Minimizer, blend: Blend) -> None:
        """Of a body."""
        self._minimizer, self._blend = minimizer, blend
        self.events: list[Event] = []
        self.stable: bool | None = None
        options = minimizer.options
        plain = options.method == "line-search" and options.filter == "auto"
        self._branch = minimizer.branch if plain else None
        self._loaded = any(term.factor is not None for term in minimizer.body.terms)
        # Whether the last state may be moved nearly without a force, as after buckling: Newton's method on Π would get
        # lost there.
        self._neutral = False

    def increment(self, state: State, load: float, prove: bool) -> State:
        """The state at a new load.

        Args:
            state: In balance at its own load.
            load: The new one.
            prove: See `Minimizer.minimize`.

        Raises:
            NotConverged: If there is none, or none was found.
        """
        # What only moves always ends somewhere: there is no need to look where Newton's method cannot go on.
        looks = self._branch is not None and self._loaded
        found = None
        if not self._neutral:
            try:
                guess = predict(self._minimizer, self._blend, state, load)
                found = self._minimum(guess, prove, led=not looks)
            except Failed:
                if not looks:
                    raise
            else:
                if self._minimizer.saddles:
                    self.events.append(Event(load, "buckled"))
                    return found
                if not self._far(state, guess, found):
                    return found
        return self._looked_at(state, load, found, prove)

    def _far(self, state: State, guess: State, found: State) -> bool:
        """Whether a state is farther from its prediction than that is from the state before; no where nobody looks."""
        if self._branch is None:
            return False
        whole, rest = guess.values - state.values, found.values - guess.values
        return self._branch.dot(rest, rest) > FAR**2 * self._branch.dot(whole, whole)

    def _minimum(self, guess: State, prove: bool, led: bool = True) -> State:
        found = self._minimizer.minimize(guess, prove=prove, led=led)
        self.stable, self._neutral = self._minimizer.proven, False
        return found

    def _looked_at(self, state: State, load: float, found: State | None, prove: bool) -> State:
        """The state at a new load, after a look at the branch that leads there; `found` is another one, or None."""
        assert self._branch is not None
        end, lost, before = None, None, state
        try:
            for end in islice(self._branch.toward(state, load), LOOKED_AT):
                if lost is None and self._minimizer.unstable(end):
                    lost = self._first(before, end)
                before = end.state
        except LimitLoad as limit:
            found = found or self._beyond(limit, state, load, prove)
            self.events.append(Event(limit.state.load, "snapped"))
            return found
        except Failed:
            end = None
        if end is None or end.state.load != load:
            # The branch does not tell.
            return found or self._minimum(predict(self._minimizer, self._blend, state, load), prove)
        if lost is None:
            return self._taken(end)
        try:
            off = self._minimizer.off(end)
        except Failed:
            off = None
        if off is not None and not self._minimizer.unstable(off):
            self._neutral, found = True, self._taken(off)
        found = found or self._minimum(end.state, prove)
        self.events.append(Event(lost, "buckled"))
        return found

    def _first(self, stable: State, unstable: Point) -> float:
        """The load at which the states between two of a branch lose their stability, to a few hundredths of the way."""
        assert self._branch is not None
        low, high = stable, unstable.state
        for _ in range(HALVINGS):
            middle = State((low.values + high.values) / 2, (low.load + high.load) / 2)
            try:
                found = self._branch.at(middle)
            except Failed:
                break
            low, high = (low, found.state) if found.negative else (found.state, high)
        return high.load

    def _beyond(self, limit: LimitLoad, state: State, load: float, prove: bool) -> State:
        """A state far from where the branch ended; under loads there may be none."""
        body = self._minimizer.body
        if not self._loaded:
            return self._minimum(predict(self._minimizer, self._blend, state, load), prove)
        try:
            return self._minimum(body.placed(limit.state.values, load), prove, led=False)
        except Failed:
            raise limit from None

    def _taken(self, point: Point) -> State:
        self.stable = None if point.negative is None else True
        self._neutral = self._neutral or bool(point.negative)
        return point.state
