"""The types of cells that there are, whatever their order, and the one that a mesh has."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from os import PathLike
from typing import Any

from elastune.geometry.errors import GeometryError


@dataclass(frozen=True)
class Family:
    """Cells with the same corners.

    Attributes:
        cell: dolfinx's name.
        dim: Dimension.
        corners: Number of corners.
        facet: Number of corners of a facet.
        first: gmsh's number of the type of first order.
        second: Of second order, complete.
    """

    cell: str
    dim: int
    corners: int
    facet: int
    first: int
    second: int


FAMILIES = (
    Family("triangle", 2, 3, 2, 2, 9),
    Family("quadrilateral", 2, 4, 2, 3, 10),
    Family("tetrahedron", 3, 4, 3, 4, 11),
    Family("hexahedron", 3, 8, 4, 5, 12),
)
# Splits cells of any type into simplices that fit together, which gmsh's own subdivision does not.
SPLIT = 'import pyvista; g = pyvista.read("{path}"); g.extract_cells(g.celltypes > {least}).triangulate().save("{to}")'
SAVE_ALL = "(gmsh writes the cells of physical groups only, or all with Mesh.SaveAll = 1)"


def dimension(model: Any, path: str | PathLike[str]) -> int:
    """Dimension of the cells, 3 or 2.

    Raises:
        GeometryError: There are no cells.
    """
    for dim in (3, 2):
        if len(model.mesh.getElementTypes(dim)):
            return dim
    raise GeometryError(f"{path}: expected volume cells, or surface cells in 2D; got neither {SAVE_ALL}")


def cell_type(model: Any, path: str | PathLike[str], dim: int) -> tuple[int, Family]:
    """Gmsh's number of the type of all cells, and what they are.

    Raises:
        GeometryError: They are of several types, or prisms or pyramids: with what splits them.
    """
    types = model.mesh.getElementTypes(dim)
    properties = [model.mesh.getElementProperties(kind) for kind in types]
    corners = properties[0][5]
    family = next((each for each in FAMILIES if (each.dim, each.corners) == (dim, corners)), None)
    if len(types) == 1 and family is not None:
        return int(types[0]), family
    supported = "tetrahedra or hexahedra" if dim == 3 else "triangles or quadrilaterals"
    names = ", ".join(each[0] for each in properties)
    script = SPLIT.format(path=str(path), least=9 if dim == 3 else 4, to="split.vtk")
    raise GeometryError(
        f"{path}: expected all cells {supported}; got {names}; this splits them: python3 -c {shlex.quote(script)}"
    )
