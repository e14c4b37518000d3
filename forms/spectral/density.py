"""Energies as C: ψ and its derivatives in the stretches, differentiated by UFL and written by FFCx."""

import re
from collections.abc import Sequence
from functools import cache
from itertools import product
from typing import Any

import basix.ufl
import numpy as np
import ufl
from ufl.classes import Conditional
from ufl.corealg.traversal import unique_pre_traversal

from forms.energy import Energy
from forms.kinematics import PrincipalStretches, Scalar
from forms.normalize import evaluate
from forms.spectral.compat import expression_code


@cache
def _domain() -> ufl.Mesh:
    """Constants need a domain; nothing is evaluated on it."""
    return ufl.Mesh(basix.ufl.element("Lagrange", "interval", 1, shape=(1,)), ufl_id=0)


def _arguments(energy: Energy, extended: bool) -> tuple[list[Scalar], list[Scalar], list[Scalar]]:
    """Stretches, excess below the threshold, and material constants, in the order of the kernel's array."""
    groups = [3] * (2 if extended else 1) + [len(energy.constants())]
    vectors = [ufl.Constant(_domain(), shape=(n,), count=i) for i, n in enumerate(groups)]
    entries = [[vector[i] for i in range(n)] for vector, n in zip(vectors, groups, strict=True)]
    return entries[0], entries[1] if extended else [], entries[-1]


def _density(energy: Energy, stretches: Sequence[Scalar], constants: Sequence[Scalar]) -> Scalar:
    return ufl.as_ufl(energy.density(PrincipalStretches(stretches), energy.unpack(constants)))


def signature(energy: Energy, extended: bool) -> str:
    """Everything the generated code depends on, without differentiating anything."""
    stretches, _, constants = _arguments(energy, extended)
    flags = (energy.inverts, energy.objective, is_even(energy), extended)
    return f"{_density(energy, stretches, constants)!r} {flags}"


def is_even(energy: Energy) -> bool:
    """Whether ψ is unchanged when two stretches change their sign, as a function of C and J is."""
    stretches = np.array([1.3, 0.7, 1.1])
    value = evaluate(energy.density(PrincipalStretches(stretches.tolist())))
    for signs in ((-1, -1, 1), (-1, 1, -1), (1, -1, -1)):
        try:
            flipped = evaluate(energy.density(PrincipalStretches((stretches * signs).tolist())))
        except (ValueError, TypeError, ArithmeticError):
            # A logarithm or a power of a negative number.
            return False
        if not abs(flipped - value) <= 1e-12 * (1 + abs(value)):
            return False
    return True


def _derivatives(psi: Scalar, variables: Sequence[Scalar]) -> list[Scalar]:
    """ψ, three first and six second derivatives, in the kernel's order."""
    first = [ufl.diff(psi, s) for s in variables]
    second = [ufl.diff(first[i], variables[j]) for i in range(3) for j in range(i, 3)]
    return [psi, *first, *second]


def _extended_derivatives(psi: Scalar, variables: Sequence[Scalar], excess: Sequence[Scalar]) -> list[Scalar]:
    """The same of ψ continued below the threshold, in each stretch by its second-order Taylor polynomial.

    One polynomial of second order in all stretches together would jump in its first derivatives where a second
    stretch crosses the threshold; the product of three does not, and is C² everywhere. It is

        Σ ∂^k ψ(ŝ) Π d_i^(k_i)/k_i!,  k_i = 0, 1, 2,  ŝ = max(s, σ_f),  d = s - ŝ.

    In a stretch above the threshold d = 0, and the same sum with the derivatives of the powers of d gives the
    derivatives of ψ: no case distinction is left.
    """
    partial = {(0, 0, 0): psi}
    for k in product(range(3), repeat=3):
        for i in range(3):
            if k[i] > 0 and k not in partial:
                below = tuple(n - (j == i) for j, n in enumerate(k))
                partial[k] = ufl.diff(partial[below], variables[i])  # type: ignore[index]
    powers = [[[1, d, d**2 / 2], [0, 1, d], [0, 0, 1]] for d in excess]
    orders = [(0, 0, 0)]
    orders += [tuple(int(n == i) for n in range(3)) for i in range(3)]  # type: ignore[misc]
    orders += [tuple((n == i) + (n == j) for n in range(3)) for i in range(3) for j in range(i, 3)]  # type: ignore[misc]
    result = []
    for order in orders:
        terms: list[Scalar] = []
        for k, derivative in partial.items():
            factors = [powers[i][order[i]][k[i]] for i in range(3)]
            if all(isinstance(factor, int) and factor == 0 for factor in factors) or 0 in [
                factor for factor in factors if isinstance(factor, int)
            ]:
                continue
            terms.append(derivative * factors[0] * factors[1] * factors[2])
        result.append(sum(terms))
    return result


def code(energy: Energy, extended: bool) -> str:
    """C definition of `generated(A, c)` and the macros that describe it; see kernel/density.h."""
    stretches, excess, constants = _arguments(energy, extended)
    variables = [ufl.variable(s) for s in stretches]
    psi = _density(energy, variables, constants)
    values = _extended_derivatives(psi, variables, excess) if extended else _derivatives(psi, variables)
    body = _body(expression_code(ufl.as_vector(values), np.zeros((1, 1))))
    smooth = energy.inverts and not extended
    kinked = any(isinstance(node, Conditional) for node in unique_pre_traversal(psi))
    macros: dict[str, Any] = {
        "CONSTANTS": len(constants),
        "FILTER": len(constants),
        "THRESHOLD": len(constants) + 1,
        "EXTENDED": int(extended),
        "OBJECTIVE": int(energy.objective),
        "EVEN": int(is_even(energy) and not extended),
        # Only a call keeps the loop over lanes from being vectorised; whole powers are multiplied out.
        "DENSITY_CALLS": int(bool(re.search(r"\b(log|exp)\(|\bpow\([^()]*, (?!-?\d+\))", body))),
        # Stretches over whose size the second derivatives vary: see tangent.h.
        "SMALLEST_SCALE": "(2 * c[THRESHOLD])" if extended else 2 if smooth else 0,
        # A kink in the second derivatives spoils high-order rules across it: closer limits.
        "EQUAL_GAP": 1e-13 if extended else 5e-8,
        "SMALL_GAP": 1e-4 if kinked else 1e-2,
        "REST_LIMIT": 1e-3 if kinked else 4e-2,
    }
    defines = "\n".join(f"#define {name} {value}" for name, value in macros.items())
    return (
        f'{defines}\n#include <stdbool.h>\n#include "power.h"\n'
        f"static inline void generated(double *restrict A, const double *restrict c)\n{body}\n"
    )


def _body(source: str) -> str:
    """The body of the only function in FFCx's source."""
    start = source.index("{", source.index("void tabulate_tensor_expression"))
    depth = 0
    for match in re.compile(r"[{}]").finditer(source, start):
        depth += 1 if match.group() == "{" else -1
        if depth == 0:
            return source[start : match.end()]
    raise ValueError("FFCx's source: expected a function")
