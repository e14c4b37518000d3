"""The line search on functions of one number whose minima are known."""

import math
from collections.abc import Callable

import pytest

from elastune.app.solvers.globalise.linesearch import Line, backtrack, extend, lowering


def line(value: Callable[[float], float], slope: float, rounding: float = 0.0, agrees: Callable | None = None) -> Line:
    return Line(value, value(0.0), slope, rounding, agrees)


def test_a_newton_step_of_a_quadratic_is_whole() -> None:
    assert backtrack(line(lambda x: (x - 1) ** 2, -2)) == 1.0


@pytest.mark.parametrize("minimum", [0.3, 0.05, 1e-3, 1e-6])
def test_an_overshooting_step_comes_back_to_the_minimum(minimum: float) -> None:
    """The parabola through two values and a slope is exact for a quadratic, within a tenth at a time."""
    length = backtrack(line(lambda x: (x - minimum) ** 2, -2 * minimum))
    assert length is not None and (length - minimum) ** 2 < minimum**2
    assert length == pytest.approx(minimum) or length <= 2 * minimum


def test_undefined_values_are_never_accepted() -> None:
    def value(x: float) -> float:
        return math.nan if x > 0.2 else -x

    tried: list[float] = []
    length = backtrack(line(lambda x: tried.append(x) or value(x), -1))
    assert length is not None and 0 < length <= 0.2
    assert backtrack(line(lambda x: math.inf if x else 0.0, -1)) is None
    # Halved, since an undefined value says nothing about where the minimum is.
    assert [tried[k + 1] / tried[k] for k in range(1, 3)] == [0.5, 0.5]


def test_there_is_no_way_up() -> None:
    assert backtrack(line(lambda x: x, -1)) is None
    assert backtrack(line(lambda x: x, -1), shortest=0.3) is None


def test_where_the_decrease_is_rounding_the_forces_decide() -> None:
    def flat(x: float) -> float:
        return 1.0 + (1e-14 if x else 0.0)

    for agrees, expected in ((True, 1.0), (False, None)):
        assert backtrack(line(flat, -1e-9, 1e-13, lambda x, told=agrees: told)) == expected
    assert backtrack(line(lambda x: 1.0 + (1e-14 if x else 0.0), -1e-20, 1e-13)) == 1.0
    # More than rounding is not forgiven.
    assert backtrack(line(lambda x: 1.0 + 1e-12 * x, -1e-20, 1e-13, lambda x: True), shortest=0.2) is None


@pytest.mark.parametrize(("minimum", "expected"), [(1.0, 1.0), (2.1, 2.0), (5.0, 4.0), (1e9, 32.0)])
def test_a_step_too_short_is_doubled_to_the_minimum(minimum: float, expected: float) -> None:
    assert extend(line(lambda x: (x - minimum) ** 2, -2 * minimum), 1.0, 32.0) == expected


def test_undefined_values_end_the_doubling() -> None:
    assert extend(line(lambda x: math.nan if x > 3 else -x, -1), 1.0, 32.0) == 2.0


def test_off_a_maximum() -> None:
    """Curved downwards from zero on, up again later."""
    length = lowering(lambda x: -(x**2) + x**4, 8.0, 1e-6)
    assert length is not None and length == pytest.approx(math.sqrt(0.5), rel=0.5)
    assert lowering(lambda x: x**2, 1.0, 1e-6) is None
    assert lowering(lambda x: -1e-20, 1.0, 1e-6, rounding=1e-16) is None
