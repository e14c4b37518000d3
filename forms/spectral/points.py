"""The kernel at single points: ψ, P and ∂P/∂F for arrays of displacement gradients."""

import ctypes

import numpy as np

from elastune.forms.energy import Energy
from elastune.forms.spectral import build, density
from elastune.forms.spectral.assembly import FILTERS, check_extension
from elastune.forms.spectral.build import SpectralError

_MACROS = '#define LANES 8\n#define DIM 3\n#include "lanes.h"\n'


def pointwise(
    energy: Energy, H: np.ndarray, extension: float | None = None, filter: str = "none"
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """ψ, P and ∂P/∂F at displacement gradients, by the code that assembles the forms.

    Args:
        energy: Any energy.
        H: F - I, H[:, i, j] = ∂u_i/∂X_j, shape (n, 3, 3).
        extension: See `SpectralForms`.
        filter: See `SpectralForms.filter`.

    Returns:
        ψ of shape (n,), P of shape (n, 3, 3), ∂P/∂F of shape (n, 9, 9) with rows and columns 3i + j.

    Raises:
        SpectralError: If the filter, the threshold or the shape of H is impossible.
    """
    psi, P, D = _evaluated(energy, H, extension, filter, second=True)
    return psi, P, D


def stress(energy: Energy, H: np.ndarray, extension: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """ψ and P alone, see `pointwise`, whose second derivatives are most of its work.

    Raises:
        SpectralError: If the threshold or the shape of H is impossible.
    """
    psi, P, _ = _evaluated(energy, H, extension, "none", second=False)
    return psi, P


def _evaluated(
    energy: Energy, H: np.ndarray, extension: float | None, filter: str, second: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    gradients = np.ascontiguousarray(H, dtype=np.float64)
    if gradients.ndim != 3 or gradients.shape[1:] != (3, 3):
        raise SpectralError(f"H: expected shape (n, 3, 3), got {gradients.shape}")
    if filter not in FILTERS:
        raise SpectralError(f"filter: expected one of {', '.join(FILTERS)}, got {filter!r}")
    check_extension(energy, extension)
    extended = extension is not None
    key = density.signature(energy, extended)
    library = build.load("pointwise.c", key, lambda: f"{_MACROS}{density.code(energy, extended)}")
    n = len(gradients)
    psi, P, D = np.empty(n), np.empty((n, 3, 3)), np.empty((n if second else 0, 9, 9))
    constants = np.array([*energy.constants(), FILTERS.index(filter), extension or 0.0])
    arrays = [ctypes.c_void_p(array.ctypes.data) for array in (gradients, constants, psi, P)]
    library.pointwise(ctypes.c_int64(n), *arrays, ctypes.c_void_p(D.ctypes.data if second else None))
    return psi, P, D
