"""Time series for ParaView: one XDMF grid a step that holds all fields, the numbers in HDF5 files."""

import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx.mesh import Mesh
from dolfinx.plot import vtk_mesh
from numpy.typing import NDArray

from elastune.app.results.files import GrowingText, remove, replace_bytes

Array = NDArray[Any]

# By cell type and nodes a cell: XDMF's name and VTK's number. VTK's own second-order cells rather than its
# Lagrange cells of any order: every reader has them, and the nodes come in the same order.
CELL_TYPES = {
    ("triangle", 3): ("Triangle", 5),
    ("quadrilateral", 4): ("Quadrilateral", 9),
    ("tetrahedron", 4): ("Tetrahedron", 10),
    ("hexahedron", 8): ("Hexahedron", 12),
    ("triangle", 6): ("Triangle_6", 22),
    ("tetrahedron", 10): ("Tetrahedron_10", 24),
    ("quadrilateral", 9): ("Quadrilateral_9", 28),
    ("hexahedron", 27): ("Hexahedron_27", 29),
}
ATTRIBUTES = {(): "Scalar", (3,): "Vector", (3, 3): "Tensor"}

# The file that refers to all others, and the folder of those.
DOCUMENT, DATA = "fields.xdmf", "fields"
OURS = re.compile(r"\.?(mesh|\d{4,})\.h5(\.part)?")
HEAD = """<?xml version="1.0"?>
<Xdmf Version="3.0">
  <Domain>
    <Grid Name="steps" GridType="Collection" CollectionType="Temporal">
"""
TAIL = """    </Grid>
  </Domain>
</Xdmf>
"""


class WholeMesh:
    """A distributed mesh as one, on rank 0.

    Nodes and cells come in the order of the mesh's source, the same on any number of ranks.

    Attributes:
        topology: XDMF's name of the cell type.
        vtk_type: VTK's number of it.
        points: Coordinates, shape (nodes, 3); empty but on rank 0.
        cells: Nodes of each cell in VTK's order, shape (cells, nodes of a cell); empty but on rank 0.
    """

    def __init__(self, mesh: Mesh) -> None:
        """Gathers the mesh; collective."""
        self._comm = mesh.comm
        nodes = mesh.geometry.index_map()
        owned_cells = mesh.topology.index_map(mesh.topology.dim).size_local
        self._node_order = self._order(mesh.geometry.input_global_indices[: nodes.size_local])
        self._cell_order = self._order(mesh.topology.original_cell_index[:owned_cells])

        width = mesh.ufl_domain().ufl_coordinate_element().basix_element.dim
        # dolfinx divides by the number of cells.
        local = vtk_mesh(mesh)[0].reshape(-1, width + 1)[:, 1:] if owned_cells else np.empty((0, width), dtype=np.int32)
        cells = self.cells_to_root(nodes.local_to_global(local.ravel().astype(np.int32)).reshape(-1, width))
        # Global numbers run through the ranks one after the other, as do the gathered nodes.
        position = np.empty(len(self._node_order), dtype=np.int32)
        position[self._node_order] = np.arange(len(position), dtype=np.int32)
        self.cells = position[cells]
        self.points = self.nodes_to_root(mesh.geometry.x[: nodes.size_local])
        self.topology, self.vtk_type = CELL_TYPES[mesh.topology.cell_name(), width]

    def nodes_to_root(self, values: Array) -> Array:
        """Values at the owned nodes of all ranks, in the order of `points`; collective."""
        return self._gather(values)[self._node_order]

    def cells_to_root(self, values: Array) -> Array:
        """Values of the owned cells of all ranks, in the order of `cells`; collective."""
        return self._gather(values)[self._cell_order]

    def _order(self, source: Array) -> Array:
        return np.argsort(self._gather(source))

    def _gather(self, values: Array) -> Array:
        parts = self._comm.gather(values)
        return values[:0] if parts is None else np.concatenate(parts)


