"""Smith et al.'s closed form against numerical eigenvalues and against the kernel."""

from collections.abc import Callable

import numpy as np
import pytest

from elastune.forms import materials
from elastune.forms.spectral import eigensystem, pointwise
from elastune.forms.spectral.eigensystem import Coefficients

RANDOM = np.random.default_rng(0).normal(size=(40, 3, 3))
# Where a printed eigenvector vanishes, roots coincide, or η and ρ diverge.
SPECIAL = [
    np.eye(3),
    2 * np.eye(3),
    -np.eye(3),
    np.diag([2.0, 2.0, 3.0]),
    np.diag([2.0, 2.0, -3.0]),
    np.diag([2.0, -2.0, 3.0]),
    np.diag([1.5, 1.0, 1.0]),
    np.diag([1.0, 1.0, 0.0]),
    np.diag([1.0, 0.0, 0.0]),
    np.zeros((3, 3)),
    # J = α of the default stable neo-Hookean: γ_H = 0.
    np.diag([1.5, 1.0, 1.0]),
    np.diag([1.0, 1.0, 1.5]) + 1e-9,
]
MODELS: dict[str, Callable[..., Coefficients]] = {
    "stable-neo-hookean": eigensystem.stable_neo_hookean,
    "stable-neo-hookean-barrier": eigensystem.stable_neo_hookean_barrier,
    "fung": eigensystem.fung,
    "arruda-boyce": eigensystem.arruda_boyce,
}


@pytest.mark.parametrize("name", MODELS)
def test_eigensystem(name: str) -> None:
    """It diagonalises Eq. 52, which is the kernel's tangent; also where the printed vectors vanish."""
    energy = materials.make(name)
    for F in [*SPECIAL, *RANDOM]:
        c = MODELS[name](F, *energy.constants())
        A = eigensystem.hessian(F, c)
        values, modes = eigensystem.eigensystem(F, c)
        Q = modes.reshape(9, 9)
        size = max(np.linalg.norm(A), 1e-3)
        assert np.abs(Q @ Q.T - np.eye(9)).max() <= 1e-14
        assert np.abs(Q.T @ np.diag(values) @ Q - A).max() <= 1e-14 * size
        assert np.abs(np.sort(values) - np.linalg.eigvalsh(A)).max() <= 1e-14 * size
        tangent = pointwise(energy, (F - np.eye(3))[None])[2][0]
        assert np.abs(tangent - A).max() <= 1e-14 * size


@pytest.mark.parametrize("name", MODELS)
def test_equation_42(name: str) -> None:
    """The three eigenvalues in the plane of the stretches are the roots of the cubic."""
    for F in [*SPECIAL, *RANDOM]:
        c = MODELS[name](F, *materials.make(name).constants())
        roots = eigensystem.eigensystem(F, c)[0][:3] - c.identity
        size = max(1.0, np.abs(roots).max())
        assert np.abs(np.polyval(eigensystem.cubic(F, c), roots)).max() <= 1e-13 * size**3


@pytest.mark.parametrize("name", MODELS)
def test_equation_44(name: str) -> None:
    """The printed vector, with the sign corrected, is an eigenvector where it does not vanish."""
    for F in RANDOM:
        c = MODELS[name](F, *materials.make(name).constants())
        U, s, V = eigensystem.signed_svd(F)
        A = eigensystem.hessian(F, c)
        for value in eigensystem.eigensystem(F, c)[0][:3]:
            root = (value - c.identity) / c.hessian
            d = eigensystem.printed_vector(s, root, c.stretch / c.hessian, c.gradient / c.hessian)
            q = (U @ np.diag(d / np.linalg.norm(d)) @ V.T).ravel()
            assert np.linalg.norm(A @ q - value * q) <= 1e-9 * np.linalg.norm(A)


def test_printed_vector_vanishes_at_equal_stretches() -> None:
    """Why the module takes another column of the adjugate."""
    s = np.array([2.0, 2.0, 3.0])
    assert np.abs(eigensystem.printed_vector(s, -3.0, 0.0, 0.0)).max() == 0
    assert np.abs(eigensystem.eigensystem(np.diag(s), Coefficients(0, 0, 0, 1.0))[1]).max() > 0


def test_volume_hessian() -> None:
    """Eq. 33 gives the eigenvalues of ∂²J/∂F² that Eq. 32 leaves out."""
    for F in RANDOM:
        values = eigensystem.eigensystem(F, Coefficients(0, 0, 0, 1.0))[0]
        assert np.abs(np.sort(values[:3]) - np.sort(eigensystem.volume_roots(F))).max() <= 1e-13
        _, s, _ = eigensystem.signed_svd(F)
        assert np.array_equal(values[3:], [*s, *(-s)])
