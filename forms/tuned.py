"""From a material's name and a few numbers to the energy that is solved: calibrated, mixed, and tuned."""

from collections.abc import Mapping, Sequence
from typing import Any

from elastune.forms.energy import Energy, Material, MaterialError
from elastune.forms.materials import get
from elastune.forms.normalize import calibrate as calibrate_material
from elastune.forms.normalize import check_rest, lame_pair
from elastune.forms.tuning import with_nonlinearity, with_separate_nonlinearity, with_volume


def tuned_energy(
    name: str | Material,
    E: float | None = None,
    nu: float | None = None,
    alpha: float | None = None,
    alpha_lambda: float | None = None,
    alpha_mu: float | None = None,
    volume: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    calibrate: str | Sequence[str] | None = None,
    mixed: bool = False,
) -> Energy:
    """The energy of a material with the Lamé pair of E and ν and the given nonlinearity.

    Args:
        name: Name in the catalogue, or an entry of no catalogue.
        E: Young's modulus, in the unit of stress; without E and nu every modulus has to be given.
        nu: Poisson's ratio.
        alpha: Nonlinearity exponent of the whole energy (Chen & Barbič, Eq. 16).
        alpha_lambda: Exponent of the λ part (Eq. 20).
        alpha_mu: Exponent of the μ part (Eq. 20).
        volume: Material whose λ part is taken (Eq. 19, Section 6).
        parameters: Parameters and options that differ from the defaults.
        calibrate: See `elastune.forms.normalize.calibrate`.
        mixed: Whether the λ part is carried by a pressure, which allows ν = 0.5.

    Raises:
        MaterialError: If the material cannot be what is asked for.
    """
    material = get(name) if isinstance(name, str) else name
    given = dict(parameters or {})
    if (E is None) != (nu is None):
        missing = "nu" if nu is None else "E"
        raise MaterialError(f"{missing}: missing; expected both E and nu, or neither and all parameters as given")
    if E is None or nu is None:
        if isinstance(name, str):
            # Who wrote a formula of their own chose its defaults, in a unit of their own.
            _check_moduli(material, given, volume)
        energy = material.energy(**given)
        lame_lambda = check_rest(energy).lame_lambda
    else:
        energy = calibrate_material(material, E, nu, given, calibrate, augmented=volume is not None, mixed=mixed)
        lame_lambda = lame_pair(E, nu, mixed)[0]
    if volume is not None:
        energy = with_volume(energy, get(volume).energy(), lame_lambda)
    if alpha_lambda is None and alpha_mu is None:
        return with_nonlinearity(energy, 1.0 if alpha is None else alpha)
    if alpha is not None:
        raise MaterialError("alpha: expected either alpha, or alpha_lambda and alpha_mu, got both")
    return with_separate_nonlinearity(
        energy, 1.0 if alpha_lambda is None else alpha_lambda, 1.0 if alpha_mu is None else alpha_mu
    )


def _check_moduli(material: Material, given: Mapping[str, Any], volume: str | None) -> None:
    """Refuses what only E and ν would tell: a default has no unit."""
    material.check(given)
    missing = [p.name for p in material.parameters if p.bounds.modulus and p.default != 0 and p.name not in given]
    if missing:
        raise MaterialError(f"{material.name}.{missing[0]}: missing; expected E and nu, or every modulus of it")
    if volume is not None and not material.energy(**given).has_lambda:
        raise MaterialError(f"volume = {volume!r}: its weight is λ, which {material.name} lacks; give E and nu")
