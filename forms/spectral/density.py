"""Energies as C: ψ and its derivatives in the stretches, differentiated by UFL and written by FFCx."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import islice, product
from typing import Any

import basix.ufl
import numpy as np
import ufl
from ufl.corealg.map_dag import map_expr_dag
from ufl.corealg.multifunction import MultiFunction

from elastune.forms.energy import Energy
from elastune.forms.kinematics import PrincipalStretches, Scalar
from elastune.forms.normalize import evaluate
from elastune.forms.spectral.compat import expression_code


@cache
def _domain() -> ufl.Mesh:
    """Constants need a domain; nothing is evaluated on it."""
    return ufl.Mesh(basix.ufl.element("Lagrange", "interval", 1, shape=(1,)), ufl_id=0)


@dataclass(frozen=True)
class _Arguments:
    """Entries of the array that the generated function reads, in its order; see kernel/density.h."""

    stretches: list[Scalar]
    excess: list[Scalar]
    deciding: list[Scalar]
    constants: list[Scalar]


def _arguments(energy: Energy, extended: bool) -> _Arguments:
    sizes = [3, 3 if extended else 0, 3, len(energy.constants())]
    # One vector, because FFCx leaves out constants that do not occur.
    vector = ufl.Constant(_domain(), shape=(sum(sizes),), count=0)
    entries = iter(vector[i] for i in range(sum(sizes)))
    return _Arguments(*(list(islice(entries, n)) for n in sizes))


def _density(energy: Energy, stretches: Sequence[Scalar], constants: Sequence[Scalar]) -> Scalar:
    return ufl.as_ufl(energy.density(PrincipalStretches(stretches), energy.unpack(constants)))


class _Decide(MultiFunction):
    """Conditions take the deciding stretches in place of the others."""

    def __init__(self, mapping: dict[Any, Any]) -> None:
        super().__init__()
        self.mapping = mapping

    expr = MultiFunction.reuse_if_untouched

    def conditional(self, o: Any, condition: Any, yes: Any, no: Any) -> Any:
        """The same with other stretches in the condition."""
        return ufl.conditional(ufl.replace(condition, self.mapping), yes, no)


def signature(energy: Energy, extended: bool) -> str:
    """Everything the generated code depends on, without differentiating anything."""
    arguments = _arguments(energy, extended)
    flags = (energy.inverts, energy.objective, is_even(energy), extended)
    return f"{_density(energy, arguments.stretches, arguments.constants)!r} {flags}"


def is_even(energy: Energy) -> bool:
    """Whether ψ is unchanged when two stretches change their sign, as a function of C and J is."""
    a, b, c = 1.3, 0.7, 1.1
    value = evaluate(energy.density(PrincipalStretches((a, b, c))))
    for stretches in ((-a, -b, c), (-a, b, -c), (a, -b, -c)):
        try:
            flipped = evaluate(energy.density(PrincipalStretches(stretches)))
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
            if any(isinstance(factor, int) and factor == 0 for factor in factors):
                continue
            terms.append(derivative * factors[0] * factors[1] * factors[2])
        result.append(sum(terms))
    return result


def code(energy: Energy, extended: bool) -> str:
    """C definition of `generated(A, c)` and the macros that describe it; see kernel/density.h."""
    arguments = _arguments(energy, extended)
    variables = [ufl.variable(s) for s in arguments.stretches]
    psi = _density(energy, variables, arguments.constants)
    psi = map_expr_dag(_Decide(dict(zip(variables, arguments.deciding, strict=True))), psi)
    values = _extended_derivatives(psi, variables, arguments.excess) if extended else _derivatives(psi, variables)
    body = _body(expression_code(ufl.as_vector(values), np.zeros((1, 1))))
    smooth = energy.inverts and not extended
    macros: dict[str, Any] = {
        "CONSTANTS": len(arguments.constants),
        "FILTER": len(arguments.constants),
        "THRESHOLD": len(arguments.constants) + 1,
        "EXTENDED": int(extended),
        "OBJECTIVE": int(energy.objective),
        "POSITIVE": int(not energy.inverts and not extended),
        "EVEN": int(is_even(energy) and not extended),
        # Only a call keeps the loop over lanes from being vectorised; whole powers are multiplied out.
        "DENSITY_CALLS": int(bool(re.search(r"\b(log|exp)\(|\bpow\([^()]*, (?!-?\d+\))", body))),
        # Stretches over whose size the second derivatives vary: see tangent.h.
        "SMALLEST_SCALE": "(2 * c[THRESHOLD])" if extended else 2 if smooth else 0,
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
