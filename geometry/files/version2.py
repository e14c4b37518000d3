"""Version 2 of `.msh` gives each element a group of its own; gmsh takes the groups of all elements of an entity.

A file of a program that knows no geometric entities, and gives all elements the same, would then have all its groups
everywhere.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from elastune.geometry.files.content import Group

Index = NDArray[np.int64]


def regroup(model: Any, path: Path) -> list[Group] | None:
    """Part the entities of a model by the physical groups of their elements, where the file is of version 2.

    Args:
        model: What gmsh made of the file.
        path: The file.

    Returns:
        The groups; None where gmsh has them right.
    """
    physical = _physical(model, path.read_bytes())
    if physical is None:
        return None
    parts: dict[tuple[int, int, int], list[tuple[int, Index, Index]]] = {}
    for dim, entity in model.getEntities():
        for kind, elements, nodes in zip(*model.mesh.getElements(dim, entity), strict=True):
            numbers = physical[1][np.searchsorted(physical[0], elements)]
            for number in np.unique(numbers).tolist():
                here = numbers == number
                width = len(nodes) // len(elements)
                parts.setdefault((dim, entity, number), []).append(
                    (kind, elements[here], nodes.reshape(-1, width)[here].ravel())
                )
    if len(parts) == len({key[:2] for key in parts}):
        return None
    groups = [(dim, tag, model.getPhysicalName(dim, tag)) for dim, tag in model.getPhysicalGroups()]
    tags, places, _ = model.mesh.getNodes()
    model.mesh.clear()
    model.removePhysicalGroups()
    model.removeEntities(model.getEntities(), True)
    entities = {key: model.addDiscreteEntity(key[0]) for key in parts}
    holder = next(iter(entities))
    model.mesh.addNodes(holder[0], entities[holder], tags, places)
    for key, found in parts.items():
        for kind, elements, nodes in found:
            model.mesh.addElementsByType(entities[key], kind, elements, nodes)

    def of(dim: int, place: int, number: int) -> tuple[int, ...]:
        return tuple(tag for key, tag in entities.items() if (key[0], key[place]) == (dim, number))

    named = [Group(dim, tag, name, of(dim, 2, tag)) for dim, tag, name in groups]
    geometric = sorted({key[:2] for key in parts})
    return named + [Group(dim, tag, "", of(dim, 1, tag), physical=False) for dim, tag in geometric]


def _physical(model: Any, data: bytes) -> tuple[Index, Index] | None:
    """Numbers of the elements of a file of version 2, ascending, and of their groups; None for other versions."""
    version, binary, _ = data.partition(b"$MeshFormat")[2].split(None, 3)[:3] or (b"", b"", b"")
    if not version.startswith(b"2"):
        return None
    body = data.partition(b"$Elements")[2].lstrip(b" \r").removeprefix(b"\n")
    count, _, body = body.partition(b"\n")
    numbers, groups = [], []
    if binary == b"0":
        for line in body.partition(b"$EndElements")[0].splitlines():
            words = line.split(None, 4)
            if len(words) > 3:
                numbers.append(int(words[0]))
                groups.append(int(words[3]) if int(words[2]) else 0)
    else:
        endian = "<" if int.from_bytes(_after_line(data, b"$MeshFormat", 2)[:4], "little") == 1 else ">"
        words, at, left = np.frombuffer(body, f"{endian}i4", len(body) // 4), 0, int(count)
        while left > 0:
            kind, many, extra = words[at : at + 3].tolist()
            width = 1 + extra + model.mesh.getElementProperties(kind)[3]
            block = words[at + 3 : at + 3 + many * width].reshape(many, width)
            numbers.extend(block[:, 0].tolist())
            groups.extend(block[:, 1].tolist() if extra else [0] * many)
            at, left = at + 3 + many * width, left - many
    ascending = np.argsort(numbers)
    return np.array(numbers, dtype=np.int64)[ascending], np.array(groups, dtype=np.int64)[ascending]


def _after_line(data: bytes, word: bytes, lines: int) -> bytes:
    """What follows so many lines from a word on."""
    return data.partition(word)[2].split(b"\n", lines)[lines]
