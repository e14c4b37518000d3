"""Separable energies: sums of functions of single stretches, areas and the volume ratio."""

from ufl import ln

from elastune.forms.energy import Modulus, Parts, PositiveModulus, material
from elastune.forms.kinematics import PrincipalStretches, Scalar
from elastune.forms.materials.functions import ENERGIES

_TABLE = "Chen & Barbič, Table 1"
_VARIANTS = ("corrected", "printed")


@material("valanis-landel", _TABLE, lame=lambda lam, mu: (lam, mu), inverts=False, variant=_VARIANTS)
def valanis_landel(
    s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0, *, variant: str = "corrected"
) -> Parts:
    """ψ = 2μ Σ(λᵢ(log λᵢ - 1) + 1) + λ/2 log²J.

    Printed without the + 1, which only moves ψ at rest to -6μ.
    """
    constant = 0 if variant == "printed" else 1
    return Parts(2 * mu * sum(x * (ln(x) - 1) + constant for x in s.stretches), lam, ln(s.J) ** 2 / 2)


@material("valanis-landel-separable", _TABLE, lame=lambda lam, mu: (lam, mu), inverts=False, f=ENERGIES, h=ENERGIES)
def valanis_landel_separable(
    s: PrincipalStretches,
    lam: Modulus = 1.0,
    mu: PositiveModulus = 1.0,
    *,
    f: str = "quadratic",
    h: str = "quadratic",
) -> Parts:
    """ψ = 2μ Σf(λᵢ) + λ h(J),  f and h zero with zero slope and unit curvature at 1."""
    return Parts(2 * mu * sum(ENERGIES[f](x) for x in s.stretches), lam, ENERGIES[h](s.J))


@material(
    "valanis-landel-xu",
    _TABLE,
    lame=lambda lam, mu, area: (lam + area, mu + area / 2),
    inverts=False,
    f=ENERGIES,
    g=ENERGIES,
    h=ENERGIES,
    variant=_VARIANTS,
)
def valanis_landel_xu(
    s: PrincipalStretches,
    lam: Modulus = 1.0,
    mu: PositiveModulus = 1.0,
    area: Modulus = 0.5,
    *,
    f: str = "quadratic",
    g: str = "quadratic",
    h: str = "quadratic",
    variant: str = "corrected",
) -> Parts:
    """ψ = 2μ Σf(λᵢ) + a Σ_{i<j} g(λᵢλⱼ) + λ h(J),  f, g and h zero with zero slope and unit curvature at 1.

    Printed as a sum over all nine pairs, with which the printed Lamé pair does not agree.
    """
    areas = [x * y for x in s.stretches for y in s.stretches] if variant == "printed" else s.areas
    lengths = 2 * mu * sum(ENERGIES[f](x) for x in s.stretches)
    return Parts(lengths + area * sum(ENERGIES[g](x) for x in areas), lam, ENERGIES[h](s.J))


@material("peng-landel", _TABLE, lame=lambda E: (0, E / 3), inverts=False)
def peng_landel(s: PrincipalStretches, E: PositiveModulus = 1.0) -> Parts:
    """ψ = E Σ(λᵢ - 1 - log λᵢ - 1/6 log²λᵢ + 1/18 log³λᵢ - 1/216 log⁴λᵢ).

    E is Young's modulus of the incompressible solid; with λ = 0 the modulus is 2E/3.
    """

    def term(x: Scalar) -> Scalar:
        log = ln(x)
        return x - 1 - log - log**2 / 6 + log**3 / 18 - log**4 / 216

    return Parts(E * sum(term(x) for x in s.stretches))
