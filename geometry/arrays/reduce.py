"""Cells of an order that dolfinx does not have, in second order: nodes where the cell's own map has them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from elastune.geometry.arrays.family import Family


def to_second_order(
    model: Any, kind: int, family: Family, points: NDArray[np.float64], cells: NDArray[np.int64]
) -> tuple[int, NDArray[np.float64], NDArray[np.int64]]:
    """Put complete second-order cells in the place of serendipity cells, exactly, or of higher ones.

    Args:
        model: `gmsh.model`, for its shape functions.
        kind: gmsh's number of the cells' type.
        family: What they are.
        points: Places of the nodes, shape (n, 3).
        cells: Their nodes, corners first, shape (m, k).

    Returns:
        gmsh's number of the new type, the nodes' places, and the nodes of the cells.
    """
    target = family.second
    count, local = model.mesh.getElementProperties(target)[3:5]
    at = np.zeros((count, 3))
    at[:, : family.dim] = np.reshape(local, (count, family.dim))
    shapes = _shapes(model, kind, at)
    # A node lies on the edge, face or cell of the corners whose linear functions do not vanish there: two cells
    # that share these share the node.
    linear = np.abs(_shapes(model, family.first, at)) > 1e-9
    corners = family.corners
    rows, places = [], []
    for node in range(count):
        on = np.sort(cells[:, :corners][:, linear[node]], axis=1)
        rows.append(np.pad(on, ((0, 0), (0, corners - on.shape[1])), constant_values=-1))
        places.append(np.einsum("k,mki->mi", shapes[node], points[cells]))
    _, first, nodes = np.unique(np.concatenate(rows), axis=0, return_index=True, return_inverse=True)
    return target, np.concatenate(places)[first], nodes.reshape(count, len(cells)).T.astype(np.int64)


def _shapes(model: Any, kind: int, at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lagrange shape functions, shape (points, nodes)."""
    values = model.mesh.getBasisFunctions(kind, at.ravel(), "Lagrange")[1]
    return np.reshape(values, (len(at), -1))
