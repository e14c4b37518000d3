"""How far to go along a direction: backtracking and doubling on functions of one number."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

# Of the decrease that the slope promises, what is asked for (Armijo).
DECREASE = 1e-4


@dataclass(frozen=True)
class Line:
    """A merit along a direction, as a function of the length.

    Attributes:
        value: The merit; not finite where there is none.
        start: Its value at zero.
        slope: Its derivative at zero, negative.
        rounding: By how much rounding may change it.
        agrees: Decides on a length where the decrease drowns in rounding; unless given, no decrease is asked for there.
    """

    value: Callable[[float], float]
    start: float
    slope: float
    rounding: float = 0.0
    agrees: Callable[[float], bool] | None = None

    def accepts(self, length: float, value: float) -> bool:
        """Whether a length lowers the merit enough."""
        wanted = self.start + DECREASE * length * self.slope
        if self.agrees is None:
            return value <= wanted + self.rounding
        return value <= wanted or (value <= self.start + self.rounding and self.agrees(length))


def backtrack(line: Line, first: float = 1.0, shortest: float = 1e-9) -> float | None:
    """The first acceptable one of a length and shorter ones, or None if only the shortest are left.

    Each is the minimum of the parabola through what is known, within a tenth and a half of the one before.
    """
    length = first
    while length > shortest * first:
        value = line.value(length)
        if np.isfinite(value) and line.accepts(length, value):
            return length
        best = 0.5 * length
        if np.isfinite(value):
            curvature = 2 * (value - line.start - length * line.slope)
            best = -line.slope * length**2 / curvature if curvature > 0 else best
        length = float(np.clip(best, 0.1 * length, 0.5 * length))
    return None


def extend(line: Line, length: float, longest: float) -> float:
    """Doubles an acceptable length as long as the merit falls."""
    value = line.value(length)
    while 2 * length <= longest:
        farther = line.value(2 * length)
        if not farther < value:
            break
        length, value = 2 * length, farther
    return length


def lowering(value: Callable[[float], float], first: float, least: float, rounding: float = 0.0) -> float | None:
    """Halves a length until the merit is lower than at zero, and on while that lowers it further; or None."""
    length, lowest, found = first, value(0.0) - rounding, None
    while length > least:
        here = value(length)
        if here < lowest:
            found, lowest = length, here
        elif found is not None:
            break
        length /= 2
    return found
