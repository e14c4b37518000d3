"""What a field is at a point, by name."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


class Samples:
    """The state at n points; what is derived from it is computed when first asked for.

    Attributes:
        H: Displacement gradients, shape (n, 3, 3).
    """

    def __init__(self, H: Array, respond: Callable[[Array], tuple[Array, Array]]) -> None:
        """Takes the state.

        Args:
            H: Displacement gradients, shape (n, 3, 3).
            respond: ψ, shape (n,), and P, shape (n, 3, 3), from H.
        """
        self.H = H
        self._respond = respond

    @cached_property
    def F(self) -> Array:
        """Deformation gradient, shape (n, 3, 3)."""
        return np.eye(3) + self.H

    @cached_property
    def J(self) -> Array:
        """Volume ratio, shape (n,)."""
        return np.linalg.det(self.F)

    @cached_property
    def response(self) -> tuple[Array, Array]:
        """ψ, shape (n,), and the first Piola-Kirchhoff stress, shape (n, 3, 3)."""
        return self._respond(self.H)

    @cached_property
    def cauchy(self) -> Array:
        """Cauchy stress P Fᵀ / J, shape (n, 3, 3)."""
        return self.response[1] @ self.F.transpose(0, 2, 1) / self.J[:, None, None]


CELL_FIELDS: dict[str, Callable[[Samples], Array]] = {}


def _cell_field(function: Callable[[Samples], Array]) -> Callable[[Samples], Array]:
    CELL_FIELDS[function.__name__] = function
    return function


@_cell_field
def J(at: Samples) -> Array:
    """Volume ratio; the average over a cell is its deformed over its rest volume."""
    return at.J


@_cell_field
def von_mises(at: Samples) -> Array:
    """Von Mises stress of the Cauchy stress."""
    mean = np.trace(at.cauchy, axis1=1, axis2=2) / 3
    deviator = at.cauchy - mean[:, None, None] * np.eye(3)
    return np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))


@_cell_field
def max_principal(at: Samples) -> Array:
    """Largest principal Cauchy stress."""
    return _symmetric(np.linalg.eigvalsh, at.cauchy)[:, -1]


@_cell_field
def pressure(at: Samples) -> Array:
    """Minus the mean of the Cauchy stress's diagonal."""
    return -np.trace(at.cauchy, axis1=1, axis2=2) / 3


@_cell_field
def stretches(at: Samples) -> Array:
    """Principal stretches, largest first; the last is negative where the cell is inverted."""
    values = np.linalg.svd(at.F, compute_uv=False)
    values[:, 2] = np.copysign(values[:, 2], at.J)
    return values


@_cell_field
def energy(at: Samples) -> Array:
    """Strain energy per rest volume."""
    return at.response[0]


@_cell_field
def stress(at: Samples) -> Array:
    """Cauchy stress, 3 by 3."""
    return at.cauchy


@_cell_field
def pk1(at: Samples) -> Array:
    """First Piola-Kirchhoff stress, 3 by 3: force per area at rest."""
    return at.response[1]


@_cell_field
def log_strain(at: Samples) -> Array:
    """Logarithmic strain log(FFᵀ)/2 of the deformed body, 3 by 3; not a number where it is collapsed."""
    squares, directions = np.linalg.eigh(at.F @ at.F.transpose(0, 2, 1))
    logarithms = np.log(np.where(squares > 0, squares, np.nan)) / 2
    return np.einsum("nia,na,nja->nij", directions, logarithms, directions)


def _symmetric(function: Callable[[Array], Array], values: Array) -> Array:
    """Of matrices, which may have entries that are no numbers, for which LAPACK would raise."""
    finite = np.isfinite(values).all(axis=(1, 2))
    found = function(np.where(finite[:, None, None], values, 0.0))
    found[~finite] = np.nan
    return found
