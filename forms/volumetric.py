"""ψ as a μ part and λ/2 θ(J)²: what a pressure field needs to know of an energy."""

from dataclasses import dataclass, replace

import numpy as np
import ufl
from ufl import classes
from ufl.corealg.traversal import unique_pre_traversal

from forms.energy import Energy, MaterialError, Parts, Values
from forms.kinematics import PrincipalStretches, Scalar, as_numpy, evaluate
from forms.normalize import linearize
from forms.tuning import shear_part

# Where the square root of an energy that vanishes at J = 1 gives way to a polynomial, fitted on twice the range.
_NEAR, _DEGREE = 0.05, 12


@dataclass(frozen=True)
class Split:
    """ψ = W + λ/2 θ(J)², with no λ left in W at rest and θ(J) ≈ J - 1 near there.

    Any energy U(J) of the volume ratio is a square, of θ = ±√(2U); a Lagrangian with p = λθ for its pressure
    then has the same quadratic form in p for all of them, and a finite limit as λ grows: θ = 0 in the mean.

    Attributes:
        energy: ψ.
        shear: W as an energy of its own.
        bulk: λ_Lamé, infinite at ν = 0.5.
    """

    energy: Energy
    shear: Energy
    bulk: float

    def strain(self, J: Scalar, values: Values | None = None) -> Scalar:
        """θ(J).

        Args:
            J: Volume ratio, a UFL expression.
            values: Replaces the energy's values, e.g. by UFL constants.
        """
        volume = _volume(self.energy, J, self.energy.values if values is None else values)
        at_one = ufl.variable(ufl.as_ufl(1.0))
        root = _root(volume)
        if root is None:
            return _signed_root(self.energy, J, volume)
        slope = ufl.diff(_root(_volume(self.energy, at_one, self.energy.values)), at_one)
        return root if evaluate(slope) > 0 else -root


def split(energy: Energy) -> Split:
    """The energy as its μ part and the square of a volume strain.

    Raises:
        MaterialError: If it has no λ part, or one that is not a function of J, or none that resists.
    """
    way_out = 'volume = "neo-hookean-ogden"'
    if not energy.has_lambda:
        raise MaterialError(f"{energy.name}: a mixed element needs a λ part; add one with {way_out}")
    J = ufl.variable(ufl.as_ufl(1.0))
    if not energy.objective or _others(_volume(energy, J, energy.values)):
        raise MaterialError(f"{energy.name}: a mixed element needs a λ part that is a function of J; use {way_out}")
    bulk = linearize(energy).lame_lambda
    if not bulk > 0:
        raise MaterialError(f"{energy.name}: a mixed element needs nu above 0, got λ_Lamé = {bulk:g}")
    mu_part, own, _ = shear_part(energy)
    values = {**energy.values, **own}
    return Split(energy, replace(energy, parts=lambda s, v: Parts(mu_part(s, v)), values=values), bulk)


class _VolumeRatio(PrincipalStretches):
    """Measures of which only J means something; the others are symbols that can be found in a result."""

    symbols = tuple(ufl.variable(ufl.as_ufl(1.0)) for _ in range(3))

    def __init__(self, J: Scalar) -> None:
        super().__init__(self.symbols)
        self.__dict__["J"] = J

    def power(self, alpha: Scalar) -> "_VolumeRatio":
        return _VolumeRatio(self.J**alpha)


def _volume(energy: Energy, J: Scalar, values: Values) -> Scalar:
    return energy.parts(_VolumeRatio(J), values).volume


def _others(volume: Scalar) -> bool:
    """Whether an expression holds stretches."""
    return not set(_VolumeRatio.symbols).isdisjoint(unique_pre_traversal(ufl.as_ufl(volume)))


def _root(U: Scalar) -> Scalar | None:
    """θ with θ²/2 = U up to its sign, where U is written as products of squares; otherwise None."""
    root = _square_root(ufl.as_ufl(U))
    return None if root is None else np.sqrt(2) * root


def _square_root(x: Scalar) -> Scalar | None:
    if isinstance(x, classes.RealValue):
        return np.sqrt(float(x))
    if isinstance(x, classes.Power):
        base, exponent = x.ufl_operands
        even = isinstance(exponent, classes.RealValue) and float(exponent) % 2 == 0
        return base ** int(float(exponent) / 2) if even else None
    if isinstance(x, classes.Product | classes.Division):
        a, b = (_square_root(operand) for operand in x.ufl_operands)
        if a is None or b is None:
            return None
        return a * b if isinstance(x, classes.Product) else a / b
    return None


def _signed_root(energy: Energy, J: Scalar, U: Scalar) -> Scalar:
    """±√(2U), about J = 1 by a polynomial: the root's own derivatives are 0/0 there."""
    at = ufl.variable(ufl.as_ufl(1.0))
    function = as_numpy([_volume(energy, at, energy.values)], [at])
    # An even number of nodes keeps away from the centre.
    nodes = 2 * _NEAR * np.cos(np.pi * (np.arange(2 * _DEGREE) + 0.5) / (2 * _DEGREE))
    ratio = np.sqrt(2 * function(1 + nodes)[0]) / np.abs(nodes)
    coefficients = np.polynomial.Polynomial.fit(nodes, ratio, _DEGREE).convert().coef
    e = J - 1
    near: Scalar = 0.0
    for coefficient in reversed(coefficients):
        near = near * e + float(coefficient)
    return ufl.conditional(ufl.lt(abs(e), _NEAR), e * near, ufl.sign(e) * ufl.sqrt(2 * U))
