"""PK1 linearisation of any energy, and calibration to Young's modulus and Poisson's ratio.

Chen & Barbič, Sections 3-4. All derivatives are UFL's own, in the stretches and in the parameters.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from numpy.typing import NDArray

from elastune.forms.energy import Energy, Material, MaterialError, as_number
from elastune.forms.evaluation import as_numpy, evaluate
from elastune.forms.kinematics import PrincipalStretches

__all__ = ["Linearization", "calibrate", "check_rest", "evaluate", "lame_pair", "linearize"]

_INF = float("inf")


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
        if self.lame_lambda == _INF:
            return 3 * self.lame_mu
        return self.lame_mu * (3 * self.lame_lambda + 2 * self.lame_mu) / (self.lame_lambda + self.lame_mu)

    @property
    def poissons_ratio(self) -> float:
        """ν by Eq. 14."""
        if self.lame_lambda == _INF:
            return 0.5
        return self.lame_lambda / (2 * (self.lame_lambda + self.lame_mu))


def lame_pair(E: float, nu: float, mixed: bool = False) -> tuple[float, float]:
    """(λ_Lamé, μ_Lamé) of Young's modulus and Poisson's ratio (Chen & Barbič, Eq. 15).

    Args:
        E: Young's modulus, in the unit of stress.
        nu: Poisson's ratio.
        mixed: Whether ν = 0.5 is allowed too, where λ is infinite.

    Raises:
        MaterialError: Unless E > 0 and -1 < ν < 0.5.
    """
    E, nu = as_number(E, "E"), as_number(nu, "nu")
    if not 0 < E < float("inf"):
        raise MaterialError(f"E: must be a positive number, got {E!r}")
    if mixed and nu == 0.5:
        return _INF, E / 3
    if nu == 0.5:
        way_out = 'use element = "P2-P1", or "Q2-P1d" on hexahedra'
        raise MaterialError(f"nu: must be below 0.5 for a displacement formulation, got {nu!r}; {way_out}")
    if not -1 < nu < 0.5:
        highest = "at most 0.5" if mixed else "below 0.5"
        raise MaterialError(f"nu: must be {highest if nu > 0 else 'above -1'}, got {nu!r}")
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


class _RestState:
    """An energy's linearisation as a function of its parameters: differentiated once, evaluated often."""

    def __init__(self, energy: Energy) -> None:
        self.name = energy.name
        self._constants = [ufl.variable(ufl.as_ufl(1.0)) for _ in energy.constants()]
        s = [ufl.variable(ufl.as_ufl(1.0)) for _ in range(3)]
        psi = ufl.as_ufl(energy.density(PrincipalStretches(s), energy.unpack(self._constants)))
        first = ufl.diff(psi, s[0])
        mixed = ufl.diff(first, s[1])
        self._pair = mixed, (ufl.diff(first, s[0]) - mixed) / 2
        self._values = as_numpy([psi, first, *self._pair], self._constants)

    @cached_property
    def _slopes(self) -> Callable[..., tuple[Any, ...]]:
        slopes = [ufl.diff(value, constant) for value in self._pair for constant in self._constants]
        return as_numpy(slopes, self._constants)

    def at(self, constants: Sequence[float]) -> Linearization:
        """The linearisation with these values of the constants, in the order of `Energy.constants`."""
        return Linearization(*map(float, self._values(*constants)))

    def jacobian(self, constants: Sequence[float]) -> NDArray[np.float64]:
        """The Lamé pair's derivatives, shape (2, number of constants)."""
        return np.array(self._slopes(*constants)).reshape(2, -1)

    def check(self, constants: Sequence[float]) -> Linearization:
        """Refuses stress at rest, and moduli that are not positive."""
        at_rest = self.check_stress(constants)
        shear, bulk = at_rest.lame_mu, at_rest.lame_lambda + 2 * at_rest.lame_mu / 3
        if not (shear > 0 and bulk > 0):
            raise MaterialError(
                f"{self.name}: expected positive shear and bulk moduli at rest, got {shear:g} and {bulk:g}"
            )
        return at_rest

    def check_stress(self, constants: Sequence[float]) -> Linearization:
        """Refuses stress at rest."""
        at_rest = self.at(constants)
        if not abs(at_rest.stress) <= 1e-10 * (abs(at_rest.lame_mu) + abs(at_rest.lame_lambda)):
            raise MaterialError(
                f"{self.name}: stressed at rest, ∂ψ/∂λᵢ(1) = {at_rest.stress:g}; "
                'expected an energy at rest, such as variant = "corrected"'
            )
        return at_rest


def linearize(energy: Energy) -> Linearization:
    """The energy's value, stress and Lamé pair at rest."""
    if energy.incompressible:
        return replace(linearize(energy.shear), lame_lambda=_INF)
    return _RestState(energy).at(energy.constants())


def check_rest(energy: Energy) -> Linearization:
    """The linearisation of an energy that is at rest at F = I and positive definite there.

    Raises:
        MaterialError: If it is not; the message names the stress, or the moduli.
    """
    return _RestState(energy).check(energy.constants())


