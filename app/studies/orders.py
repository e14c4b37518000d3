"""What a table of errors says: orders of convergence, limits of sequences, the price of an accuracy."""

from collections.abc import Iterable, Sequence

import numpy as np


def fitted_order(h: Sequence[float], errors: Sequence[float], last: int = 3) -> float:
    """The exponent p of error = C h^p, by least squares in the logarithms over the finest meshes.

    Args:
        h: Sizes of the cells, any unit, any order.
        errors: As many errors.
        last: How many of the finest count.

    Returns:
        The order; NaN with fewer than two positive errors.
    """
    pairs = sorted((a, b) for a, b in zip(h, errors, strict=True) if b > 0 and np.isfinite(b))[:last]
    if len(pairs) < 2:
        return float("nan")
    x, y = np.log(np.array(pairs)).T
    return float(np.polyfit(x, y, 1)[0])


def limit(values: Sequence[float]) -> float:
    """The limit of three values on meshes in constant ratio (Richardson's extrapolation with the order unknown).

    Raises:
        ValueError: If the differences do not shrink, so that no limit is in sight.
    """
    a, b, c = values
    first, second = b - a, c - b
    if second == 0:
        return c
    if abs(second) >= abs(first):
        raise ValueError(f"expected differences that shrink, got {first:.3g} and then {second:.3g}")
    return c - second**2 / (second - first)


def price(points: Iterable[tuple[float, float]], tolerance: float) -> float:
    """The least cost of a point within the tolerance; infinity if none is.

    A coarse mesh may come near the truth by luck, with finer ones farther from it: a point counts if all that
    cost more are within the tolerance too.

    Args:
        points: Cost and error of each.
        tolerance: The error allowed.
    """
    best = float("inf")
    for cost, error in sorted(points, reverse=True):
        if not error <= tolerance:
            break
        best = cost
    return best
