"""Scalar functions of one stretch (or area, or volume ratio) that materials choose by name."""

from collections.abc import Callable

from ufl import exp, ln

from elastune.forms.kinematics import Scalar

# Strain measures: f(1) = 0 and f'(1) = 1, the conditions under which the Hill family has the pair (λ, μ).
STRAINS: dict[str, Callable[[Scalar], Scalar]] = {
    "log": ln,
    "biot": lambda x: x - 1,
    "green": lambda x: (x**2 - 1) / 2,
    "almansi": lambda x: (1 - x**-2) / 2,
    "bazant": lambda x: (x - 1 / x) / 2,
}

# Energies of one stretch: f(1) = f'(1) = 0 and f''(1) = 1, so that no choice is stressed at rest.
ENERGIES: dict[str, Callable[[Scalar], Scalar]] = {
    "quadratic": lambda x: (x - 1) ** 2 / 2,
    "log": lambda x: ln(x) ** 2 / 2,
    "green": lambda x: (x**2 - 1) ** 2 / 8,
    "neo": lambda x: (x**2 - 1 - 2 * ln(x)) / 4,
    "valanis": lambda x: x * ln(x) - x + 1,
    "exponential": lambda x: (exp((x - 1) ** 2) - 1) / 2,
}
