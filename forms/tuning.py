"""Energy -> energy: nonlinearity exponent, λ/μ mixing and volume augmentation (Chen & Barbič, Sections 5-6).

None of them changes the linearisation at rest. Exponents and coefficients are stored among the energy's values,
so that changing them recompiles nothing.
"""

from collections.abc import Callable
from dataclasses import replace

from forms.energy import Energy, MaterialError, Parts, Values
from forms.kinematics import PrincipalStretches, Scalar
from forms.normalize import linearize


def _check_exponent(alpha: float, name: str) -> None:
    if not 0 < alpha < float("inf"):
        raise MaterialError(f"{name}: must be a positive number, got {alpha!r}")


def _check_objective(energy: Energy) -> None:
    if not energy.objective:
        raise MaterialError(f"{energy.name}: not a function of stretches; expected alpha = 1 and no volume part")


def with_nonlinearity(energy: Energy, alpha: float) -> Energy:
    """ψ_α(λᵢ) = ψ(λᵢ^α) / α² (Chen & Barbič, Eq. 16); α = 1 returns the energy itself.

    Raises:
        MaterialError: If alpha is not positive, or the energy no function of stretches.
    """
    _check_exponent(alpha, "alpha")
    if alpha == 1:
        return energy
    _check_objective(energy)

    def parts(s: PrincipalStretches, v: Values) -> Parts:
        scale = v["nonlinearity"] ** -2
        own = energy.parts(s.power(v["nonlinearity"]), v)
        return Parts(own.shear * scale, own.bulk, None if own.volume is None else own.volume * scale)

    # A power of a negative stretch is not a number.
    return replace(energy, parts=parts, values={**energy.values, "nonlinearity": float(alpha)}, inverts=False)


def with_separate_nonlinearity(energy: Energy, alpha_lambda: float, alpha_mu: float) -> Energy:
    """Each part with an exponent of its own (Chen & Barbič, Eq. 20).

    Raises:
        MaterialError: If an exponent is not positive, or the energy has no λ part.
    """
    _check_exponent(alpha_lambda, "alpha_lambda")
    _check_exponent(alpha_mu, "alpha_mu")
    if alpha_lambda == alpha_mu:
        return with_nonlinearity(energy, alpha_mu)
    _check_objective(energy)
    _check_has_lambda(energy)
    shear_part, held = _shear_part(energy)

    def parts(s: PrincipalStretches, v: Values) -> Parts:
        alpha_l, alpha_m = v["nonlinearity_lambda"], v["nonlinearity_mu"]
        volume = energy.parts(s.power(alpha_l) if alpha_lambda != 1 else s, v).volume
        shear = shear_part(s.power(alpha_m) if alpha_mu != 1 else s, v)
        return Parts(shear * alpha_m**-2, v["lame_lambda"], volume * alpha_l**-2)

    values = {
        **energy.values,
        "lambda_in_shear": held,
        "lame_lambda": linearize(energy).lame_lambda,
        "nonlinearity_lambda": float(alpha_lambda),
        "nonlinearity_mu": float(alpha_mu),
    }
    return replace(energy, parts=parts, values=values, inverts=False)


def with_volume(energy: Energy, other: Energy, lame_lambda: float) -> Energy:
    """The μ part of one energy with the λ part of another (Chen & Barbič, Eq. 19 and Section 6).

    An energy without a λ part is augmented by one.

    Args:
        energy: Gives the μ part.
        other: Gives ψ_λ, whose Lamé pair is (1, 0).
        lame_lambda: λ_Lamé of the result.

    Raises:
        MaterialError: If `other` has no λ part.
    """
    _check_objective(energy)
    _check_objective(other)
    _check_has_lambda(other)
    shear_part, held = _shear_part(energy)

    def parts(s: PrincipalStretches, v: Values) -> Parts:
        own = {name: v[f"volume.{name}"] for name in other.values}
        return Parts(shear_part(s, v), v["lame_lambda"], other.parts(s, own).volume)

    # An energy without a λ part has nothing to move what its μ part holds: the new part makes up for it.
    remaining = held if _volume(energy) is None else 0.0
    own = {f"volume.{name}": value for name, value in other.values.items()}
    return replace(
        energy,
        parts=parts,
        values={**energy.values, **own, "lambda_in_shear": held, "lame_lambda": lame_lambda - remaining},
        inverts=energy.inverts and other.inverts,
    )


def _volume(energy: Energy) -> Scalar | None:
    return energy.parts(PrincipalStretches((1.0, 1.0, 1.0)), energy.values).volume


def _check_has_lambda(energy: Energy) -> None:
    if _volume(energy) is None:
        raise MaterialError(f'{energy.name}: has no λ part; add one with volume = "neo-hookean-ogden"')


def _shear_part(energy: Energy) -> tuple[Callable[[PrincipalStretches, Values], Scalar], float]:
    """The μ part of Eq. 19, with Lamé pair (0, μ_Lamé), and the λ that the part as written holds.

    That is none for most, -μ for stable neo-Hookean; it moves to where λ is by way of the energy's own ψ_λ.
    """
    at_rest = linearize(energy)
    written = energy.parts(PrincipalStretches((1.0, 1.0, 1.0)), energy.values)
    held = at_rest.lame_lambda - (0.0 if written.volume is None else written.bulk)
    if written.volume is None or abs(held) <= 1e-13 * at_rest.lame_mu:
        return lambda s, v: energy.parts(s, v).shear, held

    def shear(s: PrincipalStretches, v: Values) -> Scalar:
        own = energy.parts(s, v)
        return own.shear - v["lambda_in_shear"] * own.volume

    return shear, held
