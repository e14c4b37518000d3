"""Energies fitted to rubber, made compressible."""

from ufl import ln

from elastune.forms.energy import Exponent, Modulus, Parts, PositiveModulus, material
from elastune.forms.kinematics import PrincipalStretches

_TABLE = "Chen & Barbič, Table 1"
_VARIANTS = ("corrected", "printed")


@material(
    "ogden",
    _TABLE,
    lame=lambda mu, alpha: (0, sum(m * a for m, a in zip(mu, alpha, strict=True)) / 2),
    inverts=False,
    variant=_VARIANTS,
)
def ogden(
    s: PrincipalStretches,
    mu: Modulus = (0.63, 0.0012, -0.01),
    alpha: Exponent = (1.3, 5.0, -2.0),
    *,
    variant: str = "corrected",
) -> Parts:
    """ψ = Σₚ μₚ/αₚ (Σλᵢ^αₚ - 3) - (Σₚ μₚ) log J.

    Printed without the logarithm, and then stressed at rest by Σμₚ. Any number of terms.
    """
    terms = sum(m / a * (sum(x**a for x in s.stretches) - 3) for m, a in zip(mu, alpha, strict=True))
    return Parts(terms if variant == "printed" else terms - sum(mu) * ln(s.J))


@material(
    "mooney-rivlin",
    _TABLE,
    lame=lambda C1, C2, K: (K - 4 / 3 * (C1 + C2), 2 * (C1 + C2)),
    pair=("K", "C1"),
    inverts=False,
    variant=_VARIANTS,
)
def mooney_rivlin(
    s: PrincipalStretches,
    C1: Modulus = 0.4,
    C2: Modulus = 0.1,
    K: PositiveModulus = 2.0,
    *,
    variant: str = "corrected",
) -> Parts:
    """ψ = C₁(J^(-2/3) I₁ - 3) + C₂(J^(-4/3) I₂ - 3) + K/2 (J - 1)².

    Printed with the constants inside the powers of J and without K, and then stressed at rest.
    """
    if variant == "printed":
        return Parts(C1 * s.J ** (-2 / 3) * (s.I1 - 3) + C2 * s.J ** (-4 / 3) * (s.I2 - 3))
    shear = C1 * (s.J ** (-2 / 3) * s.I1 - 3) + C2 * (s.J ** (-4 / 3) * s.I2 - 3)
    return Parts(shear, K, (s.J - 1) ** 2 / 2)
