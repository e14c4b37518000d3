"""The energies that go by the name neo-Hookean, singular ones included."""

from ufl import ln

from elastune.forms.energy import Modulus, Parts, PositiveModulus, material
from elastune.forms.kinematics import PrincipalStretches

_VARIANTS = ("corrected", "printed")


@material(
    "neo-hookean",
    "Chen & Barbič, Table 1; Smith et al. 2018, Eq. 5",
    lame=lambda lam, mu: (lam, mu),
    inverts=False,
)
def neo_hookean(s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0) -> Parts:
    """ψ = μ/2 (I₁ - 3) - μ log J + λ/2 log²J."""
    return Parts(mu / 2 * (s.I1 - 3) - mu * ln(s.J), lam, ln(s.J) ** 2 / 2)


@material(
    "neo-hookean-ogden",
    "Chen & Barbič, Table 1; Smith et al. 2018, Ψ_A",
    lame=lambda lam, mu: (lam, mu),
    inverts=False,
)
def neo_hookean_ogden(s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0) -> Parts:
    """ψ = μ/2 (I₁ - 3) - μ log J + λ/2 (J - 1)²."""
    return Parts(mu / 2 * (s.I1 - 3) - mu * ln(s.J), lam, (s.J - 1) ** 2 / 2)


@material("sts", "Chen & Barbič, Table 1", lame=lambda lam, mu, mu4: (lam, mu), inverts=False)
def sts(s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0, mu4: Modulus = 0.1) -> Parts:
    """ψ = μ/2 (I₁ - 3) - μ log J + λ/2 log²J + μ₄/8 Σ(λᵢ² - 1)⁴."""
    base = neo_hookean(s, lam, mu)
    stiffening = sum((x**2 - 1) ** 4 for x in s.stretches) / 8
    return Parts(base.shear + mu4 * stiffening, base.bulk, base.volume)


@material(
    "neo-hookean-bower",
    "Smith et al. 2018, Ψ_B",
    lame=lambda lam, mu: (lam - 2 * mu / 3, mu),
    inverts=False,
)
def neo_hookean_bower(s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0) -> Parts:
    """ψ = μ/2 (J^(-2/3) I₁ - 3) + λ/2 (J - 1)².

    λ is the bulk modulus.
    """
    return Parts(mu / 2 * (s.J ** (-2 / 3) * s.I1 - 3), lam, (s.J - 1) ** 2 / 2)


@material(
    "wang-yang",
    "Smith et al. 2018, Ψ_C",
    lame=lambda lam, mu: (lam - 2 * mu / 3, mu),
    inverts=False,
    variant=_VARIANTS,
)
def wang_yang(
    s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0, *, variant: str = "corrected"
) -> Parts:
    """ψ = μ/2 (J^(-2/3) I₁ - 3) + λ/2 (J - 1)².

    λ is the bulk modulus.
    Printed without the square, and then stressed at rest by λ/2.
    """
    shear = mu / 2 * (s.J ** (-2 / 3) * s.I1 - 3)
    if variant == "printed":
        return Parts(shear + lam / 2 * (s.J - 1))
    return Parts(shear, lam, (s.J - 1) ** 2 / 2)


@material(
    "rivlin-penalty",
    "Smith et al. 2018, Eqs. 8 and 11",
    lame=lambda lam, mu: (lam - mu, mu),
    inverts=True,
    variant=_VARIANTS,
)
def rivlin_penalty(
    s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0, *, variant: str = "corrected"
) -> Parts:
    """ψ = μ/2 (I₁ - 3) + λ/2 (J - α)² - μ²/(2λ),  α = 1 + μ/λ.

    Printed with α = 1 (Ψ_D), and then stressed at rest by μ; the root shifted to α relieves it.
    """
    # Expanded: λ/2 (J - α)² - μ²/(2λ) = λ/2 (J - 1)² - μ (J - 1), free of the division by λ.
    shift = 0 if variant == "printed" else mu * (s.J - 1)
    return Parts(mu / 2 * (s.I1 - 3) - shift, lam, (s.J - 1) ** 2 / 2)
