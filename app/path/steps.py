"""The load path's steps, and what is known of those that were reached."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from elastune.app.body.unknowns import State
from elastune.app.solvers.outcome import Event, NotConverged

# Told the load and the Newton steps so far after each increment, also between recorded steps.
Report = Callable[[float, int], None]


@dataclass(frozen=True)
class Step:
    """A part of the load path.

    Attributes:
        start: Load factor that it sets out from.
        end: Load factor that it leads to.
        parts: Recorded steps in it.
        name: What people call it.
    """

    start: float = 0.0
    end: float = 1.0
    parts: int = 1
    name: str = ""

    def goals(self) -> list[float]:
        """The load factors of the recorded steps."""
        return [self.start + (self.end - self.start) * number / self.parts for number in range(1, self.parts + 1)]


@dataclass(frozen=True)
class Reached:
    """A recorded step.

    Attributes:
        number: From one on.
        name: Of the part of the path.
        state: In balance.
        newton: Newton steps since the one before.
        linear: Iterations of the linear solver, one a direct solve, since then.
        stable: Whether it is a minimum; None where nobody tells.
        events: What happened since then.
    """

    number: int
    name: str
    state: State
    newton: int
    linear: int
    stable: bool | None = None
    events: tuple[Event, ...] = ()

    @property
    def load(self) -> float:
        """The load factor."""
        return self.state.load


class PathFailure(Exception):
    """The load path ends before its end.

    Attributes:
        kind: See `NotConverged`.
        load: The load that was not reached.
        state: Where the last attempt stopped, or None.
        events: What happened since the last recorded step.
    """

    def __init__(self, failure: NotConverged, load: float, events: Sequence[Event] = ()) -> None:
        super().__init__(str(failure))
        self.events = tuple(events)
        self.kind, self.load, self.state = failure.kind, load, failure.state
