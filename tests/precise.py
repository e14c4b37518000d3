"""Isotropic energies at 50 digits: the reference that double-precision kernels are held against.

UFL supplies the expressions of ψ and of its derivatives in the stretches; every number in them is then computed by
mpmath. Nothing here is shared with the kernel: no generated code, no quadrature, no switch to a limit before the
gap between two stretches is far below what 50 digits resolve.
"""

from fractions import Fraction
from functools import cache
from typing import Any

import basix.ufl
import mpmath
import numpy as np
import ufl
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives

from elastune.forms.energy import Energy
from elastune.forms.kinematics import PrincipalStretches

mp = mpmath.mp.clone()
mp.dps = 60

# Two stretches closer than this share their directions' limit, which is then exact to its square.
_EQUAL = mp.mpf(10) ** -24


def value(expression: Any, numbers: dict[Any, Any], known: dict[int, Any] | None = None) -> Any:
    """A scalar UFL expression in mpmath.

    Args:
        expression: Sums, products, powers, functions and conditionals of numbers and entries of constants.
        numbers: Values of the entries, by (count of the constant, position).
        known: Values of the subexpressions met so far, by identity.

    Raises:
        TypeError: If the expression holds something else.
    """
    known = {} if known is None else known
    if id(expression) not in known:
        known[id(expression)] = _value(expression, numbers, known)
    return known[id(expression)]


def _value(e: Any, numbers: dict[Any, Any], known: dict[int, Any]) -> Any:
    kind = type(e).__name__
    if kind in ("FloatValue", "RealValue", "IntValue", "ScalarValue"):
        return _literal(e._value)
    if kind == "Zero":
        return mp.mpf(0)
    if kind == "Indexed":
        vector, index = e.ufl_operands
        return numbers[vector.count(), int(index[0])]
    if kind == "Variable":
        return value(e.ufl_operands[0], numbers, known)
    if kind == "Conditional":
        condition, yes, no = e.ufl_operands
        a, b = (value(operand, numbers, known) for operand in condition.ufl_operands)
        holds = {"LT": a < b, "GT": a > b, "LE": a <= b, "GE": a >= b}[type(condition).__name__]
        return value(yes if holds else no, numbers, known)
    operands = [value(operand, numbers, known) for operand in e.ufl_operands]
    functions = {
        "Sum": lambda a, b: a + b,
        "Product": lambda a, b: a * b,
        "Division": lambda a, b: a / b,
        "Power": _power,
        "Ln": mp.log,
        "Exp": mp.exp,
        "Sqrt": mp.sqrt,
        "Abs": abs,
    }
    if kind not in functions:
        raise TypeError(f"precise: no rule for {kind}")
    return functions[kind](*operands)


def _literal(number: float) -> Any:
    """A number in a formula: -2/3, which no double is, is meant exactly."""
    near = Fraction(number).limit_denominator(12)
    return mp.mpf(near.numerator) / near.denominator if abs(near - Fraction(number)) < 1e-15 else mp.mpf(number)


def _power(base: Any, exponent: Any) -> Any:
    return base ** int(exponent) if exponent == int(exponent) else mp.power(base, exponent)


@cache
def _expressions(energy: Any) -> tuple[Any, list[Any], dict[tuple[int, int], Any]]:
    domain = ufl.Mesh(basix.ufl.element("Lagrange", "interval", 1, shape=(1,)))
    count = len(energy.constants())
    stretches = ufl.Constant(domain, shape=(3,), count=0)
    constants = ufl.Constant(domain, shape=(count,), count=1)
    s = [ufl.variable(stretches[i]) for i in range(3)]
    psi = ufl.as_ufl(energy.density(PrincipalStretches(s), energy.unpack([constants[i] for i in range(count)])))
    first = [ufl.diff(psi, x) for x in s]
    second = {(i, j): ufl.diff(first[i], s[j]) for i in range(3) for j in range(i, 3)}

    def ready(expression: Any) -> Any:
        return apply_derivatives(apply_algebra_lowering(expression))

    return ready(psi), [ready(e) for e in first], {key: ready(e) for key, e in second.items()}


