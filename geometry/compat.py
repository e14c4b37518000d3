"""The calls that differ between dolfinx releases, and those to its C++ layer that have no other name."""

from __future__ import annotations

from inspect import signature
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from dolfinx.mesh import Mesh
    from mpi4py import MPI
    from numpy.typing import NDArray


def create_mesh(comm: MPI.Comm, cells: NDArray[np.int64], points: NDArray[np.float64], element: Any) -> Mesh:
    """Distribute a mesh; collective.

    dolfinx takes the element after the points (0.9), or before them (from 0.10 on).

    Args:
        comm: Communicator of the mesh.
        cells: Nodes of this rank's cells in dolfinx's order, numbered over all ranks, shape (m, k).
        points: Places of this rank's nodes, shape (n, d).
        element: basix.ufl's element of the geometry.
    """
    from dolfinx import mesh

    places = {"x": points, "e": element}
    given = [places[name] for name in signature(mesh.create_mesh).parameters if name in places]
    made: Mesh = mesh.create_mesh(comm, cells, *given)
    return made


def gmsh_order(cell: str, nodes: int) -> list[int]:
    """Places in gmsh's order of a cell's nodes in dolfinx's."""
    from dolfinx import cpp

    order: list[int] = cpp.io.perm_gmsh(cpp.mesh.to_type(cell), nodes)
    return order
