"""ψ as a μ part and λ U(J): what a pressure field needs to know of an energy."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from numpy.typing import NDArray
from ufl.corealg.traversal import unique_pre_traversal

from elastune.forms.energy import Energy, MaterialError, Parts
from elastune.forms.evaluation import as_numpy
from elastune.forms.kinematics import PrincipalStretches, Scalar
from elastune.forms.normalize import linearize
from elastune.forms.tuning import shear_part

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Split:
    """ψ = W + λ U(J), with no λ left in W at rest and U ≈ (J - 1)²/2 near there.

    Attributes:
        shear: W as an energy of its own.
        bulk: λ_Lamé, infinite at ν = 0.5.
        volume: U as a function of a UFL expression J.
    """

    shear: Energy
    bulk: float
    volume: Callable[[Scalar], Scalar]

    @cached_property
    def _derivatives(self) -> Callable[..., tuple[Any, ...]]:
        J = ufl.variable(ufl.as_ufl(1.0))
        U = ufl.as_ufl(self.volume(J))
        first = ufl.diff(U, J)
        return as_numpy([U, first, ufl.diff(first, J)], [J])

    def derivatives(self, J: Array) -> tuple[Array, Array, Array]:
        """U, U' and U'' at volume ratios of any one shape."""
        U, first, second = (np.broadcast_to(value, np.shape(J)) for value in self._derivatives(J))
        return U, first, second

    @cached_property
    def quadratic(self) -> bool:
        """Whether U is (J - 1)²/2, or as good as it because λ is infinite and J one."""
        return bool(np.isinf(self.bulk) or np.all(self.derivatives(np.array([0.3, 0.7, 1.9]))[2] == 1))

    def conjugate(self, p: Array) -> tuple[Array, Array, Array]:
        """The energy that a pressure stores, the volume ratio that it makes, and the derivative of that ratio.

        The first is Legendre's transform of λU, max over j of p (j - 1) - λU(j); the ratio is where the maximum
        is, λU'(j) = p, on the branch through j = 1.

        Args:
            p: Pressures, positive under tension, of any shape.

        Returns:
            Three arrays of that shape, not a number where no ratio of the branch has that pressure.
        """
        if self.quadratic:
            compliance = 1 / self.bulk
            return compliance * p**2 / 2, 1 + compliance * p, np.full_like(p, compliance)
        wanted, logarithm = p / self.bulk, np.zeros_like(p)
        # Newton's method in log j, which keeps j positive; the branch ends where U'' = 0.
        with np.errstate(all="ignore"):
            for _ in range(60):
                j = np.exp(logarithm)
                _, first, second = self.derivatives(j)
                step = np.clip((wanted - first) / (second * j), -0.5, 0.5)
                logarithm = logarithm + step
                if not np.nanmax(np.abs(step), initial=0.0) > 1e-15:
                    break
            j = np.exp(logarithm)
            U, first, second = self.derivatives(j)
            found = (np.abs(first - wanted) <= 1e-12 * (1 + np.abs(wanted))) & (second > 0)
        j = np.where(found, j, np.nan)
        return p * (j - 1) - self.bulk * U, j, 1 / (self.bulk * np.where(found, second, np.nan))


def split(energy: Energy) -> Split:
    """The energy as its μ part and a function of the volume ratio.

    Raises:
        MaterialError: If it has no λ part, or one that is not a function of J, or none that resists.
    """
    way_out = 'volume = "neo-hookean-ogden"'
    if not energy.has_lambda:
        raise MaterialError(f"{energy.name}: a mixed element needs a λ part; add one with {way_out}")
    J = ufl.variable(ufl.as_ufl(1.0))
    if not energy.objective or _others(_volume(energy, J)):
        raise MaterialError(f"{energy.name}: a mixed element needs a λ part that is a function of J; use {way_out}")
    at_rest = linearize(energy)
    # A λ of pure rounding is none.
    if not at_rest.lame_lambda > 1e-9 * at_rest.lame_mu:
        raise MaterialError(f"{energy.name}: a mixed element needs nu above 0, got {at_rest.poissons_ratio:g}")
    mu_part, own, _ = shear_part(energy)
    shear = replace(energy, parts=lambda s, v: Parts(mu_part(s, v)), values={**energy.values, **own})
    return Split(shear, at_rest.lame_lambda, lambda J: _volume(energy, J))


class _VolumeRatio(PrincipalStretches):
    """Measures of which only J means something; the others are symbols that can be found in a result."""

    symbols = tuple(ufl.variable(ufl.as_ufl(1.0)) for _ in range(3))

    def __init__(self, J: Scalar) -> None:
        super().__init__(self.symbols)
        self.__dict__["J"] = J

    def power(self, alpha: Scalar) -> "_VolumeRatio":
        return _VolumeRatio(self.J**alpha)


def _volume(energy: Energy, J: Scalar) -> Scalar:
    return energy.parts(_VolumeRatio(J), energy.values).volume


def _others(volume: Scalar) -> bool:
    """Whether an expression holds stretches."""
    return not set(_VolumeRatio.symbols).isdisjoint(unique_pre_traversal(ufl.as_ufl(volume)))
