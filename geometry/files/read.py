"""Any file of a mesh, or of a body to be meshed, by its suffix."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from elastune.geometry.arrays.content import Content, Group
from elastune.geometry.arrays.extract import extract
from elastune.geometry.arrays.family import dimension
from elastune.geometry.errors import GeometryError
from elastune.geometry.files.cad import read_cad
from elastune.geometry.files.convert import read_converted
from elastune.geometry.files.msh import read_msh
from elastune.geometry.files.stl import read_stl
from elastune.geometry.files.unv import read_unv

MESHES: dict[str, Callable[[Any, Path], list[Group]]] = {
    ".msh": read_msh,
    ".unv": read_unv,
    **dict.fromkeys((".vtk", ".vtu", ".inp", ".med", ".bdf", ".nas", ".fem", ".xdmf", ".mesh"), read_converted),
}
BODIES: dict[str, Callable[[Any, Path, float], list[Group]]] = {
    **dict.fromkeys((".step", ".stp", ".iges", ".igs", ".brep", ".geo"), read_cad),
    ".stl": read_stl,
}


def load(
    model: Any,
    path: str | PathLike[str],
    order: int = 1,
    refine: int = 0,
    h: float | None = None,
    asked: Mapping[int, Mapping[str, int]] | None = None,
) -> Content:
    """Read a file into the current gmsh model, and from there.

    Args:
        model: An empty `gmsh.model`.
        path: The file.
        order: Cells of a lower order are raised to this one.
        refine: How often each cell is split into equal parts, 2 along each edge.
        h: Size of the cells, for a body that is meshed here.
        asked: Names of further groups, by codimension: of the groups, or else the entities, of these numbers.

    Raises:
        GeometryError: The file cannot be read, or holds no mesh of one supported type.
    """
    file = Path(path)
    suffix = file.suffix.lower()
    if not file.is_file():
        what = "Is a directory" if file.is_dir() else "No such file or directory"
        raise GeometryError(f"{path}: expected a readable {suffix or 'mesh'} file, got: {what}")
    if suffix in MESHES:
        groups = MESHES[suffix](model, file)
    elif suffix in BODIES:
        if h is None:
            raise GeometryError(f"{path}: expected h, the size of the cells, which a {suffix} file does not have")
        groups = BODIES[suffix](model, file, h)
    else:
        raise GeometryError(f"{path}: expected a mesh ({', '.join(MESHES)}) or a body ({', '.join(BODIES)})")
    dim = dimension(model, path)
    given = model.mesh.getElementProperties(model.mesh.getElementTypes(dim)[0])[2]
    if refine and given > 1:
        raise GeometryError(f"{path}: refine = {refine}: expected straight cells, of order 1, got order {given}")
    for _ in range(refine):
        model.mesh.refine()
    if order > given:
        model.mesh.setOrder(order)
        if suffix in BODIES:
            # Nodes that move onto a curved surface may turn the cells behind it inside out.
            model.mesh.optimize("HighOrder")
    return extract(model, path, dim, groups, asked or {})
