"""Bodies from CAD, and gmsh's own `.geo`: meshed by gmsh with tetrahedra, or triangles in 2D."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from elastune.geometry.arrays.content import Group
from elastune.geometry.errors import GeometryError
from elastune.geometry.files.msh import groups_of, merge

# A .geo is a script. What runs commands, reads other scripts or writes files has no place in a body that is read.
FORBIDDEN = re.compile(
    r"\b(SystemCall|NonBlockingSystemCall|System|OnelabRun|Include|Merge|ShapeFromFile|Save|Print|Printf|Plugin|"
    r"CreateDir|UnlinkFile|RenameFile|Exit|Abort)\b"
)
COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
# A file that such a body may be made of: no script.
HARMLESS = re.compile(r'\b(?:Merge|ShapeFromFile)\s*\(?\s*"[^"]*\.(?:step|stp|brep|stl)"\s*\)?', re.IGNORECASE)
PRINTED = re.compile(r'\bPrintf\s*\((?:"[^"]*"|[^;"])*\)\s*;')


def read_cad(model: Any, path: Path, h: float) -> list[Group]:
    """Read a body into an empty model, and mesh it.

    Args:
        model: The model.
        path: The file.
        h: Largest size of the cells.

    Returns:
        Its physical groups, and its surfaces and volumes by number.

    Raises:
        GeometryError: gmsh stopped, or a script does more than draw a body.
    """
    if path.suffix.lower() == ".geo":
        _check_script(path)
    merge(path, path.suffix)
    return mesh(model, path, h)


def mesh(model: Any, path: Path, h: float) -> list[Group]:
    """Mesh the volumes of a model, or its surfaces where there are no volumes.

    Raises:
        GeometryError: There is nothing to mesh, or gmsh stopped.
    """
    import gmsh

    dim = 3 if model.getEntities(3) else 2
    if not model.getEntities(dim):
        raise GeometryError(f"{path}: expected a volume, or a flat surface, to mesh; got neither")
    before = gmsh.option.getNumber("Mesh.MeshSizeMax")
    gmsh.option.setNumber("Mesh.MeshSizeMax", h)
    try:
        model.mesh.generate(dim)
    except Exception as error:  # the only type gmsh raises
        reason = " ".join(str(error).split())
        raise GeometryError(f"{path}: expected a body that can be meshed with h = {h}; gmsh: {reason}") from error
    finally:
        gmsh.option.setNumber("Mesh.MeshSizeMax", before)
    return groups_of(model)


def _check_script(path: Path) -> None:
    text = HARMLESS.sub("", PRINTED.sub("", COMMENT.sub("", path.read_text(encoding="latin-1"))))
    if found := FORBIDDEN.search(text):
        raise GeometryError(
            f"{path}: expected a .geo that draws a body and no more; got {found[0]}; "
            f"if it is to be trusted, mesh it: gmsh -3 {path.name}"
        )
