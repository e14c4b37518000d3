"""Time series for ParaView: one XDMF grid a step that holds all fields, the numbers in one HDF5 file."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx.mesh import Mesh
from dolfinx.plot import vtk_mesh
from numpy.typing import NDArray

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
# Bytes for HDF5's own notes on a step's arrays.
SPARE = 2**17
ATTRIBUTES = {(): "Scalar", (3,): "Vector", (3, 3): "Tensor"}


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
        local = vtk_mesh(mesh)[0].reshape(-1, width + 1)[:, 1:]
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
    """`fields.xdmf` and `fields.h5`, written by one rank, complete after every step.

    A reader may have the files open meanwhile. If the run is killed between two steps or in the middle of
    one, the steps before stay readable: HDF5 adds its table of contents after the numbers, and the XDMF file
    that refers to them is replaced last.
    """

    def __init__(self, folder: Path, mesh: WholeMesh) -> None:
        """Writes the mesh.

        Raises:
            OSError: If the file cannot be written.
        """
        self._xdmf, self._h5 = folder / "fields.xdmf", folder / "fields.h5"
        self._mesh = mesh
        self._grids: list[str] = []
        self._write({"mesh/points": mesh.points, "mesh/cells": mesh.cells}, mode="w")

    @property
    def paths(self) -> list[Path]:
        """The files."""
        return [self._xdmf, self._h5]

    def write(self, time: float, nodes: Mapping[str, Array], cells: Mapping[str, Array]) -> None:
        """Adds a step.

        Args:
            time: Its time, the load factor.
            nodes: Fields at the nodes: scalars, vectors (3) or tensors (3, 3) along the first axis.
            cells: Fields of the cells, likewise.

        Raises:
            OSError: If the file cannot be written.
        """
        group = f"steps/{len(self._grids):04d}"
        centers = [("Node", nodes), ("Cell", cells)]
        fields = [(name, center, values) for center, given in centers for name, values in given.items()]
        self._write({f"{group}/{name}": _rows(values) for name, _, values in fields}, mode="a")
        attributes = [
            f'<Attribute Name="{name}" AttributeType="{ATTRIBUTES[values.shape[1:]]}" Center="{center}">'
            f"{self._item(f'{group}/{name}', _rows(values))}</Attribute>"
            for name, center, values in fields
        ]
        self._grids.append(self._grid(time, attributes))
        replace_text(self._xdmf, self._document())

    def _write(self, datasets: dict[str, Array], mode: str) -> None:
        import h5py

        _reserve(self._h5, SPARE + sum(values.nbytes for values in datasets.values()))
        # Without a lock: ParaView that looks at the file must not stop the run.
        with h5py.File(self._h5, mode, locking=False) as file:
            for name, values in datasets.items():
                file[name] = values

    def _item(self, name: str, values: Array) -> str:
        kind = "Float" if values.dtype.kind == "f" else "Int"
        dimensions = " ".join(map(str, values.shape))
        return (
            f'<DataItem Dimensions="{dimensions}" NumberType="{kind}" Precision="{values.itemsize}" '
            f'Format="HDF">{self._h5.name}:/{name}</DataItem>'
        )

    def _grid(self, time: float, attributes: list[str]) -> str:
        mesh = self._mesh
        lines = [
            '<Grid Name="body" GridType="Uniform">',
            f'  <Time Value="{time!r}"/>',
            f'  <Topology TopologyType="{mesh.topology}" NumberOfElements="{len(mesh.cells)}">'
            f"{self._item('mesh/cells', mesh.cells)}</Topology>",
            f'  <Geometry GeometryType="XYZ">{self._item("mesh/points", mesh.points)}</Geometry>',
            *(f"  {attribute}" for attribute in attributes),
            "</Grid>",
        ]
        return "\n".join(f"      {line}" for line in lines)

    def _document(self) -> str:
        return "\n".join(
            [
                '<?xml version="1.0"?>',
                '<Xdmf Version="3.0">',
                "  <Domain>",
                '    <Grid Name="steps" GridType="Collection" CollectionType="Temporal">',
                *self._grids,
                "    </Grid>",
                "  </Domain>",
                "</Xdmf>",
                "",
            ]
        )


def _rows(values: Array) -> Array:
    """Tensors as nine columns, the only form XDMF has."""
    return values.reshape(len(values), 9) if values.ndim == 3 else values


def _reserve(path: Path, size: int) -> None:
    """Claims space on the disk behind the end of a file; HDF5 gives back what it does not use.

    Raises:
        OSError: If there is not enough; in the middle of a write, HDF5 would bring the process down.
    """
    if not hasattr(os, "posix_fallocate"):
        return
    with path.open("ab") as file:
        end = file.seek(0, os.SEEK_END)
        try:
            os.posix_fallocate(file.fileno(), end, size)
        except OSError:
            file.truncate(end)
            raise


def replace_text(path: Path, text: str) -> None:
    """Writes a text file so that at any time either the old or the new one is there, whole.

    Raises:
        OSError: If it cannot be written.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        with part.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