def calibrate(
    material: Material,
    E: float,
    nu: float,
    given: dict[str, Any] | None = None,
    solve_for: str | Sequence[str] | None = None,
    augmented: bool = False,
    mixed: bool = False,
) -> Energy:
    """The energy of a material whose Lamé pair is that of E and ν (Chen & Barbič, Section 4).

    Two parameters are solved for exactly. A material with more keeps the others as given; those not given
    keep their default ratio to E. A material with λ = 0 at rest is scaled as a whole.

    Args:
        material: Catalogue entry.
        E: Young's modulus, in the unit of stress.
        nu: Poisson's ratio.
        given: Parameters and options that differ from the defaults. A parameter named in `solve_for` starts
            there; the terms of a scaled material keep their ratios.
        solve_for: Two parameters to solve for; or "least" for the least relative change of all; or None for
            the material's usual pair, none of which may then be given.
        augmented: Whether a λ part is to be added: a material with λ = 0 then serves at any ν.
        mixed: Whether ν = 0.5 is allowed; the parameter that is the weight of the λ part is then infinite.

    Raises:
        MaterialError: If E, ν, a parameter or an option is impossible, the material is stressed at rest, has
            no λ, or leaves its own domain on the way.
    """
    values, options = material.check(given or {})
    moduli = [parameter for parameter in material.parameters if parameter.bounds.modulus]
    if not moduli:
        raise MaterialError(f"{material.name}: has no modulus to calibrate; expected neither E nor nu")
    defaults = material.energy(**options)
    if solve_for is None:
        scaled = [p.name for p in moduli if not isinstance(p.default, tuple)]
        usual = material.pair if defaults.has_lambda else scaled
        for name in usual:
            if name in values:
                raise MaterialError(f"{material.name}.{name}: follows from E and nu; give those, or {name}")
    target = np.array(lame_pair(E, nu, mixed))
    incompressible = target[0] == _INF
    if incompressible:
        if solve_for is not None:
            raise MaterialError(f"{material.name}: calibrate must be left out at nu = 0.5, got {solve_for!r}")
        # Any λ would do: in no material does μ_Lamé depend on its weight.
        target[0] = E
    modulus = check_rest(defaults).youngs_modulus
    start = defaults.with_values({p.name: _scale(p.default, E / modulus) for p in moduli} | values)
    rest = _RestState(start)
    if not start.has_lambda:
        if solve_for not in (None, "least"):
            raise MaterialError(f"{material.name}: has no λ part, so no pair to solve for, got {solve_for!r}")
        if nu != 0 and not augmented:
            raise MaterialError(
                f"{material.name}: has no λ part, so nu must be 0, got {nu:g}; "
                'add a λ part with volume = "neo-hookean-ogden"'
            )
        factor = float(target[1]) / rest.check(start.constants()).lame_mu
        energy = start.with_values({p.name: _scale(start.values[p.name], factor) for p in moduli})
    else:
        rest.check_stress(start.constants())
        constants = _solve(material, rest, start, target, solve_for)
        energy = start.with_values(start.unpack([float(value) for value in constants]))
    where = f"{material.name}, calibrated to E = {E:g}, nu = {nu:g}"
    for parameter in material.parameters:
        parameter.check(energy.values[parameter.name], where)
    rest.check(energy.constants())
    return _incompressible(energy) if incompressible and energy.has_lambda else energy


def _incompressible(energy: Energy) -> Energy:
    """The same energy with an infinite weight of its λ part, which in every material is a parameter."""
    symbols = {name: ufl.variable(ufl.as_ufl(1.0)) for name, value in energy.values.items() if np.isscalar(value)}
    bulk = energy.parts(PrincipalStretches((1.0, 1.0, 1.0)), {**energy.values, **symbols}).bulk
    return energy.with_values({name: _INF for name, symbol in symbols.items() if symbol is bulk})


def _scale(value: Any, factor: float) -> Any:
    return tuple(term * factor for term in value) if isinstance(value, tuple) else value * factor


def _solve(
    material: Material,
    rest: _RestState,
    start: Energy,
    target: NDArray[np.float64],
    solve_for: str | Sequence[str] | None,
) -> NDArray[np.float64]:
    """The constants of least relative change that meet the target Lamé pair.

    Newton's method on the constraint, each step projected to the point of least weighted distance from the
    start; with two unknowns that is Newton's method, and exact where the pair is linear in them.
    """
    names = list(start.values)
    if solve_for == "least":
        chosen = tuple(names)
    else:
        chosen = material.pair if solve_for is None else tuple(solve_for)
        if isinstance(solve_for, str) or len(set(chosen)) != 2 or not set(chosen) <= set(names):
            expected = f'"least" or two of {", ".join(names)}'
            raise MaterialError(f"{material.name}: calibrate must be {expected}, got {solve_for!r}")
    constants = [p for p in material.parameters for _ in np.atleast_1d(start.values[p.name])]
    unknowns = [i for i, parameter in enumerate(constants) if parameter.name in chosen]
    origin = np.array(start.constants())
    # A change from zero is measured by the shear modulus, or by one.
    units = np.array([target[1] if parameter.bounds.modulus else 1.0 for parameter in constants])
    weights = np.where(origin != 0, origin, units)[unknowns]
    values, found, best = origin.copy(), origin, np.inf
    for _ in range(50):
        at_rest, jacobian = rest.at(list(values)), rest.jacobian(list(values))[:, unknowns]
        misfit = np.array([at_rest.lame_lambda, at_rest.lame_mu]) - target
        # Relative to the constrained modulus: λ may be zero, and their ratio large.
        error = np.abs(misfit).max() / (abs(target[0]) + target[1])
        if not (np.isfinite(error) and np.isfinite(jacobian).all()):
            break
        if best < 1e-12 and error >= best / 2:
            break
        if error < best:
            found, best = values.copy(), error
        wanted = jacobian @ (values - origin)[unknowns] - misfit
        # Of all solutions of the linearised constraint, lstsq takes the one of least norm.
        change = np.linalg.lstsq(jacobian * weights, wanted, rcond=None)[0]
        values[unknowns] = origin[unknowns] + weights * change
    if not best < 1e-12:
        raise MaterialError(
            f"{material.name}: no value of {' and '.join(chosen)} gives λ_Lamé = {target[0]:g} and "
            f"μ_Lamé = {target[1]:g}; expected parameters that set both"
        )
    return found
