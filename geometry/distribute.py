"""Plain arrays on rank 0 become a distributed mesh, and names of its entities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import basix.ufl
import numpy as np
from dolfinx.graph import adjacencylist
from dolfinx.io import distribute_entity_data
from dolfinx.mesh import meshtags_from_entities
from mpi4py import MPI
from numpy.typing import NDArray

from elastune.geometry.compat import create_mesh
from elastune.geometry.errors import GeometryError

if TYPE_CHECKING:
    from dolfinx.mesh import Mesh

    from elastune.geometry.arrays.content import Content, Name

# By dimension and name: number, and indices on a rank, owned and ghost.
Members = dict[int, dict[str, tuple[int, NDArray[np.int32]]]]


def distribute(comm: MPI.Comm, content: Content | None, where: str) -> tuple[Mesh, Members]:
    """Make the mesh; collective.

    Args:
        comm: Communicator of the mesh.
        content: On rank 0, None elsewhere.
        where: What an error starts with.

    Returns:
        The mesh, and what has names.

    Raises:
        GeometryError: Of a group with a name not all elements are parts of cells.
    """
    heads = None
    if content is not None:
        named = {dim: (found.corners.shape[1], found.names) for dim, found in content.elements.items()}
        heads = (content.dim, content.cell, content.degree, content.cells.shape[1], named)
    dim, cell, degree, width, named = comm.bcast(heads, root=0)
    element = basix.ufl.element(
        basix.ElementFamily.P, cell, degree, basix.LagrangeVariant.equispaced, shape=(dim,), dtype=np.float64
    )
    cells = np.empty((0, width), dtype=np.int64) if content is None else content.cells
    points = np.empty((0, dim)) if content is None else content.points
    mesh = create_mesh(comm, cells, points, element)

    mesh.topology.create_connectivity(dim - 1, dim)
    members: Members = {}
    for each, (corners, names) in named.items():
        entities: NDArray[np.int64] = np.empty((0, corners), dtype=np.int64)
        pieces: NDArray[np.int32] = np.empty(0, dtype=np.int32)
        if content is not None:
            entities, pieces = content.elements[each].corners, content.elements[each].pieces
        indices, values = _received(mesh, each, entities, pieces)
        members[each] = {name: (known.number, indices[np.isin(values, known.pieces)]) for name, known in names.items()}
        _drop_what_is_no_part(mesh, each, members[each], names, where)
    return mesh, members


def _received(
    mesh: Mesh, dim: int, entities: NDArray[np.int64], pieces: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Local entities of the mesh, owned and ghost, and their pieces."""
    topology = mesh.topology
    topology.create_entities(dim)
    topology.create_connectivity(dim, topology.dim)
    topology.create_connectivity(dim, 0)
    local, values = distribute_entity_data(mesh, dim, entities, pieces)
    tags = meshtags_from_entities(mesh, dim, adjacencylist(local), values.astype(np.int32, copy=False))
    there = tags.indices >= 0
    return tags.indices[there], tags.values[there]


def _drop_what_is_no_part(
    mesh: Mesh, dim: int, members: dict[str, tuple[int, NDArray[np.int32]]], names: dict[str, Name], where: str
) -> None:
    """Keep names that have entities; refuse those of the file that lost some on the way."""
    owned = mesh.topology.index_map(dim).size_local
    counts = np.array([np.count_nonzero(indices < owned) for _, indices in members.values()], dtype=np.int64)
    mesh.comm.Allreduce(MPI.IN_PLACE, counts, op=MPI.SUM)
    for (name, known), found in zip(names.items(), counts, strict=True):
        if known.exact and found != known.count:
            raise GeometryError(f"{where}: face {name!r}: expected {known.count} facets of cells, got {found}")
        if not found:
            members.pop(name)
