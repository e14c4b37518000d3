"""Strain energies quadratic in a generalised strain: the Seth-Hill family and its kin."""

from ufl import conditional, ln, lt

from elastune.forms.energy import Exponent, Modulus, Parts, PositiveModulus, material
from elastune.forms.kinematics import PrincipalStretches
from elastune.forms.materials.functions import STRAINS

_TABLE = "Chen & Barbič, Table 1"


@material("linear-corotational", _TABLE, lame=lambda lam, mu: (lam, mu), inverts=True)
def linear_corotational(s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0) -> Parts:
    """ψ = μ Σ(λᵢ - 1)² + λ/2 (Σλᵢ - 3)²."""
    strains = [x - 1 for x in s.stretches]
    return Parts(mu * sum(e**2 for e in strains), lam, sum(strains) ** 2 / 2)


@material("st-venant-kirchhoff", _TABLE, lame=lambda lam, mu: (lam, mu), inverts=True)
def st_venant_kirchhoff(s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0) -> Parts:
    """ψ = μ/4 Σ(λᵢ² - 1)² + λ/8 (Σλᵢ² - 3)²."""
    squared = s.I1**2 - 2 * s.I2 - 2 * s.I1 + 3
    return Parts(mu / 4 * squared, lam, (s.I1 - 3) ** 2 / 8)


@material("hencky", _TABLE, lame=lambda lam, mu: (lam, mu), inverts=False)
def hencky(s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0) -> Parts:
    """ψ = μ Σ log²λᵢ + λ/2 log²J."""
    return Parts(mu * sum(ln(x) ** 2 for x in s.stretches), lam, ln(s.J) ** 2 / 2)


@material("seth-hill", _TABLE, lame=lambda lam, mu, alpha: (lam, mu), inverts=False)
def seth_hill(s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0, alpha: Exponent = 0.5) -> Parts:
    """ψ = μ/α² Σ(λᵢ^α - 1)² + λ/(2α²) (Σλᵢ^α - 3)².

    α = 1 is linear-corotational, 2 st-venant-kirchhoff, and hencky the limit α → 0.
    """
    strains = [(x**alpha - 1) / alpha for x in s.stretches]
    return Parts(mu * sum(e**2 for e in strains), lam, sum(strains) ** 2 / 2)


@material("symmetric-seth-hill", _TABLE, lame=lambda lam, mu, alpha: (lam, mu), inverts=False)
def symmetric_seth_hill(
    s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0, alpha: Exponent = 1.0
) -> Parts:
    """ψ = μ/(4α²) Σ(λᵢ^α - λᵢ^-α)² + λ/(8α²) (Σ(λᵢ^α - λᵢ^-α))²."""
    strains = [(x**alpha - x**-alpha) / (2 * alpha) for x in s.stretches]
    return Parts(mu * sum(e**2 for e in strains), lam, sum(strains) ** 2 / 2)


@material("hill", _TABLE, lame=lambda lam, mu: (lam, mu), inverts=False, f=STRAINS)
def hill(s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0, *, f: str = "log") -> Parts:
    """ψ = μ Σf(λᵢ)² + λ/2 (Σf(λᵢ))²,  f(1) = 0, f'(1) = 1."""
    strains = [STRAINS[f](x) for x in s.stretches]
    return Parts(mu * sum(e**2 for e in strains), lam, sum(strains) ** 2 / 2)


@material(
    "st-venant-kirchhoff-kikuuwe",
    "Smith et al. 2018, Eq. 51",
    lame=lambda lam, mu, kappa: (lam, mu),
    inverts=True,
)
def st_venant_kirchhoff_kikuuwe(
    s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0, kappa: Modulus = 100.0
) -> Parts:
    """ψ = μ E:E + λ/2 tr²E + κ/12 ((1 - J)/6)³ where J < 1,  E = (C - I)/2."""
    base = st_venant_kirchhoff(s, lam, mu)
    compression = conditional(lt(s.J, 1), ((1 - s.J) / 6) ** 3 / 12, 0)
    return Parts(base.shear + kappa * compression, base.bulk, base.volume)
