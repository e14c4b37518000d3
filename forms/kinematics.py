"""Deformation gradient and what an isotropic energy may depend on, as UFL expressions."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import ufl

# A UFL expression or a number; UFL itself is untyped.
Scalar = Any
Tensor = Any


def deformation_gradient(u: Scalar) -> Tensor:
    """F = I + grad u, shape (3, 3).

    Args:
        u: Displacement with 3 components, or 2 for plane strain: the third stretch is then one.
    """
    gradient = ufl.grad(u)
    if len(u) == 2:
        rows = [[gradient[i, 0], gradient[i, 1], 0] for i in range(2)]
        gradient = ufl.as_tensor([*rows, [0, 0, 0]])
    return ufl.Identity(3) + gradient


class PrincipalStretches:
    """Stretch measures made from three principal stretches.

    With UFL variables as stretches, an energy becomes a function that UFL differentiates in stretch space.
    """

    def __init__(self, stretches: Sequence[Scalar]) -> None:
        """From three stretches, numbers or UFL expressions."""
        self.stretches = tuple(stretches)

    @cached_property
    def I1(self) -> Scalar:
        """First invariant of C: the sum of the squared stretches."""
        a, b, c = self.stretches
        return a**2 + b**2 + c**2

    @cached_property
    def I2(self) -> Scalar:
        """Second invariant of C: the sum of the squared area stretches."""
        return sum(area**2 for area in self.areas)

    @cached_property
    def J(self) -> Scalar:
        """Volume ratio, det F."""
        a, b, c = self.stretches
        return a * b * c

    @cached_property
    def areas(self) -> tuple[Scalar, ...]:
        """The three products of two different stretches."""
        a, b, c = self.stretches
        return a * b, b * c, c * a

    @cached_property
    def small_strain(self) -> tuple[Scalar, Scalar]:
        """Of the small strain: tr ε and ε:ε, for a deformation without rotation."""
        return sum(s - 1 for s in self.stretches), sum((s - 1) ** 2 for s in self.stretches)

    def power(self, alpha: Scalar) -> "PrincipalStretches":
        """The measures of the stretches raised to `alpha` (Chen & Barbič, Eq. 16)."""
        return PrincipalStretches([s**alpha for s in self.stretches])


class GradientMeasures(PrincipalStretches):
    """Stretch measures made from F: invariants directly, stretches only when an energy asks for them."""

    def __init__(self, F: Tensor) -> None:
        """From the deformation gradient, shape (3, 3)."""
        self.F = F

    @cached_property
    def C(self) -> Tensor:
        """Right Cauchy-Green tensor, shape (3, 3)."""
        return self.F.T * self.F

    @cached_property
    def I1(self) -> Scalar:
        """First invariant of C."""
        return ufl.inner(self.F, self.F)

    @cached_property
    def I2(self) -> Scalar:
        """Second invariant of C."""
        return (self.I1**2 - ufl.inner(self.C, self.C)) / 2

    @cached_property
    def J(self) -> Scalar:
        """Volume ratio, det F."""
        return ufl.det(self.F)

    @cached_property
    def stretches(self) -> tuple[Scalar, ...]:  # type: ignore[override]
        """Square roots of the eigenvalues of C."""
        return tuple(ufl.sqrt(value) for value in eigenvalues(self.C))

    @cached_property
    def small_strain(self) -> tuple[Scalar, Scalar]:
        """Of ε = sym F - I: tr ε and ε:ε."""
        strain = ufl.sym(self.F) - ufl.Identity(3)
        return ufl.tr(strain), ufl.inner(strain, strain)

    @property
    def uses_eigenvalues(self) -> bool:
        """Whether the energy built from these measures asked for the stretches."""
        return "stretches" in self.__dict__

    def power(self, alpha: Scalar) -> PrincipalStretches:
        """The measures of the stretches raised to `alpha`; J alone needs no eigenvalues."""
        return _PoweredGradient(self, alpha)


class _PoweredGradient(PrincipalStretches):
    """Measures of the stretches of F raised to a power, made only when an energy asks for them."""

    def __init__(self, base: GradientMeasures, alpha: Scalar) -> None:
        self.base = base
        self.alpha = alpha

    @cached_property
    def stretches(self) -> tuple[Scalar, ...]:  # type: ignore[override]
        return tuple(s**self.alpha for s in self.base.stretches)

    @cached_property
    def J(self) -> Scalar:
        return self.base.J**self.alpha


def eigenvalues(A: Tensor) -> tuple[Scalar, ...]:
    """The eigenvalues of a symmetric tensor of shape (3, 3), ascending, in closed form.

    Their derivatives are right only where the three are distinct: at repeated eigenvalues the closed form is
    not differentiable although every symmetric function of it is. The compiled kernel has no such limit.
    """
    mean = ufl.tr(A) / 3
    B = A - mean * ufl.Identity(3)
    # The shift keeps the square root differentiable at A = mean I; it is far below rounding elsewhere.
    p = ufl.sqrt(ufl.inner(B, B) / 6 + 1e-30)
    r = ufl.det(B) / (2 * p**3)
    limit = 1 - 1e-15
    r = ufl.conditional(ufl.gt(r, limit), limit, ufl.conditional(ufl.lt(r, -limit), -limit, r))
    angle = ufl.acos(r) / 3
    return tuple(mean + 2 * p * ufl.cos(angle + shift * ufl.pi / 3) for shift in (2, 4, 0))
