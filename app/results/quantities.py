"""Numbers that people read off a solution: forces and moments of faces, displacements of points."""

from collections.abc import Sequence

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

Array = NDArray[np.float64]
Nodes = NDArray[np.int32]


def force(u: fem.Function, forces: Array, nodes: Nodes) -> Array:
    """Sum of the nodal forces of a face over all ranks, shape (3,).

    Args:
        u: Displacement.
        forces: Of the nodes of this rank, owned first, shape (n, d).
        nodes: Of the face on this rank, owned and ghost.
    """
    return u.function_space.mesh.comm.allreduce(_owned(u, forces, nodes)[1].sum(axis=0))


def moment(u: fem.Function, forces: Array, nodes: Nodes) -> Array:
    """Moment of the nodal forces about the origin, at the places where the nodes are now, shape (3,)."""
    V = u.function_space
    d = V.dofmap.index_map_bs
    own, padded = _owned(u, forces, nodes)
    places = V.tabulate_dof_coordinates()[own]
    places[:, :d] += u.x.array.reshape(-1, d)[own]
    return V.mesh.comm.allreduce(np.cross(places, padded).sum(axis=0))


def at_point(u: fem.Function, point: Sequence[float]) -> Array:
    """Displacement of the node nearest to a point at rest, shape (3,)."""
    V = u.function_space
    owned, d = V.dofmap.index_map.size_local, V.dofmap.index_map_bs
    distance = np.linalg.norm(V.tabulate_dof_coordinates()[:owned] - np.pad(point, (0, 3 - len(point))), axis=1)
    nearest = int(distance.argmin()) if owned else 0
    own = (float(distance[nearest]), u.x.array.reshape(-1, d)[nearest].tolist()) if owned else (np.inf, [0.0] * d)
    return np.pad(min(V.mesh.comm.allgather(own))[1], (0, 3 - d))


def _owned(u: fem.Function, forces: Array, nodes: Nodes) -> tuple[Nodes, Array]:
    """Those of the nodes that this rank owns, and their forces, shape (n, 3)."""
    dofmap = u.function_space.dofmap
    own = nodes[nodes < dofmap.index_map.size_local]
    return own, np.pad(forces[own], ((0, 0), (0, 3 - dofmap.index_map_bs)))
