"""The branch of equilibria that begins at rest, stable or not: as far as the load rises, or through its limits."""

from collections.abc import Iterator, Sequence

import numpy as np

from elastune.app.body.unknowns import State
from elastune.app.path.steps import PathFailure, Reached, Report, Step
from elastune.app.solvers.branches.branch import Branch
from elastune.app.solvers.branches.corrector import Point
from elastune.app.solvers.minimizer import Minimizer
from elastune.app.solvers.outcome import Event, LimitLoad, NotConverged

# Steps that Newton's method likes grow to so many times the first one.
GROWN = 4.0


def along(minimizer: Minimizer, branch: Branch, steps: Sequence[Step], report: Report | None) -> Iterator[Reached]:
    """Recorded steps of `solve.follow` "path" or "arc".

    Args:
        minimizer: Of the body.
        branch: Its own.
        steps: Parts of the load path; one of "arc".
        report: See `follow`.

    Raises:
        PathFailure: If the branch cannot be followed; if it turns back where it is to lead on.
    """
    count, number, events = minimizer.count, 0, list[Event]()
    through = minimizer.options.follow == "arc"
    point, recorded = branch.balanced(State(np.zeros(minimizer.body.layout.owned))), 0.0

    def reached(name: str) -> Reached:
        minimizer.body.take(point.state)
        happened = tuple(events)
        events.clear()
        stable = None if point.negative is None else point.negative == 0
        return Reached(number, name, point.state, count.newton, count.linear, stable, happened)

    for step in steps:
        for goal in [step.end] if through else step.goals():
            try:
                for following in _points(branch, point, step, goal, through):
                    events += _events(branch, point, following)
                    point = following
                    if report is not None:
                        report(point.state.load, count.newton)
                    if through or point.state.load == goal:
                        number, recorded = number + 1, point.state.load
                        yield reached(step.name)
                        count.newton = count.linear = 0
                    if through and number == minimizer.options.arc_steps:
                        return
            except NotConverged as failure:
                load = goal
                if isinstance(failure, LimitLoad):
                    load = failure.state.load
                    events.append(Event(load, "limit"))
                if point.state.load != recorded:
                    number += 1
                    yield reached(step.name)
                minimizer.body.take(point.state)
                raise PathFailure(failure, load, events) from None


def _points(branch: Branch, point: Point, step: Step, goal: float, through: bool) -> Iterator[Point]:
    """Points as far as a load, through limits or not."""
    if not through:
        yield from branch.toward(point.state, goal)
        return
    length = (step.end - step.start) / step.parts / point.direction.load
    yield from branch.on(point, goal, length, GROWN * length, through=True)


def _events(branch: Branch, one: Point, other: Point) -> list[Event]:
    """What happened between two points of a branch."""
    found: list[Event] = []
    if one.direction.load * other.direction.load < 0:
        found.append(Event(branch.turn(one, other).state.load, "limit"))
    elif one.negative == 0 and other.negative:
        found.append(Event(other.state.load, "buckled"))
    return found
