"""The load path: steps that are cut back where the minimiser fails and grow again where it does not."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from elastune.app.body.body import Body
from elastune.app.body.shapes import Start, started
from elastune.app.body.unknowns import State
from elastune.app.errors import UserError
from elastune.app.path.along import along
from elastune.app.path.blend import Blend
from elastune.app.path.recover import recover
from elastune.app.path.steps import PathFailure, Reached, Report, Step
from elastune.app.path.survey import Survey
from elastune.app.solvers.minimizer import Minimizer
from elastune.app.solvers.options import Options
from elastune.app.solvers.outcome import Event, Failed, LimitLoad, NotConverged


def check_follow(options: Options, started: bool, stages: int) -> None:
    """Whether a branch of equilibria can be followed, if it is to be.

    Args:
        options: Of a run.
        started: Whether it sets out from another shape than that at rest.
        stages: Parts of its load path.

    Raises:
        UserError: If not.
    """
    key = f'solve.follow = "{options.follow}"'
    if options.follow == "minimum":
        return
    if started:
        raise UserError(f"{key}: expected no start: the branch begins with the body at rest")
    if options.linear == "iterative":
        raise UserError(f'{key}: expected solve.linear = "auto" or "direct", got "iterative"')
    if options.follow == "arc" and stages > 1:
        raise UserError(f"{key}: expected one stage, got {stages}")


def follow(
    body: Body,
    options: Options,
    start: Start | None = None,
    steps: Sequence[Step] | None = None,
    report: Report | None = None,
) -> Iterator[Reached]:
    """Recorded steps, the body holding each when it is yielded; before a failure the last state that was reached.

    Args:
        body: At rest.
        options: How it is solved.
        start: A shape to set out from instead of that at rest.
        steps: Parts of the path; one to full load by default.
        report: Told how it goes.

    Raises:
        PathFailure: If increments of the smallest size fail, the start, or the time is up; at a limit load.
    """
    minimizer, blend = Minimizer(body, options), Blend(body)
    path = steps or [Step(parts=options.steps)]
    if options.follow != "minimum":
        assert minimizer.branch is not None
        yield from along(minimizer, minimizer.branch, path, report)
        return
    count, number, survey = minimizer.count, 0, Survey(minimizer, blend)
    state, recorded = State(np.zeros(body.layout.owned)), 0.0

    def reached(name: str) -> Reached:
        body.take(state)
        events = tuple(survey.events)
        survey.events.clear()
        return Reached(number, name, state, count.newton, count.linear, survey.stable, events)

    for step in path:
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
                        state = survey.increment(state, target, prove=last)
                except NotConverged as failure:
                    size = (target - state.load) / 2
                    too_small = abs(size) < options.smallest_step * abs(largest)
                    if isinstance(failure, LimitLoad):
                        too_small, state = True, failure.state
                        survey.events.append(Event(state.load, "limit"))
                    if start is not None or not isinstance(failure, Failed) or too_small:
                        if state.load != recorded:
                            yield reached(step.name)
                        body.take(state)
                        load = state.load if isinstance(failure, LimitLoad) else target
                        raise PathFailure(failure, load, survey.events) from None
                    continue
                size = math.copysign(min(2 * abs(size), abs(largest)), largest)
                if report is not None:
                    report(state.load, count.newton)
            recorded = state.load
            yield reached(step.name)
            count.newton = count.linear = 0
