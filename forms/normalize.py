"""PK1 linearisation of any energy, and calibration to Young's modulus and Poisson's ratio.

Chen & Barbič, Sections 3-4. All derivatives are UFL's own, in the stretches and in the parameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives

from forms.energy import Energy, Material, MaterialError
from forms.kinematics import PrincipalStretches, Scalar


@dataclass(frozen=True)
class Linearization:
    """An isotropic energy to second order about rest (Chen & Barbič, Theorem 3.1).

    Attributes:
        energy: ψ(1, 1, 1).
        stress: ∂₁ψ(1, 1, 1), zero unless the energy is stressed at rest.
        lame_lambda: ∂₁₂ψ(1, 1, 1), Eq. 3.
        lame_mu: (∂₁₁ψ - ∂₁₂ψ)(1, 1, 1) / 2, Eq. 4.
    """

    energy: float
    stress: float
    lame_lambda: float
    lame_mu: float

    @property
    def youngs_modulus(self) -> float:
        """E by Eq. 14."""
        return self.lame_mu * (3 * self.lame_lambda + 2 * self.lame_mu) / (self.lame_lambda + self.lame_mu)

    @property
    def poissons_ratio(self) -> float:
        """ν by Eq. 14."""
        return self.lame_lambda / (2 * (self.lame_lambda + self.lame_mu))


def lame_pair(E: float, nu: float) -> tuple[float, float]:
    """(λ_Lamé, μ_Lamé) of Young's modulus and Poisson's ratio (Chen & Barbič, Eq. 15).

    Raises:
        MaterialError: Unless E > 0 and -1 < ν < 0.5.
    """
    if not 0 < E < float("inf"):
        raise MaterialError(f"E: must be a positive number, got {E!r}")
    if not -1 < nu < 0.5:
        limit = "below 0.5 for a displacement formulation" if nu >= 0.5 else "above -1"
        raise MaterialError(f"nu: must be {limit}, got {nu!r}")
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def evaluate(expression: Scalar) -> float:
    """The value of a UFL expression of numbers, with its derivatives carried out."""
    return float(apply_derivatives(apply_algebra_lowering(ufl.as_ufl(expression)))(()))


def _at_rest(energy: Energy, constants: Sequence[Scalar]) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """ψ, ∂₁ψ, λ_Lamé and μ_Lamé at rest as UFL expressions of the constants."""
    s = [ufl.variable(ufl.as_ufl(1.0)) for _ in range(3)]
    psi = ufl.as_ufl(energy.density(PrincipalStretches(s), energy.unpack(constants)))
    first = ufl.diff(psi, s[0])
    mixed = ufl.diff(first, s[1])
    return psi, first, mixed, (ufl.diff(first, s[0]) - mixed) / 2


def linearize(energy: Energy) -> Linearization:
    """The energy's value, stress and Lamé pair at rest."""
    return Linearization(*(evaluate(value) for value in _at_rest(energy, energy.constants())))


def check_rest(energy: Energy) -> Linearization:
    """The linearisation of an energy that is at rest at F = I and positive definite there.

    Raises:
        MaterialError: If it is not; the message names the stress, or the moduli.
    """
    at_rest = linearize(energy)
    scale = abs(at_rest.lame_mu) + abs(at_rest.lame_lambda)
    if not abs(at_rest.stress) <= 1e-10 * scale:
        raise MaterialError(
            f"{energy.name}: stressed at rest, ∂ψ/∂λᵢ(1) = {at_rest.stress:g}; "
            'expected an energy at rest, such as variant = "corrected"'
        )
    bulk = at_rest.lame_lambda + 2 * at_rest.lame_mu / 3
    if not (at_rest.lame_mu > 0 and bulk > 0):
        raise MaterialError(
            f"{energy.name}: expected positive shear and bulk moduli at rest, got {at_rest.lame_mu:g} and {bulk:g}"
        )
    return at_rest


