"""Uniaxial tension and compression of a point: the curve that a tensile test of the material gives."""

from collections.abc import Callable
from typing import Any

import numpy as np
import ufl
from numpy.typing import ArrayLike, NDArray

from elastune.forms.energy import Energy
from elastune.forms.evaluation import as_numpy
from elastune.forms.kinematics import PrincipalStretches

# Largest and smallest step in the logarithm of the axial stretch, and how far the sides may move in one:
# farther away, even after the smallest step, is another branch of equilibria, to which a bar would jump.
_STEP, _SMALLEST, _REACH = 0.02, 1e-7, 0.05


def uniaxial(energy: Energy, stretches: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Nominal stress and lateral stretch of a bar pulled along one axis and free at its sides.

    The lateral stretch is the one reached by stretching gradually from rest: a local minimum of the energy,
    of which a material may have several. The curve ends where that minimum does.

    Args:
        energy: Strain-energy density, at rest at F = I.
        stretches: Positive stretches along the axis, shape (n,), in any order.

    Returns:
        First Piola-Kirchhoff stress along the axis, in the unit of the moduli, and the stretch across, both
        of shape (n,), not a number beyond the end of the curve.

    Raises:
        ValueError: If a stretch is not positive.
    """
    wanted = np.asarray(stretches, dtype=float)
    if not (np.isfinite(wanted).all() and (wanted > 0).all()):
        raise ValueError(f"expected positive stretches, got {wanted.min():g} to {wanted.max():g}")
    stresses = _principal_stresses(energy)
    lateral = np.full(wanted.shape, np.nan)
    for side in (np.flatnonzero(wanted >= 1), np.flatnonzero(wanted < 1)):
        previous, width = 1.0, 1.0
        for i in side[np.argsort(np.abs(np.log(wanted[side])))]:
            width = _follow(stresses, previous, wanted[i], width)
            previous, lateral[i] = wanted[i], width
    stress = stresses(wanted, lateral)[0]
    return np.where(np.isnan(lateral), np.nan, stress), lateral


def _principal_stresses(energy: Energy) -> Callable[..., tuple[Any, ...]]:
    """(p₁, p₂) at stretches (λ, w, w), a function of λ and w."""
    s = [ufl.variable(ufl.as_ufl(1.0)) for _ in range(3)]
    constants = [ufl.variable(ufl.as_ufl(float(value))) for value in energy.constants()]
    psi = ufl.as_ufl(energy.density(PrincipalStretches(s), energy.unpack(constants)))
    function = as_numpy([ufl.diff(psi, s[0]), ufl.diff(psi, s[1])], s)
    return lambda stretch, width: function(stretch, width, width)


def _follow(stresses: Callable[..., tuple[Any, ...]], start: float, end: float, width: float) -> float:
    """The lateral stretch at `end` on the branch with `width` at `start`; not a number if it ends before."""
    here, goal, step = float(np.log(start)), float(np.log(end)), _STEP
    while here != goal and np.isfinite(width):
        ahead = goal if abs(goal - here) <= step else here + np.copysign(step, goal - here)
        found = _lateral_equilibrium(stresses, end if ahead == goal else np.exp(ahead), width)
        if np.isfinite(found):
            here, width, step = ahead, found, min(2 * step, _STEP)
        elif step > _SMALLEST:
            step /= 4
        else:
            width = np.nan
    return width


def _lateral_equilibrium(stresses: Callable[..., tuple[Any, ...]], stretch: float, start: float) -> float:
    """The lateral stretch without stress that is near and downhill of a start; not a number without one."""
    from scipy.optimize import brentq

    def pull(logarithm: float) -> float:
        width = np.exp(logarithm)
        return float(stresses(stretch, width)[1])

    origin = float(np.log(start))
    stress = pull(origin)
    if stress == 0 or not np.isfinite(stress):
        return start if stress == 0 else np.nan
    # The energy falls against the stress; the first change of its sign is the nearest minimum.
    near, far = 0.0, 1e-3
    while near < _REACH:
        ends = [origin - np.sign(stress) * distance for distance in (near, far)]
        if pull(ends[1]) * stress <= 0:
            return float(np.exp(brentq(pull, *ends, xtol=1e-15, rtol=1e-15)))
        near, far = far, min(1.5 * far, _REACH)
    return np.nan
