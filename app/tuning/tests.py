"""Homogeneous tests of a material: uniaxial, equibiaxial, planar, biaxial, simple shear and volumetric."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from numpy.typing import ArrayLike, NDArray

from elastune.forms.energy import MaterialError
from elastune.forms.kinematics import Scalar

Array = NDArray[np.float64]
Triple = tuple[Scalar, Scalar, Scalar]


@dataclass(frozen=True)
class Test:
    """A homogeneous deformation whose loads are given and whose free stretch finds its balance.

    Attributes:
        name: What people call it.
        loads: Names of what is given: stretches, an amount of shear γ, or the volume ratio J.
        stretches: The three principal stretches of the loads and of the free stretch, UFL expressions.
        free: The free stretch at constant volume, a function of the loads; None where no stretch is free.
        share: Directions that share the work, and so the stress, of one load.
        log: Whether a load is one at rest, and followed by its logarithm; else it is zero there.
    """

    name: str
    loads: tuple[str, ...]
    stretches: Callable[[Sequence[Scalar], Scalar], Triple]
    free: Callable[[Sequence[Scalar]], Scalar] | None
    share: int = 1
    log: bool = True

    def __str__(self) -> str:
        return self.name

    def check(self, loads: ArrayLike) -> Array:
        """The loads as an array of shape (loads, n).

        Args:
            loads: Shape (n,), or (loads, n) with several.

        Raises:
            MaterialError: If they have another shape, or a stretch or volume ratio is not positive.
        """
        try:
            given = np.atleast_1d(np.asarray(loads, dtype=np.float64))
        except (TypeError, ValueError) as error:
            raise MaterialError(f"{self}: expected numbers: {error}") from None
        given = given[None] if given.ndim == 1 and len(self.loads) == 1 else given
        if given.ndim != 2 or len(given) != len(self.loads):
            raise MaterialError(f"{self}: expected {' and '.join(self.loads)} of one shape (n,), got {given.shape}")
        wrong = ~np.isfinite(given) | (given <= 0 if self.log else False)
        if wrong.any():
            expected = "positive stretches" if self.log else "finite numbers"
            raise MaterialError(f"{self}: expected {expected}, got {given[wrong][0]:g}")
        return given


def _sheared(loads: Sequence[Scalar], free: Scalar) -> Triple:
    """F = I + γ e₁⊗e₂: λ - 1/λ = γ."""
    stretch = loads[0] / 2 + ufl.sqrt(1 + loads[0] ** 2 / 4)
    return stretch, 1 / stretch, 1.0


TESTS = {
    test.name: test
    for test in (
        Test("uniaxial", ("stretch",), lambda x, w: (x[0], w, w), lambda x: x[0] ** -0.5),
        Test("equibiaxial", ("stretch",), lambda x, w: (x[0], x[0], w), lambda x: x[0] ** -2, share=2),
        # Also called pure shear: a wide strip, whose width its grips hold.
        Test("planar", ("stretch",), lambda x, w: (x[0], 1.0, w), lambda x: 1 / x[0]),
        Test("biaxial", ("stretch_1", "stretch_2"), lambda x, w: (x[0], x[1], w), lambda x: 1 / (x[0] * x[1])),
        Test("shear", ("shear",), _sheared, None, log=False),
        Test("volumetric", ("volume_ratio",), lambda x, w: (x[0] ** (1 / 3),) * 3, None),
    )
}
