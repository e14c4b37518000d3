"""A distributed mesh whose faces have names."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from elastune.geometry.errors import GeometryError

if TYPE_CHECKING:
    import numpy as np
    from dolfinx.mesh import Mesh, MeshTags
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Geometry:
    """A mesh, its named faces and, where a file has them, its named regions.

    Attributes:
        mesh: The distributed mesh; lengths in the unit of the sizes it was built from.
        facet_tags: Tags of the facets of the named faces.
        faces: Tag of each face, by name.
        cell_tags: Tags of the cells, None unless a file groups its cells.
        regions: Tag of each named group of cells, by name.
    """

    mesh: Mesh
    facet_tags: MeshTags
    faces: dict[str, int]
    cell_tags: MeshTags | None = None
    regions: dict[str, int] = field(default_factory=dict)

    @property
    def cells_count(self) -> int:
        """Number of cells over all ranks."""
        topology = self.mesh.topology
        return int(topology.index_map(topology.dim).size_global)

    def facets(self, name: str) -> NDArray[np.int32]:
        """Facets of a named face on this rank.

        Args:
            name: A key of `faces`.

        Returns:
            Local facet indices, shape (n,), int32; empty on a rank that holds none.

        Raises:
            GeometryError: No face has this name.
        """
        if name not in self.faces:
            raise GeometryError(f"face {name!r}: expected one of {', '.join(self.faces)}")
        return self.facet_tags.find(self.faces[name])

    def cells(self, name: str) -> NDArray[np.int32]:
        """Cells of a region on this rank, owned and ghost, see `facets`."""
        if name not in self.regions or self.cell_tags is None:
            raise GeometryError(f"region {name!r}: expected one of {', '.join(self.regions) or 'none'}")
        return self.cell_tags.find(self.regions[name])

    def volume(self) -> float:
        """Volume of the mesh (area in 2D), integrated over its curved cells; collective."""
        import ufl
        from dolfinx import fem
        from mpi4py import MPI

        one = fem.Constant(self.mesh, self.mesh.geometry.x.dtype.type(1))
        local = fem.assemble_scalar(fem.form(one * ufl.dx(self.mesh)))
        return float(self.mesh.comm.allreduce(local, op=MPI.SUM))
