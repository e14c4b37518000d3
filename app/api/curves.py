"""Materials in Python, in homogeneous tests."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from elastune.app.tuning.response import Curve, respond
from elastune.forms.energy import Energy, MaterialError

Array = NDArray[np.float64]


class Curves:
    """What a material's tests measure; at constant volume at ν = 0.5.

    Attributes:
        energy: Its strain-energy density.
    """

    energy: Energy

    def uniaxial(self, stretches: ArrayLike) -> tuple[Array, Array]:
        """Nominal stress and lateral stretch of a bar pulled along one axis and free at its sides.

        Args:
            stretches: Positive stretches along the axis, shape (n,).

        Returns:
            Two arrays of shape (n,), not a number beyond the end of the branch that begins at rest.

        Raises:
            MaterialError: If a stretch is not positive.
        """
        return self._tested("uniaxial", stretches)

    def equibiaxial(self, stretches: ArrayLike) -> tuple[Array, Array]:
        """Nominal stress and thickness of a sheet pulled alike along two axes; see `uniaxial`."""
        return self._tested("equibiaxial", stretches)

    def planar(self, stretches: ArrayLike) -> tuple[Array, Array]:
        """Nominal stress and thickness of a wide strip whose width is held: pure shear; see `uniaxial`."""
        return self._tested("planar", stretches)

    def biaxial(self, first: ArrayLike, second: ArrayLike) -> tuple[Array, Array]:
        """The two nominal stresses, shape (2, n), and thickness of a sheet stretched along two axes; see `uniaxial`."""
        return self._tested("biaxial", [np.atleast_1d(first), np.atleast_1d(second)])

    def shear(self, amounts: ArrayLike) -> Array:
        """Shear stress of simple shear, F = I + γ e₁⊗e₂, at amounts γ of shape (n,)."""
        return self._tested("shear", amounts).stress

    def volumetric(self, ratios: ArrayLike) -> Array:
        """Mean stress, minus the pressure, of a body that changes its volume alone, at ratios J of shape (n,).

        Raises:
            MaterialError: If the material is incompressible, or a ratio is not positive.
        """
        return self._tested("volumetric", ratios).stress

    def _tested(self, test: str, loads: ArrayLike) -> Curve:
        try:
            return respond(self.energy, test, loads)
        except MaterialError as error:
            raise MaterialError(f"{self.energy.name}: {str(error).removeprefix(f'{self.energy.name}: ')}") from None
