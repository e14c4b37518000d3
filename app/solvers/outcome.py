"""How a minimisation ends short, what happens on a path, what was spent, and when the time is up."""

import signal
import time
from dataclasses import dataclass
from typing import ClassVar, Literal

from mpi4py import MPI

from elastune.app import interrupts
from elastune.app.body.unknowns import State


class NotConverged(Exception):
    """The minimiser stopped short.

    Attributes:
        kind: One word, by class.
        state: Where it stopped, or None.
    """

    kind: ClassVar[str] = ""

    def __init__(self, message: str, state: State | None = None) -> None:
        super().__init__(message)
        self.state = state


class Failed(NotConverged):
    """This way no state was found: another may be tried."""


class Undefined(Failed):
    """The energy or the forces are not finite where a step has to start."""

    kind = "undefined"


class TooManySteps(Failed):
    """Newton's method has had its steps."""

    kind = "iterations"


class LinearFailure(Failed):
    """The linear solver broke down."""

    kind = "linear"


class OutOfTime(NotConverged):
    """The time limit has passed."""

    kind = "time"


class Stopped(NotConverged):
    """A signal asked to stop."""

    kind = "interrupted"

    def __init__(self, number: int, state: State | None = None) -> None:
        super().__init__(f"stopped by {signal.Signals(number).name}", state)


class LimitLoad(Failed):
    """The branch of equilibria turns back before the load that was asked for; its state is where."""

    kind = "limit"
    state: State

    def __init__(self, message: str, state: State) -> None:
        super().__init__(message, state)


class LeadOn(Failed):
    """Newton's method cannot go on by itself, but may from elsewhere."""


class Indefinite(LeadOn):
    """The tangent gives no direction of descent, however filtered."""

    kind = "indefinite"


class Stalled(LeadOn):
    """No step along any direction lowers the merit."""

    kind = "stalled"


class Saddle(LeadOn):
    """A state in balance, or nearly so, that is no minimum."""

    kind = "saddle"


class Crawling(LeadOn):
    """Many filtered steps in a row lead nowhere."""

    kind = "crawling"


@dataclass(frozen=True)
class Event:
    """What happened on the path.

    Attributes:
        load: Where.
        kind: "buckled": the state lost its stability, others branch off; "snapped": the branch ended, and the body went
            to a state far away; "limit": the load has a maximum or a minimum along the branch.
    """

    load: float
    kind: Literal["buckled", "snapped", "limit"]


@dataclass
class Count:
    """What was spent."""

    newton: int = 0
    linear: int = 0


class Deadline:
    """The moment at which the time is up, counted from now."""

    def __init__(self, comm: MPI.Comm, limit: float | None) -> None:
        """Without a limit there is none."""
        self._comm, self._limit = comm, limit
        self._end = None if limit is None else time.monotonic() + limit

    def check(self, state: State) -> None:
        """Stops all ranks together.

        Raises:
            Stopped: If a signal asked any of them to.
            OutOfTime: If the time is up on any of them.
        """
        if number := interrupts.asked(self._comm):
            raise Stopped(number, state)
        if self._end is not None and self._comm.allreduce(time.monotonic() > self._end):
            raise OutOfTime(f"stopped after the {self._limit:g} s of solve.time_limit", state)
