"""Gmsh's own `.msh` files, of every version: read by gmsh, with the groups that the file means."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from elastune.geometry.arrays.content import Group
from elastune.geometry.errors import GeometryError
from elastune.geometry.files.version2 import regrouped

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
            start = file.read(64).lstrip()
    except OSError as error:
        raise GeometryError(f"{path}: expected a readable .msh file, got: {error.strerror}") from error
    if not start.startswith(HEADERS):
        raise GeometryError(f"{path}: expected a .msh file, starting with $MeshFormat; got {start[:20]!r}")
    merge(path, ".msh")
    return regrouped(model, path.read_bytes()) or groups_of(model)


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
