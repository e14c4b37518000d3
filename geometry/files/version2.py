"""Version 2 of `.msh` gives each element a group of its own; gmsh takes the groups of all elements of an entity.

A file of a program that knows no geometric entities, and gives all elements the same, would then have all its groups
everywhere.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from elastune.geometry.arrays.content import Group
from elastune.geometry.errors import GeometryError
from elastune.geometry.files.parting import Elements, Label

Index = NDArray[np.int64]


def regrouped(model: Any, path: Path) -> list[Group] | None:
    """Part the entities of a model by the physical groups of their elements.

    Args:
        model: What gmsh made of the file.
        path: The file, of version 2.

    Returns:
        The groups; None where gmsh has them right.

    Raises:
        GeometryError: Two elements have one number.
    """
    numbers, physical = _physical(model, path.read_bytes())
    elements = Elements(model)
    if (np.diff(numbers) == 0).any() or not np.isin(numbers, elements.numbers).all():
        raise GeometryError(f"{path}: expected each element to have a number of its own")
    # gmsh adds elements between the parts of a mesh that is parted.
    places = np.minimum(np.searchsorted(numbers, elements.numbers), len(numbers) - 1)
    own = np.where(numbers[places] == elements.numbers, physical[places], 0)
    found = np.unique(np.stack([elements.dims, elements.entities, own], axis=1), axis=0)
    if len(found) == len(np.unique(found[:, :2], axis=0)):
        return None
    sets = {}
    for dim, number in model.getPhysicalGroups():
        label = Label(dim, number, model.getPhysicalName(dim, number))
        sets[label] = np.flatnonzero((elements.dims == dim) & (own == number))
    return elements.regroup(sets)


def _physical(model: Any, data: bytes) -> tuple[Index, Index]:
    """Numbers of the elements of a file, ascending, and of the group of each, 0 for none."""
    binary = data.partition(b"$MeshFormat")[2].split(None, 2)[1] == b"1"
    count, _, body = data.partition(b"$Elements")[2].lstrip(b" \r").removeprefix(b"\n").partition(b"\n")
    numbers, groups = _of_words(model, data, body, int(count)) if binary else _of_lines(body)
    ascending = np.argsort(numbers)
    return numbers[ascending], groups[ascending]


def _of_lines(body: bytes) -> tuple[Index, Index]:
    rows = [line.split(None, 4) for line in body.partition(b"$EndElements")[0].splitlines()]
    rows = [row for row in rows if len(row) > 3]
    words = np.array([row[:4] for row in rows], dtype="S20").astype(np.int64).reshape(-1, 4)
    return words[:, 0], np.where(words[:, 2] > 0, words[:, 3], 0)


def _of_words(model: Any, data: bytes, body: bytes, left: int) -> tuple[Index, Index]:
    # The number one, in the file's order of bytes, follows the line with the version.
    one = data.partition(b"$MeshFormat")[2].split(b"\n", 2)[2][:4]
    words = np.frombuffer(body, "<i4" if one[0] == 1 else ">i4", len(body) // 4)
    found: list[Index] = [np.empty((0, 2), dtype=np.int64)]
    at = 0
    while left > 0:
        kind, many, extra = (int(word) for word in words[at : at + 3])
        width = 1 + extra + model.mesh.getElementProperties(kind)[3]
        # gmsh gives each element a header of its own: blocks with the same one are read together.
        size = 3 + many * width
        blocks = words[at : at + left // many * size]
        blocks = blocks[: len(blocks) // size * size].reshape(-1, size)
        other = np.flatnonzero((blocks[:, :3] != blocks[0, :3]).any(axis=1))
        blocks = blocks[: other[0] if len(other) else None]
        elements = blocks[:, 3:].reshape(-1, width)
        physical = elements[:, 1] if extra else np.zeros(len(elements))
        found.append(np.stack([elements[:, 0], physical], axis=1).astype(np.int64))
        at, left = at + blocks.size, left - len(elements)
    whole = np.concatenate(found)
    return whole[:, 0], whole[:, 1]