class FieldFile:
    """`fields.xdmf` and the folder `fields`, written by one rank, complete after every step.

    The mesh and each step have an HDF5 file of their own, which HDF5 makes in memory: it changes its files in place
    and when it closes them, and a run that is killed there, or a disk that fills up, would cost what is in the file.
    Its bytes are written aside and take their name when they are on the disk, and the XDMF file that refers to them
    comes last. A reader may have the files open meanwhile.
    """

    def __init__(self, folder: Path, mesh: WholeMesh) -> None:
        """Writes the mesh.

        Raises:
            OSError: If the file cannot be written.
        """
        self._data = folder / DATA
        self._xdmf = GrowingText(folder / DOCUMENT, HEAD, TAIL)
        self._mesh, self._count = mesh, 0
        self._data.mkdir(exist_ok=True)
        self._write("mesh.h5", {"points": mesh.points, "cells": mesh.cells})

    def write(self, time: float, nodes: Mapping[str, Array], cells: Mapping[str, Array]) -> None:
        """Adds a step.

        Args:
            time: Its time, the load factor.
            nodes: Fields at the nodes: scalars, vectors (3) or tensors (3, 3) along the first axis.
            cells: Fields of the cells, likewise.

        Raises:
            OSError: If the file cannot be written.
        """
        file = f"{self._count:04d}.h5"
        centers = [("Node", nodes), ("Cell", cells)]
        fields = [(name, center, values) for center, given in centers for name, values in given.items()]
        self._write(file, {name: _rows(values) for name, _, values in fields})
        attributes = [
            f'<Attribute Name="{name}" AttributeType="{ATTRIBUTES[values.shape[1:]]}" Center="{center}">'
            f"{_item(file, name, _rows(values))}</Attribute>"
            for name, center, values in fields
        ]
        self._xdmf.add(self._grid(time, attributes))
        self._count += 1

    def close(self) -> None:
        """No step comes after this."""
        self._xdmf.close()

    def _write(self, name: str, datasets: dict[str, Array]) -> None:
        replace_bytes(self._data / name, _hdf5(datasets))

    def _grid(self, time: float, attributes: list[str]) -> str:
        mesh = self._mesh
        lines = [
            '<Grid Name="body" GridType="Uniform">',
            f'  <Time Value="{time!r}"/>',
            f'  <Topology TopologyType="{mesh.topology}" NumberOfElements="{len(mesh.cells)}">'
            f"{_item('mesh.h5', 'cells', mesh.cells)}</Topology>",
            f'  <Geometry GeometryType="XYZ">{_item("mesh.h5", "points", mesh.points)}</Geometry>',
            *(f"  {attribute}" for attribute in attributes),
            "</Grid>",
        ]
        return "".join(f"      {line}\n" for line in lines)


def clear(folder: Path) -> None:
    """Removes the field files of an earlier run, and nothing else that lies in their folder.

    Raises:
        OSError: If they cannot be removed.
    """
    remove(folder / DOCUMENT)
    data = folder / DATA
    if not data.is_dir():
        return
    for path in data.iterdir():
        if OURS.fullmatch(path.name):
            path.unlink()
    with suppress(OSError):
        # Not empty: somebody else's.
        data.rmdir()


def _item(file: str, name: str, values: Array) -> str:
    kind = "Float" if values.dtype.kind == "f" else "Int"
    dimensions = " ".join(map(str, values.shape))
    return (
        f'<DataItem Dimensions="{dimensions}" NumberType="{kind}" Precision="{values.itemsize}" '
        f'Format="HDF">{DATA}/{file}:/{name}</DataItem>'
    )


def _rows(values: Array) -> Array:
    """Tensors as nine columns, the only form XDMF has."""
    return values.reshape(len(values), 9) if values.ndim == 3 else values


def _hdf5(datasets: Mapping[str, Array]) -> bytes:
    """An HDF5 file of arrays, as its bytes."""
    import h5py

    with h5py.File("in memory", "w", driver="core", backing_store=False) as file:
        for name, values in datasets.items():
            file[name] = values
        file.flush()
        return bytes(file.id.get_file_image())
