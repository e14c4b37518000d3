"""Sizes of cells that shrink towards one end of a line, or towards both."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def relative_sizes(count: int, start: float | None = None, end: float | None = None) -> Array:
    """Return the sizes of the cells along a line over their average.

    With t from 0 at the first cell to 1 at the last, the size is exp(a + c t), a geometric progression,
    when one end is graded, and exp(a (1 - t) + b t + c t (1 - t)) when both are: a and b give the ends the
    ratio asked for, c gives all cells the average 1. At a given ratio and a growing count the sizes tend
    to one smooth function of t, so refinement keeps its rate of convergence.

    Args:
        count: Number of cells; at least 2 for one graded end, 3 for two.
        start: Size of the first cell over the average, in (0, 1]; None leaves this end free.
        end: The same for the last cell.

    Returns:
        Relative sizes, shape (count,), mean 1.
    """
    if start is None and end is not None:
        return relative_sizes(count, end)[::-1]
    if start is None:
        return np.ones(count)
    t = np.linspace(0.0, 1.0, count)
    fixed, free = np.log(start) * np.ones(count), t
    if end is not None:
        fixed, free = np.log(start) * (1 - t) + np.log(end) * t, t * (1 - t)

    # The mean grows with c; it is at most 1 at c = 0, and at least 1 where one cell alone has size `count`.
    low, high = 0.0, (np.log(count) - np.min(fixed)) / max(np.max(free), np.finfo(float).tiny)
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if np.mean(np.exp(fixed + middle * free)) < 1 else (low, middle)
    sizes: Array = np.exp(fixed + high * free)
    return sizes


def knots(length: float, count: int, start: float | None = None, end: float | None = None) -> Array:
    """Return the ends of cells from 0 to `length` in the sizes of `relative_sizes`, shape (count + 1,)."""
    ends = np.concatenate([[0.0], np.cumsum(relative_sizes(count, start, end))])
    scaled: Array = length * (ends / ends[-1])
    return scaled
