"""Gmsh's own `.msh` files, of every version: read by gmsh, with the groups that the file means."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from elastune.geometry.arrays.content import KINDS, Group
from elastune.geometry.errors import GeometryError
from elastune.geometry.files.version2 import regrouped

# Names of groups come first.
HEAD = 2**20
# The line a .msh file of any version starts with. gmsh runs any other text as a script, commands and all.
HEADERS = (b"$MeshFormat", b"$Comments", b"$NOD")


def read_msh(model: Any, path: Path) -> list[Group]:
    """Read a file into an empty model.

    Returns:
        Its groups.

    Raises:
        GeometryError: It is no complete `.msh` file.
    """
    try:
        with path.open("rb") as file:
            start = file.read(HEAD).lstrip()
    except OSError as error:
        raise GeometryError(f"{path}: expected a readable .msh file, got: {error.strerror}") from error
    if not start.startswith(HEADERS):
        raise GeometryError(f"{path}: expected a .msh file, starting with $MeshFormat; got {start[:20]!r}")
    _check_names(path, start)
    merge(path, ".msh")
    version = start.partition(b"$MeshFormat")[2].split(None, 1)[:1]
    old = bool(version) and version[0].startswith(b"2")
    return (regrouped(model, path) if old else None) or groups_of(model)


def _check_names(path: Path, start: bytes) -> None:
    """Of two groups with one name gmsh would leave the second without."""
    names = start.partition(b"$PhysicalNames")[2].partition(b"$EndPhysicalNames")[0]
    seen = set()
    for dim, name in re.findall(rb'^\s*(\d)\s+\d+\s+"(.*)"', names, re.MULTILINE):
        if (dim, name) in seen:
            expected = f"one physical group {name.decode(errors='replace')!r} of {KINDS[int(dim)]}"
            raise GeometryError(f"{path}: expected {expected}, got two")
        seen.add((dim, name))


def merge(path: Path, kind: str, given: Path | None = None) -> None:
    """Have gmsh read a file into the current model; messages name the file that was given.

    Raises:
        GeometryError: It stopped; with its reason.
    """
    import gmsh

    try:
        gmsh.merge(str(path))
    except Exception as error:  # the only type gmsh raises
        reason = " ".join(str(error).split())
        raise GeometryError(f"{given or path}: expected a complete {kind} file; gmsh stopped with: {reason}") from error


def groups_of(model: Any) -> list[Group]:
    """Physical groups and geometric entities of a model."""
    groups = [
        Group(dim, tag, model.getPhysicalName(dim, tag), tuple(map(int, model.getEntitiesForPhysicalGroup(dim, tag))))
        for dim, tag in model.getPhysicalGroups()
    ]
    return groups + [Group(dim, tag, "", (tag,), physical=False) for dim, tag in model.getEntities()]
