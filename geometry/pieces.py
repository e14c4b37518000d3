"""Names that may overlap, on tags that may not: entities are cut into disjoint pieces, a name has one or several."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from mpi4py import MPI

T = TypeVar("T")
# Number of the piece that a name stands for, or of the pieces.
Tags = int | tuple[int, ...]


def pieces(
    members: Mapping[str, NDArray[np.int32]], numbers: Mapping[str, int], comm: MPI.Comm | None = None
) -> tuple[NDArray[np.int32], NDArray[np.int32], dict[str, Tags]]:
    """Cut what several names have in common into pieces of its own.

    Args:
        members: Indices of entities on this rank, by name, the same names in the same order on all ranks.
        numbers: Of each name, different and positive: of the piece that belongs to this name alone.
        comm: Of all ranks, which number the pieces alike; this process alone unless given.

    Returns:
        Indices of the entities that have a name, ascending; the number of the piece of each; the pieces of each name.
    """
    names = list(members)
    where = np.concatenate([np.empty(0, dtype=np.int32), *members.values()]).astype(np.int32)
    owner = np.repeat(np.arange(len(names)), [len(members[name]) for name in names])
    order = np.lexsort((owner, where))
    where, owner = where[order], owner[order]
    indices, first, counts = np.unique(where, return_index=True, return_counts=True)

    most = max(_gather(comm, int(counts.max(initial=1))))
    owners = np.full((len(indices), most), -1)
    owners[np.repeat(np.arange(len(indices)), counts), np.arange(len(where)) - np.repeat(first, counts)] = owner
    own, which = np.unique(owners, axis=0, return_inverse=True)
    found = np.unique(np.concatenate(_gather(comm, own)), axis=0)

    free = max(numbers.values(), default=0) + 1
    value: dict[tuple[int, ...], int] = {}
    for key in map(tuple, found.tolist()):
        if key[1:] and key[1] >= 0:
            value[key], free = free, free + 1
        else:
            value[key] = numbers[names[key[0]]]
    tags: dict[str, Tags] = {}
    for k, name in enumerate(names):
        of_name = tuple(number for key, number in value.items() if k in key)
        tags[name] = of_name[0] if len(of_name) == 1 else of_name or numbers[name]
    values = np.array([value[key] for key in map(tuple, own.tolist())], dtype=np.int32)
    return indices, values[which.ravel()] if len(values) else values, tags


def _gather(comm: MPI.Comm | None, value: T) -> list[T]:
    return [value] if comm is None else comm.allgather(value)