def calibrate(
    material: Material,
    E: float,
    nu: float,
    given: dict[str, Any] | None = None,
    solve_for: str | Sequence[str] | None = None,
    augmented: bool = False,
) -> Energy:
    """The energy of a material whose Lamé pair is that of E and ν (Chen & Barbič, Section 4).

    Two parameters are solved for exactly. A material with more keeps the others as given; those not given keep
    their default ratio to E. A material with λ = 0 at rest is scaled as a whole.

    Args:
        material: Catalogue entry.
        E: Young's modulus, in the unit of stress.
        nu: Poisson's ratio.
        given: Parameters and options that differ from the defaults.
        solve_for: Two parameters to solve for; or "least" for the least relative change of all; or None for
            the material's usual pair.
        augmented: Whether a λ part is to be added: a material with λ = 0 then serves at any ν.

    Raises:
        MaterialError: If E, ν, a parameter or an option is impossible, the material is stressed at rest, has
            no λ, or leaves its own domain on the way.
    """
    target = np.array(lame_pair(E, nu))
    given = given or {}
    values, options = material.check(given)
    start = _scaled_defaults(material, options, values, E)
    at_rest = check_rest(start)
    if not _depends_on_lambda(material, start):
        if nu != 0 and not augmented:
            raise MaterialError(
                f"{material.name}: has no λ part, so nu must be 0, got {nu:g}; "
                'add a λ part with volume = "neo-hookean-ogden"'
            )
        factor = float(target[1]) / at_rest.lame_mu
        energy = start.with_values(
            {p.name: _scale(start.values[p.name], factor) for p in material.parameters if p.bounds.modulus}
        )
    else:
        energy = _solve(material, start, target, solve_for)
    for parameter in material.parameters:
        parameter.check(energy.values[parameter.name], f"{material.name}: calibrated to E = {E:g}, nu = {nu:g}")
    check_rest(energy)
    return energy


def _scale(value: Any, factor: float) -> Any:
    return tuple(term * factor for term in value) if isinstance(value, tuple) else value * factor


def _scaled_defaults(material: Material, options: dict[str, str], values: dict[str, Any], E: float) -> Energy:
    """The energy to start from: default moduli in their ratio to E, then what was given."""
    energy = material.energy(**options)
    modulus = check_rest(energy).youngs_modulus
    scaled = {p.name: _scale(p.default, E / modulus) for p in material.parameters if p.bounds.modulus}
    return energy.with_values({**scaled, **values})


def _depends_on_lambda(material: Material, energy: Energy) -> bool:
    measures = PrincipalStretches((1.0, 1.0, 1.0))
    return energy.parts(measures, energy.values).volume is not None


def _unknowns(material: Material, energy: Energy, solve_for: str | Sequence[str] | None) -> list[int]:
    """Positions in the flat list of constants of the parameters to solve for."""
    names = [name for name, value in energy.values.items() for _ in (value if isinstance(value, tuple) else (0,))]
    if solve_for == "least":
        return list(range(len(names)))
    chosen = material.pair if solve_for is None else tuple(solve_for)
    if isinstance(solve_for, str) or len(set(chosen)) != 2 or not set(chosen) <= set(names):
        raise MaterialError(
            f'{material.name}: calibrate must be "least" or two of {", ".join(dict.fromkeys(names))}, got {solve_for!r}'
        )
    return [i for i, name in enumerate(names) if name in chosen]


def _solve(
    material: Material, energy: Energy, target: np.ndarray, solve_for: str | Sequence[str] | None
) -> Energy:
    """Least relative change of the unknowns that meets the target Lamé pair.

    Newton's method on the constraint, each step projected to the point of least weighted distance from the
    start; with two unknowns that is Newton's method, and exact where the pair is linear in them.
    """
    unknowns = _unknowns(material, energy, solve_for)
    start = np.array(energy.constants())
    weights = np.where(start[unknowns] != 0, start[unknowns], target[1]) ** 2
    constants = start.copy()
    # Relative to the constrained modulus: λ may be zero, and their ratio large.
    scale = abs(target[0]) + target[1]
    best = np.inf
    for _ in range(50):
        pair, jacobian = _pair_and_jacobian(energy, constants, unknowns)
        if not np.isfinite(pair).all() or not np.isfinite(jacobian).all():
            break
        misfit = pair - target
        if (error := np.abs(misfit / scale).max()) >= best / 2 and best < 1e-13:
            break
        best = min(best, error)
        normal = jacobian * weights @ jacobian.T
        wanted = jacobian @ (constants - start)[unknowns] - misfit
        constants[unknowns] = start[unknowns] + weights * (jacobian.T @ np.linalg.lstsq(normal, wanted, rcond=None)[0])
    else:
        best = np.inf
    if not best < 1e-12:
        names = solve_for if solve_for == "least" else " and ".join(solve_for or material.pair)
        raise MaterialError(
            f"{material.name}: no value of {names} gives λ_Lamé = {target[0]:g} and μ_Lamé = {target[1]:g}; "
            "expected parameters that set both"
        )
    return energy.with_values(
        {
            name: tuple(map(float, value)) if isinstance(value, tuple) else float(value)
            for name, value in energy.unpack(constants).items()
        }
    )


def _pair_and_jacobian(energy: Energy, constants: np.ndarray, unknowns: list[int]) -> tuple[np.ndarray, np.ndarray]:
    variables = [ufl.variable(ufl.as_ufl(float(c))) for c in constants]
    _, _, *pair = _at_rest(energy, variables)
    jacobian = [[evaluate(ufl.diff(value, variables[i])) for i in unknowns] for value in pair]
    return np.array([evaluate(value) for value in pair]), np.array(jacobian)
