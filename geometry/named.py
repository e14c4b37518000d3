"""A distributed mesh whose faces, regions, curves and points have names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from elastune.geometry.errors import GeometryError

if TYPE_CHECKING:
    import numpy as np
    from dolfinx.mesh import Mesh, MeshTags
    from mpi4py import MPI
    from numpy.typing import NDArray

    Indices = NDArray[np.int32]
    # Names of a kind: the tag of each, or several where it shares entities with another name; a measure takes both.
    Names = Mapping[str, Any]

MOST_LISTED = 20


@dataclass(frozen=True, eq=False)
class Geometry:
    """A mesh and its named faces; regions, and in 3D curves and points, where a file or a selector names them.

    Tags are disjoint; a name stands for one tag, or for several where it has entities in common with another name.

    Attributes:
        mesh: The distributed mesh; lengths in the unit of the sizes it was built from.
        facet_tags: Tags of the facets of the named faces.
        faces: Tags of each face, by name.
        cell_tags: Tags of the cells, None unless some belong to a region.
        regions: Tags of each region, by name.
        edge_tags: Tags of the edges of named curves, None unless there are some; in 2D curves are faces.
        curves: Tags of each curve, by name.
        vertex_tags: Tags of named vertices, None unless there are some.
        points: Tags of each group of vertices, by name.
    """

    mesh: Mesh
    facet_tags: MeshTags
    faces: Names
    cell_tags: MeshTags | None = None
    regions: Names = field(default_factory=dict)
    edge_tags: MeshTags | None = None
    curves: Names = field(default_factory=dict)
    vertex_tags: MeshTags | None = None
    points: Names = field(default_factory=dict)

    @property
    def cells_count(self) -> int:
        """Number of cells over all ranks."""
        topology = self.mesh.topology
        return int(topology.index_map(topology.dim).size_global)

    def facets(self, name: str) -> Indices:
        """Facets of a face on this rank.

        Args:
            name: A key of `faces`.

        Returns:
            Local facet indices, owned and ghost, ascending, shape (n,), int32; empty on a rank that holds none.

        Raises:
            GeometryError: No face has this name.
        """
        return _find("face", name, self.faces, self.facet_tags)

    def inside(self, name: str) -> bool:
        """Whether some facet of a face has cells on both sides; collective."""
        return any(self.mesh.comm.allgather(len(self.interior(name)) > 0))

    def cells(self, name: str) -> Indices:
        """Cells of a region on this rank, see `facets`."""
        return _find("region", name, self.regions, self.cell_tags)

    def edges(self, name: str) -> Indices:
        """Edges of a curve on this rank, see `facets`."""
        return _find("curve", name, self.curves, self.edge_tags)

    def vertices(self, name: str) -> Indices:
        """Vertices of a group of points on this rank, see `facets`."""
        return _find("point", name, self.points, self.vertex_tags)

    def exterior(self, name: str) -> Indices:
        """Facets of a face that have a cell on one side only, on this rank, owned and ghost; collective."""
        facets = self.facets(name)
        return facets[skin(self.mesh)[facets]]

    def interior(self, name: str) -> Indices:
        """Facets of a face that have cells on both sides, on this rank, owned and ghost; collective."""
        facets = self.facets(name)
        return facets[~skin(self.mesh)[facets]]

    def volume(self) -> float:
        """Volume of the mesh (area in 2D), integrated over its curved cells; collective."""
        import ufl
        from dolfinx import fem
        from mpi4py import MPI

        one = fem.Constant(self.mesh, self.mesh.geometry.x.dtype.type(1))
        local = fem.assemble_scalar(fem.form(one * ufl.dx(self.mesh)))
        return float(self.mesh.comm.allreduce(local, op=MPI.SUM))


def skin(mesh: Mesh) -> NDArray[np.bool_]:
    """Whether each facet of this rank, owned or ghost, has a cell on one side only; collective.

    A facet between two ranks has one cell on each: only its owner knows.
    """
    import numpy as np
    from dolfinx import la
    from dolfinx.mesh import exterior_facet_indices

    topology = mesh.topology
    topology.create_connectivity(topology.dim - 1, topology.dim)
    outer = la.vector(topology.index_map(topology.dim - 1), 1, np.float64)
    outer.array[exterior_facet_indices(topology)] = 1
    outer.scatter_forward()
    return np.asarray(outer.array > 0)


def tagged(
    mesh: Mesh, dim: int, members: Mapping[str, Indices], numbers: Mapping[str, int]
) -> tuple[MeshTags, dict[str, int | tuple[int, ...]]]:
    """Tags of the entities of one dimension that have names, and the tags of each name; collective.

    Args:
        mesh: With these entities.
        dim: Their dimension.
        members: Local indices, owned and ghost, by name.
        numbers: Of each name, different and positive: its tag, unless entities have several names.
    """
    from dolfinx.mesh import meshtags

    from elastune.geometry.pieces import pieces

    comm: MPI.Comm = mesh.comm
    indices, values, tags = pieces(members, numbers, comm)
    return meshtags(mesh, dim, indices, values), tags


def _find(kind: str, name: str, names: Names, tags: MeshTags | None) -> Indices:
    import numpy as np

    if name not in names or tags is None:
        raise GeometryError(f"{kind} {name!r}: expected one of {listed(names)}")
    wanted = names[name]
    found = tags.indices[np.isin(tags.values, wanted)]
    return np.unique(found).astype(np.int32)


def listed(names: Names) -> str:
    """Names for a message; of very many the first."""
    shown = list(names)[:MOST_LISTED]
    more = f", … ({len(names)} in all)" if len(names) > MOST_LISTED else ""
    return ", ".join(shown) + more if names else "none: the mesh names none"
