"""The closed-form eigensystem of energies in I_C and J (Smith, de Goes & Kim 2018, Section 4, Appendices A and D).

For reading and for checking the compiled kernel, which needs no closed form. Any energy whose Hessian is

    A = γ_I I + γ_F f fᵀ + γ_G g gᵀ + γ_H H      (Eq. 52)

with f = vec F, g = vec ∂J/∂F and H = ∂²J/∂F² is covered. With F = U Σ Vᵀ, U and V rotations, six eigenvectors are
fixed (Eq. 62), three are U diag(d) Vᵀ with d from a 3×3 problem whose characteristic polynomial is Eq. 42.
Equations are those of the paper as corrected: the sign in α₁ of Eq. 44, the factor in Fung's exponent.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Coefficients:
    """γ_I, γ_F, γ_G and γ_H of Eq. 52 at one deformation."""

    identity: float
    stretch: float
    gradient: float
    hessian: float


def stable_neo_hookean(F: Array, lam: float, mu: float) -> Coefficients:
    """Eq. 65, for ψ = μ/2 (I_C - 3) - μ (J - 1) + λ/2 (J - 1)²."""
    return Coefficients(mu, 0.0, lam, lam * (np.linalg.det(F) - 1) - mu)


def stable_neo_hookean_barrier(F: Array, lam: float, mu: float) -> Coefficients:
    """Eq. 41 with α = 1 + 3μ/(4λ)."""
    ic, J = _invariants(F)
    return Coefficients(mu * (1 - 1 / (ic + 1)), 2 * mu / (ic + 1) ** 2, lam, lam * (J - 1) - 3 * mu / 4)


def fung(F: Array, lam: float, mu0: float, gamma: float, mu1: float) -> Coefficients:
    """Eq. 55 with α = 1 + (μ₀ + γμ₁)/λ and the exponent μ₁ (I_C - 3), without which Eqs. 54-56 do not hold."""
    ic, J = _invariants(F)
    growth = gamma * mu1 * np.exp(mu1 * (ic - 3))
    return Coefficients(mu0 + growth, 2 * mu1 * growth, lam, lam * (J - 1) - mu0 - gamma * mu1)


def arruda_boyce(F: Array, lam: float, mu: float, beta1: float, beta2: float) -> Coefficients:
    """Eq. 60 with α = 1 + μ (1 + 3β₁ + 9β₂)/λ."""
    ic, J = _invariants(F)
    return Coefficients(
        mu * (1 + beta1 * ic + beta2 * ic**2),
        2 * mu * (beta1 + 2 * beta2 * ic),
        lam,
        lam * (J - 1) - mu * (1 + 3 * beta1 + 9 * beta2),
    )


def signed_svd(F: Array) -> tuple[Array, Array, Array]:
    """U, σ and V of F = U diag(σ) Vᵀ, U and V rotations, the sign of an inverted F on the smallest σ (Eq. 2)."""
    U, sigma, Vt = np.linalg.svd(F)
    for matrix in (U, Vt.T):
        if np.linalg.det(matrix) < 0:
            matrix[:, 2] *= -1
            sigma[2] *= -1
    return U, sigma, Vt.T


def volume_roots(F: Array) -> Array:
    """Eq. 33: the three eigenvalues of ∂²J/∂F² that are roots of Eq. 30; defined for F ≠ 0, shape (3,)."""
    ic, J = _invariants(F)
    angle = np.arccos(np.clip(3 * J / ic * np.sqrt(3 / ic), -1, 1))
    return 2 * np.sqrt(ic / 3) * np.cos((angle + 2 * np.pi * np.arange(3)) / 3)


def cubic(F: Array, c: Coefficients) -> Array:
    """Eq. 42 for γ_H ε̄ in place of ε̄: coefficients from the cube down, shape (4,).

    η = γ_F/γ_H and ρ = γ_G/γ_H diverge at γ_H = 0, which is J = α; multiplied out nothing does.
    """
    ic, J = _invariants(F)
    _, s, _ = signed_svd(F)
    g2 = (s[0] * s[1]) ** 2 + (s[0] * s[2]) ** 2 + (s[1] * s[2]) ** 2
    eta, rho, h = c.stretch, c.gradient, c.hessian
    c2 = -g2 * rho - ic * eta
    c1 = -(h + 2 * J * rho) * h * ic - 6 * J * eta * h + (g2 * ic - 9 * J**2) * rho * eta
    c0 = -(2 * h + 3 * J * rho) * h**2 * J + (ic**2 - 4 * g2) * eta * h**2 + 2 * J * (ic**2 - 3 * g2) * rho * eta * h
    return np.array([1.0, c2, c1, c0])


def printed_vector(s: Array, root: float, eta: float, rho: float) -> Array:
    """(α₀, α₁, α₂) of Eq. 44, not normalised; η = 0 gives Eq. 67, and ρ = 0 besides Eq. 40.

    It is the third column of an adjugate, and zero where the eigenvector's third entry is, such as for σ₀ = σ₁.

    Args:
        s: Signed singular values, shape (3,).
        root: ε̄ of Eq. 42.
        eta: γ_F/γ_H.
        rho: γ_G/γ_H.
    """
    a, b, c = s
    J = a * b * c
    return np.array(
        [
            root * (b + a * c * eta + J * b * rho)
            + a * c
            + b * (a**2 - b**2 + c**2) * eta
            + J * a * c * rho
            + a * (a**2 - b**2) * c * (b**2 - c**2) * rho * eta,
            root * (a + b * c * eta + J * a * rho)
            + b * c
            - a * (a**2 - b**2 - c**2) * eta
            + J * b * c * rho
            - b * (a**2 - b**2) * c * (a**2 - c**2) * rho * eta,
            root**2
            - root * (a**2 + b**2) * (eta + c**2 * rho)
            - c**2
            - 2 * J * eta
            - 2 * J * c**2 * rho
            + ((a**2 - b**2) * c) ** 2 * rho * eta,
        ]
    )


def eigensystem(F: Array, c: Coefficients) -> tuple[Array, Array]:
    """Nine eigenvalues and eigenvectors of Eq. 52, right at every F, F = I and F = 0 included.

    Args:
        F: Deformation gradient, shape (3, 3).
        c: Coefficients at F.

    Returns:
        Eigenvalues of shape (9,), in the order of Eqs. 45-48, and orthonormal Q_k of shape (9, 3, 3).
    """
    U, s, V = signed_svd(F)
    inner, diagonal = _diagonal_modes(s, c)
    values = np.concatenate([inner, c.hessian * s, -c.hessian * s]) + c.identity
    D = np.zeros((9, 3, 3))
    for k in range(3):
        D[k] = np.diag(diagonal[k])
        i, j = [(1, 2), (0, 2), (0, 1)][k]
        # Eq. 62: the pseudo-cross-products, then their symmetric counterparts.
        D[3 + k, i, j], D[3 + k, j, i] = 1 / np.sqrt(2), -1 / np.sqrt(2)
        D[6 + k, i, j], D[6 + k, j, i] = 1 / np.sqrt(2), 1 / np.sqrt(2)
    return values, U @ D @ V.T


def hessian(F: Array, c: Coefficients) -> Array:
    """Eq. 52 itself, shape (9, 9), rows and columns 3i + j: what the eigensystem must multiply out to."""
    g: Array = np.cross(np.roll(F, -1, axis=1), np.roll(F, -2, axis=1), axis=0)
    levi = np.zeros((3, 3, 3))
    for i in range(3):
        levi[i, (i + 1) % 3, (i + 2) % 3], levi[i, (i + 2) % 3, (i + 1) % 3] = 1, -1
    # ∂²J/∂F_iJ∂F_kL = ε_ikm ε_JLN F_mN.
    H = np.einsum("ikm,jln,mn->ijkl", levi, levi, F).reshape(9, 9)
    f, g = F.ravel(), g.ravel()
    return c.identity * np.eye(9) + c.stretch * np.outer(f, f) + c.gradient * np.outer(g, g) + c.hessian * H


def _invariants(F: Array) -> tuple[float, float]:
    return float(np.sum(F * F)), float(np.linalg.det(F))


def _diagonal_modes(s: Array, c: Coefficients) -> tuple[Array, Array]:
    """Eigenvalues less γ_I and unit vectors d of the three eigenvectors U diag(d) Vᵀ.

    A column of the adjugate of M - ε, of which Eq. 44 is the third, is an eigenvector unless it vanishes. The
    longest column serves for the root farthest from the others; these two are a 2×2 problem normal to it, which
    has a closed form also where they coincide.
    """
    g = np.array([s[1] * s[2], s[0] * s[2], s[0] * s[1]])
    H = np.array([[0, s[2], s[1]], [s[2], 0, s[0]], [s[1], s[0], 0]])
    M = c.stretch * np.outer(s, s) + c.gradient * np.outer(g, g) + c.hessian * H
    mean = np.trace(M) / 3
    B = M - mean * np.eye(3)
    p = np.sqrt(np.sum(B * B) / 6)
    if p == 0:
        return np.full(3, mean), np.eye(3)
    # Eq. 42 in trigonometric form; its root of largest size about the mean is the one farthest from the others.
    r = np.clip(np.linalg.det(B / p) / 2, -1, 1)
    far = mean + np.copysign(2 * p * np.cos(np.arccos(abs(r)) / 3), r)
    A = M - far * np.eye(3)
    columns = np.array([np.cross(A[(i + 1) % 3], A[(i + 2) % 3]) for i in range(3)])
    first = max(columns, key=np.linalg.norm)
    first = first / np.linalg.norm(first)
    other = np.cross(first, np.eye(3)[np.argmin(np.abs(first))])
    other /= np.linalg.norm(other)
    basis = np.array([other, np.cross(first, other)])
    (a, b), (_, d) = basis @ M @ basis.T
    angle = np.arctan2(2 * b, a - d) / 2
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    vectors = np.vstack([first, turn @ basis])
    return np.einsum("ki,ij,kj->k", vectors, M, vectors), vectors
