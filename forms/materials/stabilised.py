"""Energies without singularities, which survive inversion (Smith, de Goes & Kim 2018).

The published forms λ/2 (J - α)² are expanded about J = 1 without their constant, so that ψ(1) = 0 and no
parameter is divided by λ.
"""

from ufl import exp, ln

from elastune.forms.energy import Modulus, Number, Parts, PositiveModulus, material
from elastune.forms.kinematics import PrincipalStretches

_VARIANTS = ("corrected", "printed")


@material(
    "stable-neo-hookean",
    "Smith et al. 2018, Eq. 13",
    lame=lambda lam, mu: (lam - mu, mu),
    inverts=True,
)
def stable_neo_hookean(s: PrincipalStretches, lam: Modulus = 2.0, mu: PositiveModulus = 1.0) -> Parts:
    """ψ = μ/2 (I₁ - 3) - μ (J - 1) + λ/2 (J - 1)²."""
    return Parts(mu / 2 * (s.I1 - 3) - mu * (s.J - 1), lam, (s.J - 1) ** 2 / 2)


@material(
    "stable-neo-hookean-barrier",
    "Smith et al. 2018, Eq. 14",
    lame=lambda lam, mu: (lam - 5 * mu / 8, 3 * mu / 4),
    inverts=True,
    variant=_VARIANTS,
)
def stable_neo_hookean_barrier(
    s: PrincipalStretches, lam: Modulus = 2.0, mu: PositiveModulus = 1.0, *, variant: str = "corrected"
) -> Parts:
    """ψ = μ/2 (I₁ - 3) + λ/2 (J - α)² - μ/2 log(I₁ + 1),  α = 1 + 3μ/(4λ), less its value at rest.

    Printed with α = 1 + μ/λ - (μ/4)λ, and then stressed at rest.
    """
    pull = mu - lam**2 * mu / 4 if variant == "printed" else 3 * mu / 4
    return Parts(mu / 2 * (s.I1 - 3 - ln((s.I1 + 1) / 4)) - pull * (s.J - 1), lam, (s.J - 1) ** 2 / 2)


@material(
    "fung",
    "Smith et al. 2018, Eq. 53",
    lame=lambda lam, mu0, gamma, mu1: (lam - mu0 - gamma * mu1 + 2 * gamma * mu1**2, mu0 + gamma * mu1),
    pair=("lam", "mu0"),
    inverts=True,
    variant=_VARIANTS,
)
def fung(
    s: PrincipalStretches,
    lam: Modulus = 2.0,
    mu0: PositiveModulus = 1.0,
    gamma: Modulus = 0.25,
    mu1: Number = 0.5,
    *,
    variant: str = "corrected",
) -> Parts:
    """ψ = μ₀/2 (I₁ - 3) + λ/2 (J - α)² + γ/2 (exp(μ₁(I₁ - 3)) - 1),  less its value at rest.

    α = 1 + (μ₀ + γμ₁)/λ keeps it at rest.
    Printed with the exponent μ₁/2 (I₁ - 3), and then stressed at rest: its own Eqs. 54-56 need μ₁.
    """
    rate = mu1 / 2 if variant == "printed" else mu1
    shear = mu0 / 2 * (s.I1 - 3) + gamma / 2 * (exp(rate * (s.I1 - 3)) - 1)
    return Parts(shear - (mu0 + gamma * mu1) * (s.J - 1), lam, (s.J - 1) ** 2 / 2)


@material(
    "arruda-boyce",
    "Smith et al. 2018, Eq. 58",
    lame=lambda lam, mu, beta1, beta2: (
        lam - mu - mu * beta1 + 3 * mu * beta2,
        mu * (1 + 3 * beta1 + 9 * beta2),
    ),
    inverts=True,
)
def arruda_boyce(
    s: PrincipalStretches,
    lam: Modulus = 2.0,
    mu: PositiveModulus = 1.0,
    beta1: Number = 0.05,
    beta2: Number = 0.01,
) -> Parts:
    """ψ = μ/2 (I₁ - 3) + μβ₁/4 (I₁² - 9) + μβ₂/6 (I₁³ - 27) + λ/2 (J - α)²,  less its value at rest.

    α = 1 + μ(1 + 3β₁ + 9β₂)/λ keeps it at rest.
    """
    chain = (s.I1 - 3) / 2 + beta1 / 4 * (s.I1**2 - 9) + beta2 / 6 * (s.I1**3 - 27)
    return Parts(mu * (chain - (1 + 3 * beta1 + 9 * beta2) * (s.J - 1)), lam, (s.J - 1) ** 2 / 2)


@material("fixed-corotational", "Smith et al. 2018, Eq. 49", lame=lambda lam, mu: (lam, mu), inverts=True)
def fixed_corotational(s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0) -> Parts:
    """ψ = μ Σ(λᵢ - 1)² + λ/2 (J - 1)²."""
    return Parts(mu * sum((x - 1) ** 2 for x in s.stretches), lam, (s.J - 1) ** 2 / 2)
