"""Continuous functions with jumps between groups of cells."""

import dolfinx
import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from elastune.forms.compat import index_map, with_dofmap


def torn(space: fem.FunctionSpace, groups: NDArray[np.int32]) -> fem.FunctionSpace:
    """A space of continuous scalars that have a value on each side where groups of cells meet; collective.

    Args:
        space: Of Lagrange elements of degree one: a value at each vertex.
        groups: Number of the group of each cell of this rank, owned and ghost.

    Returns:
        The space whose degrees of freedom are the pairs of a vertex and a group that share a cell. The owner of the
        vertex owns them, in the order of vertices, whether or not it has a cell of the group.
    """
    dofs, comm = space.dofmap, space.mesh.comm
    vertices, values = dofs.index_map, dofs.list.ravel().astype(np.int32)
    of_values = np.repeat(groups, len(values) // max(len(groups), 1))
    # Pairs as numbers: of a vertex times how many groups there are, and of the group.
    count = 1 + max(comm.allgather(int(groups.max(initial=0))))
    pairs, first, places = np.unique(
        vertices.local_to_global(values) * count + of_values, return_index=True, return_inverse=True
    )
    owners = np.concatenate([np.full(vertices.size_local, comm.rank), vertices.owners])[values[first]].astype(np.int32)

    # Everybody tells the owners which pairs there are, and is told their numbers.
    asked = comm.alltoall([pairs[owners == rank] for rank in range(comm.size)])
    known = np.unique(np.concatenate(asked))
    start = comm.scan(len(known)) - len(known)
    numbers = np.empty(len(pairs), dtype=np.int64)
    for rank, found in enumerate(comm.alltoall([start + np.searchsorted(known, wanted) for wanted in asked])):
        numbers[owners == rank] = found

    own = owners == comm.rank
    local = np.where(own, numbers - start, len(known) + np.cumsum(~own) - 1).astype(np.int32)
    indices = index_map(comm, len(known), numbers[~own], owners[~own])
    cells = dolfinx.graph.adjacencylist(local[places].reshape(dofs.list.shape))
    made = dolfinx.cpp.fem.DofMap(dofs.dof_layout, indices, 1, getattr(cells, "_cpp_object", cells), 1)
    return with_dofmap(space, made)
