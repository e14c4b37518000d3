"""The calls that differ between dolfinx releases."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dolfinx.mesh import Mesh, MeshTags
    from mpi4py import MPI


def model_to_mesh(model: Any, comm: MPI.Comm, gdim: int) -> tuple[Mesh, MeshTags, MeshTags]:
    """Distribute a gmsh model that lives on rank 0; collective.

    `dolfinx.io.gmshio` (0.9) returns the triple, `dolfinx.io.gmsh` (from 0.10 on) a `MeshData`.

    Args:
        model: `gmsh.model` on rank 0, None elsewhere.
        comm: Communicator of the mesh.
        gdim: Number of coordinates of a node, 2 or 3.

    Returns:
        Mesh, cell tags and facet tags.
    """
    if find_spec("dolfinx.io.gmsh") is None:
        triple: tuple[Mesh, MeshTags, MeshTags]
        triple = import_module("dolfinx.io.gmshio").model_to_mesh(model, comm, 0, gdim=gdim)
        return triple
    data = import_module("dolfinx.io.gmsh").model_to_mesh(model, comm, 0, gdim=gdim)
    return data.mesh, data.cell_tags, data.facet_tags