class _Shared:
    """Energies hold a dictionary and cannot be hashed: the cache above takes them by identity."""

    def __init__(self, energy: Energy) -> None:
        self.energy = energy

    def __hash__(self) -> int:
        return id(self.energy)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Shared) and other.energy is self.energy

    def __getattr__(self, name: str) -> Any:
        return getattr(self.energy, name)


def in_stretches(energy: Energy, stretches: list[Any]) -> tuple[Any, list[Any], list[list[Any]]]:
    """ψ, p_i = ∂ψ/∂s_i and ψ_ij at three stretches."""
    psi, first, second = _expressions(_Shared(energy))
    numbers = {(0, i): s for i, s in enumerate(stretches)}
    numbers |= {(1, i): mp.mpf(c) for i, c in enumerate(energy.constants())}
    known: dict[int, Any] = {}
    h = [[value(second[min(i, j), max(i, j)], numbers, known) for j in range(3)] for i in range(3)]
    return value(psi, numbers, known), [value(e, numbers, known) for e in first], h


def signed_svd(F: Any) -> tuple[Any, list[Any], Any]:
    """U, s, V of F = U diag(s) Vᵀ with rotations U and V, the sign on the smallest stretch."""
    U, s, Vt = mp.svd_r(F)
    s = [s[i] for i in range(3)]
    for matrix, column in ((U, True), (Vt, False)):
        if mp.det(matrix) < 0:
            for i in range(3):
                if column:
                    matrix[i, 2] = -matrix[i, 2]
                else:
                    matrix[2, i] = -matrix[2, i]
            s[2] = -s[2]
    return U, s, Vt.T


def response(energy: Energy, H: np.ndarray) -> tuple[Any, np.ndarray, np.ndarray]:
    """ψ, P and ∂P/∂F at F = I + H, where H is taken as exact.

    Returns:
        ψ, P of shape (3, 3), ∂P/∂F of shape (9, 9), all of mpmath numbers.
    """
    E = mp.matrix([[mp.mpf(float(H[i, j])) for j in range(3)] for i in range(3)])
    if energy.objective:
        U, s, V = signed_svd(mp.eye(3) + E)
    else:
        e, V = mp.eigsy((E + E.T) / 2)
        U, s = V, [1 + e[i] for i in range(3)]
    psi, p, h = in_stretches(energy, s)
    modes = np.array([[[U[x // 3, m] * V[x % 3, n] for x in range(9)] for n in range(3)] for m in range(3)])
    P = sum(p[n] * modes[n, n] for n in range(3)).reshape(3, 3)
    D = sum(h[m][n] * np.outer(modes[m, m], modes[n, n]) for m in range(3) for n in range(3))
    for i, j in ((0, 1), (0, 2), (1, 2)):
        plus, minus = modes[i, j] + modes[j, i], modes[i, j] - modes[j, i]
        D = D + _difference(p, h, s, i, j, 1) / 2 * np.outer(plus, plus)
        if energy.objective:
            D = D + _difference(p, h, s, i, j, -1) / 2 * np.outer(minus, minus)
    return psi, P, D


def _difference(p: list[Any], h: list[list[Any]], s: list[Any], i: int, j: int, sign: int) -> Any:
    """(p_i - sign p_j)/(s_i - sign s_j), or its limit."""
    gap = s[i] - sign * s[j]
    if abs(gap) <= _EQUAL * (1 + abs(s[i])):
        return (h[i][i] + h[j][j]) / 2 - sign * h[i][j]
    return (p[i] - sign * p[j]) / gap


def distance(found: np.ndarray, exact: np.ndarray) -> float:
    """‖found - exact‖, Frobenius, subtracted before anything is rounded."""
    pairs = zip(np.ravel(found), np.ravel(exact), strict=True)
    return float(mp.sqrt(sum((mp.mpf(float(a)) - b) ** 2 for a, b in pairs)))


def norm(exact: np.ndarray) -> float:
    """‖exact‖, Frobenius."""
    return float(mp.sqrt(sum(b**2 for b in np.ravel(exact))))


def relative_error(found: np.ndarray, exact: np.ndarray) -> float:
    """‖found - exact‖ / ‖exact‖, or ‖found‖ where the exact value is zero."""
    return distance(found, exact) / (norm(exact) or 1.0)
