"""Meshes of other programs: read by meshio or VTK, their groups kept, handed to gmsh as a temporary `.msh`."""

from __future__ import annotations

import io
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from elastune.geometry.arrays.content import Group
from elastune.geometry.errors import GeometryError
from elastune.geometry.files.inp import read_inp
from elastune.geometry.files.msh import merge
from elastune.geometry.files.parting import Label, part
from elastune.geometry.files.vtk import read_vtk

# Cell data that number groups, by what wrote them; where there are none of these, the only whole numbers there are.
NUMBERS = ("gmsh:physical", "medit:ref", "nastran:ref", "cell_tags", "CellEntityIds", "avsucd:material", "tetgen:ref")
# Of these zero stands for no group.
ZERO_IS_NONE = ("gmsh:physical", "gmsh:geometrical", "medit:ref", "cell_tags")
# More numbers than these are those of cells.
MOST = 1000
# Bulk data, which meshio wants to be told.
NASTRAN = (".bdf", ".nas", ".fem")

Index = NDArray[np.int64]


def read_converted(model: Any, path: Path) -> list[Group]:
    """Read a file of any kind that meshio or VTK knows into an empty model.

    Returns:
        Its groups: sets of cells and of points by name, families, and numbers in cell data.

    Raises:
        GeometryError: They stopped, or know a cell type that gmsh does not.
    """
    import meshio

    mesh = {".inp": read_inp, ".vtk": read_vtk, ".vtu": read_vtk}.get(path.suffix.lower(), _read)(path)
    if mesh.point_sets:
        nodes = np.unique(np.concatenate([np.asarray(each, dtype=np.int64) for each in mesh.point_sets.values()]))
        mesh.cells.append(meshio.CellBlock("vertex", nodes[:, None]))
    starts = np.cumsum([0, *map(len, mesh.cells)])
    dims = np.repeat([block.dim for block in mesh.cells], [len(block) for block in mesh.cells])
    entities, groups = part(_sets(mesh, starts), dims)
    by_block = np.split(entities, starts[1:-1])
    tags = {"gmsh:physical": by_block, "gmsh:geometrical": [each.copy() for each in by_block]}
    plain = meshio.Mesh(mesh.points, mesh.cells, cell_data=tags)
    with TemporaryDirectory() as folder:
        try:
            meshio.write(Path(folder) / "mesh.msh", plain, file_format="gmsh22")
        except KeyError as error:
            raise GeometryError(f"{path}: expected tetrahedra or hexahedra; got {error.args[0]}") from error
        merge(Path(folder) / "mesh.msh", path.suffix, path)
    return groups


def _read(path: Path) -> Any:
    import meshio

    file, said = path, io.StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said), TemporaryDirectory() as folder:
            if path.suffix.lower() in NASTRAN and b"BEGIN BULK" not in (data := path.read_bytes()):
                file = Path(folder) / f"mesh{path.suffix}"
                file.write_bytes(b"BEGIN BULK\n" + data)
            mesh = meshio.read(file)
    except (Exception, SystemExit) as error:
        reason = " ".join((str(error) if isinstance(error, Exception) else said.getvalue()).split())
        reason = reason or type(error).__name__
        raise GeometryError(f"{path}: expected a complete {path.suffix} file; meshio stopped with: {reason}") from error
    # Groups of nodes in files of Salome: families by number, each with its groups.
    families = mesh.point_data.get("point_tags", np.empty(0))
    for number, names in getattr(mesh, "point_tags", {}).items():
        for name in names:
            before = mesh.point_sets.get(name, [])
            mesh.point_sets[name] = np.concatenate([before, np.flatnonzero(families == number)])
    return mesh


def _sets(mesh: Any, starts: Index) -> dict[Label, Index]:
    """Cells of each group, numbered through all blocks."""
    sets: dict[Label, list[Index]] = {}
    dims = [block.dim for block in mesh.cells]
    for key, blocks in _numbers(mesh).items():
        names = getattr(mesh, "cell_tags", {}) if key == "cell_tags" else {}
        for k, numbers in enumerate(blocks):
            for number in map(int, np.unique(numbers)):
                if number == 0 and key in ZERO_IS_NONE:
                    continue
                where = starts[k] + np.flatnonzero(numbers == number)
                # Families of Salome have several groups, each by name.
                for name in names.get(number, [""]):
                    label = Label(dims[k], 0 if name else number, name, key != "gmsh:geometrical")
                    sets.setdefault(label, []).append(where)
    for name, blocks in mesh.cell_sets.items():
        for k, cells in enumerate(blocks):
            if cells is not None and len(cells) and not name.startswith("gmsh:"):
                sets.setdefault(Label(dims[k], 0, name), []).append(starts[k] + np.asarray(cells, dtype=np.int64))
    for name, nodes in mesh.point_sets.items():
        where = starts[-2] + np.searchsorted(mesh.cells[-1].data[:, 0], np.asarray(nodes, dtype=np.int64))
        sets.setdefault(Label(0, 0, name), []).append(where)
    return {label: np.concatenate(members) for label, members in sets.items()}


def _numbers(mesh: Any) -> dict[str, list[Index]]:
    """Cell data that number groups, by block."""
    whole = {
        key: [np.asarray(block, dtype=np.int64) for block in blocks]
        for key, blocks in mesh.cell_data.items()
        if all(np.asarray(block).ndim == 1 and np.asarray(block).dtype.kind in "iu" for block in blocks)
    }
    known = [key for key in NUMBERS if key in whole][:1]
    others = [
        key
        for key, blocks in whole.items()
        if key != "gmsh:geometrical" and not key.startswith("vtk") and len(np.unique(np.concatenate(blocks))) < MOST
    ]
    chosen = known or (others if len(others) == 1 else [])
    return {key: whole[key] for key in [*chosen, *(["gmsh:geometrical"] if "gmsh:geometrical" in whole else [])]}
