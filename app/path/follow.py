"""The load path: steps that are cut back where the minimiser fails and grow again where it does not."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from elastune.app.body.body import Array, Problem
from elastune.app.body.shapes import started
from elastune.app.errors import NotConverged
from elastune.app.path.blend import Blend
from elastune.app.path.recover import recover
from elastune.app.solvers.saddle import SaddlePoint
from elastune.app.solvers.strategy import Minimizer


@dataclass(frozen=True)
class State:
    """A state in balance."""

    load: float
    values: Array
    newton: int
    linear: int


class LoadFailure(Exception):
    """The load path ends before full load.

    Attributes:
        kind: See `NotConverged`.
        load: The load that was not reached.
        values: Where the last attempt stopped, a vector, or None.
    """

    def __init__(self, failure: NotConverged, load: float) -> None:
        super().__init__(str(failure))
        self.kind = failure.kind
        self.load = load
        self.values: Array | None = failure.values


def follow(problem: Problem, report: Callable[[float, int], None] | None = None) -> Iterator[State]:
    """States in balance at the multiples of 1/steps, up to full load; before a failure the last one reached.

    Args:
        problem: Starts from its reference shape, or the scene's start.
        report: Told the load and the Newton steps so far after each increment, also between the multiples.

    Raises:
        LoadFailure: If increments of the smallest size fail, the start, or the time is up.
    """
    solve = problem.scene.solve
    minimizer = Minimizer(problem) if problem.p is None else SaddlePoint(problem)
    blend = Blend(problem)
    values = np.zeros_like(problem.state)
    load, size = 0.0, 1.0 / solve.steps
    start, recorded = problem.scene.start, 0.0
    for number in range(1, solve.steps + 1):
        goal = number / solve.steps
        while load < goal:
            # A remainder too small to be worth a step of its own joins this one.
            target = goal if load + 1.01 * size >= goal else load + size
            try:
                if start is not None and isinstance(minimizer, Minimizer):
                    problem.potential.load.value = target
                    shape = np.where(problem.held, problem.prescribed(target), started(problem, start))
                    values, start = recover(problem, minimizer, shape), None
                else:
                    values = minimizer.minimize(_guess(problem, minimizer, blend, values, load, target))
            except NotConverged as failure:
                size = (target - load) / 2
                problem.potential.load.value = load
                problem.set_state(values)
                if start is not None or failure.kind == "time" or size < solve.smallest_step / solve.steps:
                    if load > recorded:
                        yield State(load, values, minimizer.count.newton, minimizer.count.linear)
                    raise LoadFailure(failure, target) from None
                continue
            load = target
            size = min(2 * size, 1.0 / solve.steps)
            if report is not None:
                report(load, minimizer.count.newton)
        recorded = load
        yield State(load, values, minimizer.count.newton, minimizer.count.linear)
        minimizer.count.newton = minimizer.count.linear = 0


def _guess(
    problem: Problem, minimizer: Minimizer | SaddlePoint, blend: Blend, values: Array, load: float, target: float
) -> Array:
    """The start of an increment: by the tangent, or where faces turn by the blended motion."""
    if not blend.turning:
        return minimizer.predict(values, target)
    problem.potential.load.value = target
    return blend.predict(values, load, target)
