"""The load path: steps that are cut back where the minimiser fails and grow again where it does not."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from elastune.app.body.body import Body
from elastune.app.body.shapes import Start, started
from elastune.app.body.unknowns import State
from elastune.app.path.blend import Blend
from elastune.app.path.predict import predict
from elastune.app.path.recover import recover
from elastune.app.solvers.minimizer import Minimizer
from elastune.app.solvers.options import Options
from elastune.app.solvers.outcome import NotConverged, OutOfTime, Stopped


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
    """

    number: int
    name: str
    state: State
    newton: int
    linear: int

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
    """

    def __init__(self, failure: NotConverged, load: float) -> None:
        super().__init__(str(failure))
        self.kind, self.load, self.state = failure.kind, load, failure.state


def follow(
    body: Body,
    options: Options,
    start: Start | None = None,
    steps: Sequence[Step] | None = None,
    report: Callable[[float, int], None] | None = None,
) -> Iterator[Reached]:
    """Recorded steps, the body holding each when it is yielded; before a failure the last state that was reached.

    Args:
        body: At rest.
        options: How it is solved.
        start: A shape to set out from instead of that at rest.
        steps: Parts of the path; one to full load by default.
        report: Told the load and the Newton steps so far after each increment, also between recorded steps.

    Raises:
        PathFailure: If increments of the smallest size fail, the start, or the time is up.
    """
    minimizer, blend = Minimizer(body, options), Blend(body)
    count, number = minimizer.count, 0
    state, recorded = State(np.zeros(body.layout.owned)), 0.0

    def reached(name: str) -> Reached:
        body.take(state)
        return Reached(number, name, state, count.newton, count.linear)

    for step in steps or [Step(parts=options.steps)]:
        largest = (step.end - step.start) / step.parts
        size = largest
        for goal in step.goals():
            number += 1
            while state.load != goal:
                # A remainder too small to be worth a step of its own joins this one.
                last = abs(goal - state.load) <= 1.01 * abs(size)
                target = goal if last else state.load + size
                try:
                    if start is not None:
                        shape = body.placed(started(body, start), target)
                        state, start = recover(body, minimizer, shape, prove=last), None
                    else:
                        state = minimizer.minimize(predict(minimizer, blend, state, target), prove=last)
                except NotConverged as failure:
                    size = (target - state.load) / 2
                    too_small = abs(size) < options.smallest_step * abs(largest)
                    if start is not None or isinstance(failure, OutOfTime | Stopped) or too_small:
                        if state.load != recorded:
                            yield reached(step.name)
                        body.take(state)
                        raise PathFailure(failure, target) from None
                    continue
                size = math.copysign(min(2 * abs(size), abs(largest)), largest)
                if report is not None:
                    report(state.load, count.newton)
            recorded = state.load
            yield reached(step.name)
            count.newton = count.linear = 0
