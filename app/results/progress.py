"""Who is told how a run goes."""

from typing import Any

from elastune.app.results.record import Record
from elastune.app.solvers.outcome import Event


class Progress:
    """Who is told how a run goes: nobody, unless a subclass listens."""

    def start(self, run: Any) -> None:
        """The body of a `Run` is about to be solved."""

    def increment(self, load: float, newton: int) -> None:
        """A load increment has converged, after so many Newton steps of its recorded step."""

    def event(self, event: Event) -> None:
        """The body has buckled, or snapped, or met a limit load."""

    def step(self, record: Record) -> None:
        """A step has been recorded."""
