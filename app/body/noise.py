"""Random numbers at nodes that are the same however the mesh is distributed, without any rank seeing all nodes."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Of the body's extent: nodes closer than this share their numbers.
RESOLUTION = 1e-7


def uniform(points: Array, low: Array, extent: float, seed: int) -> Array:
    """Numbers in [0, 1), a hash of a node's place in the body.

    Args:
        points: Nodes, shape (n, d).
        low: Least coordinates of the body, shape (d,).
        extent: Its largest extent.
        seed: Which numbers.

    Returns:
        Shape (n, d).
    """
    # Half-way between two numbers, as nodes of even meshes may be, rounding would differ from rank to rank.
    places = np.floor((points - low) / extent / RESOLUTION + 0.377).astype(np.int64).view(np.uint64)
    key: NDArray[np.uint64] = np.full(len(points), seed, dtype=np.uint64)
    for axis in range(places.shape[1]):
        key = _mixed(key ^ _mixed(places[:, axis] + np.uint64(axis)))
    numbers = np.stack([_mixed(key + np.uint64(axis)) for axis in range(places.shape[1])], axis=1)
    return (numbers >> np.uint64(11)).astype(np.float64) * 2.0**-53


def _mixed(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """A permutation of the 64-bit numbers without visible order (Steele, Lea & Flood 2014, splitmix64)."""
    with np.errstate(over="ignore"):
        x = x + np.uint64(0x9E3779B97F4A7C15)
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return x ^ (x >> np.uint64(31))
