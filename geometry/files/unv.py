"""Universal files of I-deas and Salome: gmsh reads nodes and elements; groups, at which it may crash, are read here."""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from elastune.geometry.arrays.content import Group
from elastune.geometry.files.msh import merge
from elastune.geometry.files.parting import Elements, Label

# Datasets of permanent groups: one entity more or less a line, the rest alike.
GROUPS = re.compile(r"^ *-1 *\n *(?:2429|2430|2432|2435|2452|2467|2477) *\n(.*?)^ *-1 *$\n?", re.MULTILINE | re.DOTALL)
ELEMENT = 8


def read_unv(model: Any, path: Path) -> list[Group]:
    """Read a file into an empty model; its groups of elements, and the numbers of their properties.

    Raises:
        GeometryError: It is no complete file.
    """
    text = path.read_text(encoding="latin-1")
    with TemporaryDirectory() as folder:
        copy = Path(folder) / "mesh.unv"
        copy.write_text(GROUPS.sub("", text), encoding="latin-1")
        merge(copy, ".unv", path)
    elements = Elements(model)
    order = np.argsort(elements.numbers)
    sets = {}
    for found in GROUPS.finditer(text):
        for number, name, members in _groups(found[1].splitlines()):
            where = order[np.flatnonzero(np.isin(elements.numbers[order], members))]
            for dim in np.unique(elements.dims[where]).tolist():
                sets[Label(dim, number, name)] = where[elements.dims[where] == dim]
    return elements.regroup(sets)


def _groups(lines: list[str]) -> list[tuple[int, str, list[int]]]:
    """Number, name and elements of each group: a record, a name, then two or more fours of numbers a line."""
    groups = []
    at = 0
    while at + 1 < len(lines):
        record = [int(word) for word in lines[at].split()]
        name, count = lines[at + 1].strip(), record[-1]
        words: list[int] = []
        at += 2
        while len(words) < 4 * count and at < len(lines):
            words += [int(word) for word in lines[at].split()]
            at += 1
        fours = np.array(words[: 4 * count], dtype=np.int64).reshape(-1, 4)
        groups.append((record[0], name, fours[fours[:, 0] == ELEMENT, 1].tolist()))
    return groups
