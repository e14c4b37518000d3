"""Energy -> energy: nonlinearity exponent, λ/μ mixing and volume augmentation (Chen & Barbič, Sections 5-6).

None of them changes the linearisation at rest, and they may follow one another in any order. Exponents and
coefficients are stored among the energy's values, so that changing them recompiles nothing.
"""

from collections.abc import Callable
from dataclasses import replace

from elastune.forms.energy import Energy, MaterialError, Parts, Values, as_number
from elastune.forms.kinematics import PrincipalStretches, Scalar
from elastune.forms.normalize import linearize

ShearPart = Callable[[PrincipalStretches, Values], Scalar]


def _exponent(alpha: float, name: str) -> float:
    alpha = as_number(alpha, name)
    if not 0 < alpha < float("inf"):
        raise MaterialError(f"{name}: must be a positive number, got {alpha!r}")
    return alpha


def _check_objective(energy: Energy) -> None:
    if not energy.objective:
        expected = "alpha = 1 and no volume part"
        raise MaterialError(f"{energy.name}: not a function of stretches; expected {expected}")


def _fresh(energy: Energy, name: str) -> str:
    """The name, primed until it is new: an energy tuned before reads its own values under the old one."""
    while name in energy.values:
        name += "'"
    return name


def with_nonlinearity(energy: Energy, alpha: float) -> Energy:
    """ψ_α(λᵢ) = ψ(λᵢ^α) / α² (Chen & Barbič, Eq. 16); α = 1 returns the energy itself.

    Raises:
        MaterialError: If alpha is not positive, or the energy no function of stretches.
    """
    alpha = _exponent(alpha, "alpha")
    if alpha == 1:
        return energy
    _check_objective(energy)
    key = _fresh(energy, "nonlinearity")

    def parts(s: PrincipalStretches, v: Values) -> Parts:
        scale = v[key] ** -2
        own = energy.parts(s.power(v[key]), v)
        return Parts(own.shear * scale, own.bulk, None if own.volume is None else own.volume * scale)

    # A power of a negative stretch is not a number.
    return replace(energy, parts=parts, values={**energy.values, key: alpha}, inverts=False)


def with_separate_nonlinearity(energy: Energy, alpha_lambda: float, alpha_mu: float) -> Energy:
    """Each part with an exponent of its own (Chen & Barbič, Eq. 20).

    Raises:
        MaterialError: If an exponent is not positive, or the energy has no λ part.
    """
    alpha_lambda, alpha_mu = _exponent(alpha_lambda, "alpha_lambda"), _exponent(alpha_mu, "alpha_mu")
    if alpha_lambda == alpha_mu:
        return with_nonlinearity(energy, alpha_mu)
    _check_objective(energy)
    _check_has_lambda(energy)
    mu_part, own, _ = shear_part(energy)
    key_l, key_m = _fresh(energy, "nonlinearity_lambda"), _fresh(energy, "nonlinearity_mu")
    key = _fresh(energy, "lame_lambda")

    def parts(s: PrincipalStretches, v: Values) -> Parts:
        volume = energy.parts(s.power(v[key_l]) if alpha_lambda != 1 else s, v).volume
        shear = mu_part(s.power(v[key_m]) if alpha_mu != 1 else s, v)
        return Parts(shear * v[key_m] ** -2, v[key], volume * v[key_l] ** -2)

    exponents = {key_l: alpha_lambda, key_m: alpha_mu, key: linearize(energy).lame_lambda}
    return replace(energy, parts=parts, values={**energy.values, **own, **exponents}, inverts=False)


def with_volume(energy: Energy, other: Energy, lame_lambda: float) -> Energy:
    """The μ part of one energy with the λ part of another (Chen & Barbič, Eq. 19 and Section 6).

    An energy without a λ part is augmented by one.

    Args:
        energy: Gives the μ part.
        other: Gives ψ_λ, whose Lamé pair is (1, 0).
        lame_lambda: λ_Lamé of the result, in the unit of stress.

    Raises:
        MaterialError: If `other` has no λ part.
    """
    _check_objective(energy)
    _check_objective(other)
    _check_has_lambda(other)
    mu_part, own, remaining = shear_part(energy)
    keys = {name: _fresh(energy, f"volume.{name}") for name in other.values}
    key = _fresh(energy, "lame_lambda")

    def parts(s: PrincipalStretches, v: Values) -> Parts:
        volume = other.parts(s, {name: v[keys[name]] for name in keys}).volume
        return Parts(mu_part(s, v), v[key], volume)

    added = {keys[name]: value for name, value in other.values.items()}
    added[key] = as_number(lame_lambda, "lame_lambda") - remaining
    return replace(
        energy,
        parts=parts,
        values={**energy.values, **own, **added},
        inverts=energy.inverts and other.inverts,
    )


def _check_has_lambda(energy: Energy) -> None:
    if not energy.has_lambda:
        raise MaterialError(f'{energy.name}: has no λ part; add one with volume = "neo-hookean-ogden"')


def shear_part(energy: Energy) -> tuple[ShearPart, dict[str, float], float]:
    """The μ part of Eq. 19, the values it reads beside the energy's own, and the λ_Lamé left in it.

    The part as written may hold some λ, -μ in stable neo-Hookean; it moves to where λ is by way of the
    energy's own ψ_λ, and only stays where there is none.
    """
    at_rest = linearize(energy)
    if not energy.has_lambda:
        return lambda s, v: energy.parts(s, v).shear, {}, at_rest.lame_lambda
    held = linearize(energy.shear).lame_lambda
    # Less than this is rounding.
    if abs(held) <= 1e-13 * at_rest.lame_mu:
        return lambda s, v: energy.parts(s, v).shear, {}, 0.0
    key = _fresh(energy, "lambda_in_shear")

    def shear(s: PrincipalStretches, v: Values) -> Scalar:
        own = energy.parts(s, v)
        return own.shear - v[key] * own.volume

    return shear, {key: held}, 0.0
