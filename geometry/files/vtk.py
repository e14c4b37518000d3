"""Files of VTK, read by VTK: meshio does not know what today's versions write in them."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from elastune.geometry.errors import GeometryError

# VTK's number of a cell type -> meshio's name, and the order of its nodes where that is another one.
TYPES: dict[int, tuple[str, list[int] | None]] = {
    1: ("vertex", None), 3: ("line", None), 21: ("line3", None),
    5: ("triangle", None), 22: ("triangle6", None), 8: ("quad", [0, 1, 3, 2]), 9: ("quad", None),
    23: ("quad8", None), 28: ("quad9", None), 10: ("tetra", None), 24: ("tetra10", None),
    11: ("hexahedron", [0, 1, 3, 2, 4, 5, 7, 6]), 12: ("hexahedron", None), 25: ("hexahedron20", None),
    29: ("hexahedron27", None), 13: ("wedge", None), 26: ("wedge15", None), 14: ("pyramid", None),
    27: ("pyramid13", None),
}  # fmt: skip


# As meshio writes the types of data, and as VTK reads them.
WORDS = {b" vtktypeint32\n": b" int\n", b" vtktypeuint32\n": b" unsigned_int\n"}


def read_vtk(path: Path) -> Any:
    """Read a file as a `meshio.Mesh`, with its cell data.

    Raises:
        GeometryError: VTK finds no cells in it, or cells of other types.
    """
    import meshio
    import pyvista
    from vtkmodules.vtkCommonCore import vtkObject

    told = vtkObject.GetGlobalWarningDisplay()
    vtkObject.SetGlobalWarningDisplay(0)
    try:
        data = pyvista.read(path) if path.suffix.lower() == ".vtu" else _legacy(path)
        grid = (data.combine() if isinstance(data, pyvista.MultiBlock) else data).cast_to_unstructured_grid()
    except Exception as error:
        reason = " ".join(str(error).split())
        raise GeometryError(f"{path}: expected a complete {path.suffix} file; VTK stopped with: {reason}") from error
    finally:
        vtkObject.SetGlobalWarningDisplay(told)
    if not grid.n_cells:
        raise GeometryError(f"{path}: expected a complete {path.suffix} file; VTK finds no cells in it")
    blocks = []
    values: dict[str, list[Any]] = {name: [] for name in grid.cell_data.keys()}
    for number in np.unique(grid.celltypes).tolist():
        if number not in TYPES:
            raise GeometryError(f"{path}: expected tetrahedra or hexahedra; got cells of VTK's type {number}")
        cell, order = TYPES[number]
        nodes = grid.cells_dict[number].astype(np.int64)
        blocks.append((cell, nodes if order is None else nodes[:, order]))
        for name, found in values.items():
            found.append(np.asarray(grid.cell_data[name])[grid.celltypes == number])
    return meshio.Mesh(np.asarray(grid.points, dtype=np.float64), blocks, cell_data=values)


def _legacy(path: Path) -> Any:
    import pyvista

    data = path.read_bytes()
    for theirs, ours in WORDS.items():
        data = data.replace(theirs, ours)
    with TemporaryDirectory() as folder:
        copy = Path(folder) / "mesh.vtk"
        copy.write_bytes(data)
        return pyvista.read(copy)
