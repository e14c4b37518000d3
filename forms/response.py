"""ψ, P and ∂P/∂F of any energy at arrays of displacement gradients."""

import numpy as np
from numpy.typing import NDArray

from elastune.forms.energy import Energy
from elastune.forms.normalize import linearize
from elastune.forms.spectral import pointwise, stress

Array = NDArray[np.float64]


def first(energy: Energy, H: Array, extension: float | None = None) -> tuple[Array, Array]:
    """ψ, shape (n,), and the first Piola-Kirchhoff stress, shape (n, 3, 3).

    Args:
        energy: Any energy.
        H: F - I, H[:, i, j] = ∂u_i/∂X_j, shape (n, 3, 3).
        extension: Stretch below which a singular energy is continued.
    """
    if energy.objective:
        return stress(energy, H, extension)
    P = np.einsum("ijkl,nkl->nij", _linear(energy), H)
    return np.einsum("nij,nij->n", P, H) / 2, P


def second(energy: Energy, H: Array) -> tuple[Array, Array, Array]:
    """The same with ∂P/∂F, shape (n, 9, 9), rows and columns 3i + j."""
    if energy.objective:
        return pointwise(energy, H)
    return *first(energy, H), np.tile(_linear(energy).reshape(9, 9), (len(H), 1, 1))


def _linear(energy: Energy) -> Array:
    """The stiffness at rest: of the energies of the small strain there is one, the quadratic."""
    at_rest, eye = linearize(energy), np.eye(3)
    symmetric = np.einsum("ik,jl->ijkl", eye, eye) + np.einsum("il,jk->ijkl", eye, eye)
    return at_rest.lame_lambda * np.einsum("ij,kl->ijkl", eye, eye) + at_rest.lame_mu * symmetric
