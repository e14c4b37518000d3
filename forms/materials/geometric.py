"""Energies of geometry processing; none has a λ part."""

from elastune.forms.energy import Parts, PositiveModulus, material
from elastune.forms.kinematics import PrincipalStretches

_TABLE = "Chen & Barbič, Table 1"
_VARIANTS = ("corrected", "printed")


@material("arap", _TABLE, lame=lambda scale: (0, scale), inverts=True)
def arap(s: PrincipalStretches, scale: PositiveModulus = 1.0) -> Parts:
    """ψ = c Σ(λᵢ - 1)²."""
    return Parts(scale * sum((x - 1) ** 2 for x in s.stretches))


@material("symmetric-arap", _TABLE, lame=lambda mu: (0, mu), inverts=False)
def symmetric_arap(s: PrincipalStretches, mu: PositiveModulus = 1.0) -> Parts:
    """ψ = μ/2 Σ((λᵢ - 1)² + (1 - 1/λᵢ)²)."""
    return Parts(mu / 2 * sum((x - 1) ** 2 + (1 - 1 / x) ** 2 for x in s.stretches))


@material("symmetric-dirichlet", _TABLE, lame=lambda scale: (0, 2 * scale), inverts=False, variant=_VARIANTS)
def symmetric_dirichlet(s: PrincipalStretches, scale: PositiveModulus = 1.0, *, variant: str = "corrected") -> Parts:
    """ψ = c/2 Σ(λᵢ - 1/λᵢ)².

    Printed as c/2 (|F|² + |F⁻¹|²), which only moves ψ at rest to 3c.
    """
    # Σ 1/λᵢ² = I₂/J²: no stretches needed.
    norms = s.I1 + s.I2 / s.J**2
    return Parts(scale / 2 * (norms if variant == "printed" else norms - 6))
