"""The least eigenvalue of a pencil of two symmetric operators."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Operator = Callable[[Array], Array]

# Iterations, at most and at least; how much of the eigenvalue its error may be, and what is zero.
LONGEST, SHORTEST, ACCURACY, ZERO = 300, 4, 0.2, 2e-5


def least(
    K: Operator,
    M: Operator,
    P: Operator,
    start: Array,
    dot: Callable[[Array, Array], float],
    accuracy: float = ACCURACY,
) -> tuple[float, Array]:
    """The least eigenvalue of K x = θ M x, to a digit unless asked for more, and its vector.

    By the locally optimal conjugate gradient method (Knyazev 2001, SIAM J. Sci. Comput. 23:517). SLEPc has it too, but
    tests residuals by their Euclidean norm, in which those of soft modes drown in those of stiff ones; here it is the
    norm of P, which bounds the error of θ. A Rayleigh quotient below zero is a proof by itself.

    Args:
        K: Symmetric.
        M: Symmetric and positive definite.
        P: Near the inverse of M or K.
        start: With a share of the vector that is looked for.
        dot: Inner product over all ranks.
        accuracy: How much of the eigenvalue its error may be.

    Returns:
        θ, and the vector with xᵀ M x = 1.
    """
    basis, previous = [start], np.inf
    for iteration in range(LONGEST):
        x, Kx, Mx, theta, direction = _ritz(basis, K, M, dot)
        residual = Kx - theta * Mx
        correction = P(residual)
        error = np.sqrt(abs(dot(residual, correction)))
        settled = previous < 0 and abs(theta - previous) <= 5e-3 * accuracy * abs(theta)
        if iteration >= SHORTEST and (settled or error <= max(accuracy * abs(theta), ZERO)):
            break
        previous = theta
        basis = [x, correction, *([] if direction is None else [direction])]
    return theta, x


def _ritz(
    basis: list[Array], K: Operator, M: Operator, dot: Callable[[Array, Array], float]
) -> tuple[Array, Array, Array, float, Array | None]:
    """The best vector in the span of some: itself, its images, its quotient, and its part outside the first one."""
    vectors: list[tuple[Array, Array, Array]] = []
    for v in basis:
        for _ in range(2):
            # Twice is enough, also for directions that are nearly the same.
            for w, _, Mw in vectors:
                v = v - dot(Mw, v) * w
        Mv = M(v)
        size = dot(v, Mv)
        if size > 0 and np.isfinite(size):
            v, Mv = v / np.sqrt(size), Mv / np.sqrt(size)
            vectors.append((v, K(v), Mv))
    small = np.array([[dot(v, Kw) for _, Kw, _ in vectors] for v, _, _ in vectors])
    values, columns = np.linalg.eigh((small + small.T) / 2)
    weights = columns[:, 0]
    x, Kx, Mx = (sum(c * part for c, part in zip(weights, parts, strict=True)) for parts in zip(*vectors, strict=True))
    rest = [c * v for c, (v, _, _) in zip(weights[1:], vectors[1:], strict=True)]
    return x, Kx, Mx, float(values[0]), sum(rest[1:], rest[0]) if rest else None
