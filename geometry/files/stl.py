"""Bodies from `.stl`: closed shells of triangles, parted into faces at their edges, filled with tetrahedra."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from elastune.geometry.arrays.content import Group
from elastune.geometry.errors import GeometryError
from elastune.geometry.files.cad import mesh
from elastune.geometry.files.msh import merge

# Triangles that meet at a larger angle lie in different faces.
EDGE = math.radians(40)

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def read_stl(model: Any, path: Path, h: float) -> list[Group]:
    """Read closed shells into an empty model and mesh what they enclose; a shell within another is a cavity.

    Returns:
        The faces and volumes, by number.

    Raises:
        GeometryError: A shell is not closed, or gmsh stopped.
    """
    merge(path, ".stl")
    model.mesh.removeDuplicateNodes()
    shells = _shells(model, path)
    model.mesh.classifySurfaces(EDGE, True, True, math.pi)
    model.mesh.createGeometry()
    # Of the new surfaces, each belongs to the shell that has its nodes.
    loops: list[list[int]] = [[] for _ in shells]
    for _, surface in model.getEntities(2):
        x = model.mesh.getNodes(2, surface, True)[1][:3]
        away = [np.linalg.norm(shell - x, axis=2).min() for shell in shells]
        loops[int(np.argmin(away))].append(surface)
    closed = [model.geo.addSurfaceLoop(loop) for loop in loops]
    for k, holes in _nested(shells).items():
        model.geo.addVolume([closed[k], *(closed[hole] for hole in holes)])
    model.geo.synchronize()
    return mesh(model, path, h)


def _shells(model: Any, path: Path) -> list[Array]:
    """Triangles of each connected part, by their corners, shape (n, 3, 3); all closed."""
    tags, x, _ = model.mesh.getNodes()
    order = np.argsort(tags)
    x = np.reshape(x, (-1, 3))[order]
    nodes = np.searchsorted(tags[order], model.mesh.getElementsByType(2)[1]).reshape(-1, 3).astype(np.int64)
    nodes = nodes[(nodes != np.roll(nodes, 1, axis=1)).all(axis=1)]
    edges = np.sort(np.concatenate([nodes[:, [0, 1]], nodes[:, [1, 2]], nodes[:, [2, 0]]]), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    if not len(nodes) or (counts != 2).any():
        raise GeometryError(
            f"{path}: expected closed shells, two triangles at each edge; got {np.count_nonzero(counts != 2)} edges "
            f"with another number of them, of {len(counts)}"
        )
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(edges)), edges.T), shape=(len(x), len(x)))
    part = connected_components(graph, directed=False)[1][nodes[:, 0]]
    return [x[nodes[part == k]] for k in np.unique(part)]


def _nested(shells: list[Array]) -> dict[int, list[int]]:
    """For each shell with a body right within it, the shells that bound cavities of this body."""
    around = {
        k: [other for other in range(len(shells)) if other != k and _within(shells[k][0].mean(axis=0), shells[other])]
        for k in range(len(shells))
    }
    bodies = {k for k, outer in around.items() if len(outer) % 2 == 0}
    return {
        k: [hole for hole, outer in around.items() if k in outer and len(outer) == len(around[k]) + 1] for k in bodies
    }


def _within(x: Array, shell: Array) -> bool:
    """Whether a point lies within a shell: the solid angle that it is seen under is 4π there, 0 outside.

    Reference: Van Oosterom & Strackee, IEEE Trans. Biomed. Eng. 30(2), 1983, Eq. 8.
    """
    a, b, c = np.moveaxis(shell - x, 1, 0)
    la, lb, lc = (np.linalg.norm(each, axis=1) for each in (a, b, c))
    over = np.einsum("ij,ij->i", a, np.cross(b, c))
    under = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return bool(abs(2 * np.arctan2(over, under).sum()) > 2 * math.pi)
