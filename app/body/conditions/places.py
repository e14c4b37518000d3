"""Where something happens to a body: on a face, a curve, at a point, or everywhere."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import basix
import numpy as np
import ufl
from dolfinx import fem, la
from dolfinx.mesh import entities_to_geometry
from numpy.typing import NDArray

from elastune.app.errors import UserError, meant
from elastune.forms.terms import Domain
from elastune.geometry import Geometry, GeometryError

Nodes = NDArray[np.int32]

# Of the body's extent: how far a node may be from a point that names it.
NEAR = 1e-6


@dataclass(frozen=True)
class Place(ABC):
    """A part of a body, by name.

    Attributes:
        name: What people call it; results are kept under it.
    """

    name: str

    @property
    @abstractmethod
    def key(self) -> str:
        """Its key in a scene."""

    @abstractmethod
    def nodes(self, geometry: Geometry, V: fem.FunctionSpace) -> Nodes:
        """Its nodes on this rank, owned and ghost, in ascending order, which dolfinx relies on; collective.

        Raises:
            UserError: If the mesh has no such place.
        """

    def centroid(self, geometry: Geometry, V: fem.FunctionSpace) -> NDArray[np.float64]:
        """Its centroid at rest, shape (3,); collective."""
        owned = V.dofmap.index_map.size_local
        return V.mesh.comm.allreduce(self.weights(geometry, V)[:owned] @ V.tabulate_dof_coordinates()[:owned])

    def weights(self, geometry: Geometry, V: fem.FunctionSpace) -> NDArray[np.float64]:
        """The share of each node in a force that is spread evenly over the place; collective.

        Returns:
            Over nodes of this rank, owned and ghost, shape (n,); right where they are owned, and one in sum over ranks.
        """
        nodes, index_map = self.nodes(geometry, V), V.dofmap.index_map
        found = np.zeros(index_map.size_local + index_map.num_ghosts)
        found[nodes] = 1.0
        return found / V.mesh.comm.allreduce(float(found[: index_map.size_local].sum()))


@dataclass(frozen=True)
class Face(Place):
    """A named face."""

    @property
    def key(self) -> str:
        """As in a scene."""
        return f"boundary.{self.name}"

    def nodes(self, geometry: Geometry, V: fem.FunctionSpace) -> Nodes:
        """See `Place`."""
        if self.name not in geometry.faces:
            said = meant(self.name, geometry.faces, "the mesh has") if geometry.faces else "name some in [mesh.faces]"
            raise UserError(f"{self.key}: unknown face; {said}")
        return fem.locate_dofs_topological(V, geometry.mesh.topology.dim - 1, geometry.facets(self.name))

    def centroid(self, geometry: Geometry, V: fem.FunctionSpace) -> NDArray[np.float64]:
        """See `Place`; of facets as flat as their corners, which asks for no compiled form."""
        mesh, d = geometry.mesh, geometry.mesh.topology.dim - 1
        facets = geometry.facets(self.name)
        own = facets[facets < mesh.topology.index_map(d).size_local]
        corners = {"triangle": 2, "quadrilateral": 2, "tetrahedron": 3, "hexahedron": 4}[mesh.topology.cell_name()]
        total = np.zeros(4)
        if len(own):
            x = mesh.geometry.x[entities_to_geometry(mesh, d, own)[:, :corners]]
            # A quadrilateral as two triangles, its corners in dolfinx's order.
            for part in [x] if corners < 4 else [x[:, :3], x[:, 1:]]:
                sides = part[:, 1:] - part[:, :1]
                area = np.linalg.norm(sides[:, 0] if corners == 2 else np.cross(sides[:, 0], sides[:, 1]), axis=1)
                total += np.append(area @ part.mean(axis=1), area.sum())
        total = mesh.comm.allreduce(total)
        return total[:3] / total[3]

    def weights(self, geometry: Geometry, V: fem.FunctionSpace) -> NDArray[np.float64]:
        """See `Place`: by area."""
        domain = Domain(V.mesh, 1, 2 * V.element.basix_element.degree + 2, {self.name: geometry.facets(self.name)})
        v = ufl.TestFunction(V)
        shape = (V.dofmap.index_map_bs,)
        b = fem.assemble_vector(fem.form(ufl.inner(fem.Constant(V.mesh, np.ones(shape)), v) * domain.ds(self.name)))
        return _spread(b, V)


@dataclass(frozen=True)
class Curve(Place):
    """A named curve of a solid."""

    @property
    def key(self) -> str:
        """As in a scene."""
        return f"curve.{self.name}"

    def nodes(self, geometry: Geometry, V: fem.FunctionSpace) -> Nodes:
        """See `Place`."""
        try:
            edges = geometry.edges(self.name)
        except GeometryError as error:
            raise UserError(f"{self.key}: {error}") from None
        return fem.locate_dofs_topological(V, 1, edges)

    def weights(self, geometry: Geometry, V: fem.FunctionSpace) -> NDArray[np.float64]:
        """See `Place`: by length, of edges as they are straight."""
        mesh, topology = V.mesh, V.mesh.topology
        element = V.element.basix_element
        line = basix.create_element(
            basix.ElementFamily.P, basix.CellType.interval, max(element.degree, 1), element.lagrange_variant
        )
        points, factors = basix.make_quadrature(basix.CellType.interval, 2 * line.degree)
        of_nodes = factors @ line.tabulate(0, points)[0, :, :, 0]
        topology.create_connectivity(1, topology.dim)
        topology.create_connectivity(topology.dim, 1)
        edges = geometry.edges(self.name)
        b = la.vector(V.dofmap.index_map, V.dofmap.index_map_bs)
        found = b.array.reshape(-1, V.dofmap.index_map_bs)
        for edge in edges[edges < topology.index_map(1).size_local]:
            cell = topology.connectivity(1, topology.dim).links(edge)[0]
            local = int(np.flatnonzero(topology.connectivity(topology.dim, 1).links(cell) == edge)[0])
            ends = mesh.geometry.x[entities_to_geometry(mesh, 1, np.array([edge], dtype=np.int32))[0]]
            nodes = V.dofmap.cell_dofs(cell)[V.dofmap.dof_layout.entity_closure_dofs(1, local)]
            found[nodes] += np.linalg.norm(ends[1] - ends[0]) * of_nodes[: len(nodes), None]
        return _spread(b, V)


@dataclass(frozen=True)
class Point(Place):
    """A node, by its place at rest or by its name in the mesh file.

    Attributes:
        at: Coordinates, shape (2,) or (3,), or None for a named one.
    """

    at: tuple[float, ...] | None = None

    @property
    def key(self) -> str:
        """As in a scene."""
        return f"point.{self.name}"

    def nodes(self, geometry: Geometry, V: fem.FunctionSpace) -> Nodes:
        """See `Place`."""
        if self.at is not None:
            return _nearest(self.key, self.at, V)
        try:
            vertices = geometry.vertices(self.name)
        except GeometryError as error:
            raise UserError(f"{self.key}: {error}; or give it a place, at = [x, y, z]") from None
        return fem.locate_dofs_topological(V, 0, vertices)


@dataclass(frozen=True)
class Pin(Point):
    """A node that stays where it is while a body finds home."""

    @property
    def key(self) -> str:
        """As in a scene."""
        return "start.pins"


@dataclass(frozen=True)
class Everywhere(Place):
    """The whole body."""

    name: str = "body"

    @property
    def key(self) -> str:
        """As in a scene."""
        return "body"

    def nodes(self, geometry: Geometry, V: fem.FunctionSpace) -> Nodes:
        """See `Place`."""
        index_map = V.dofmap.index_map
        return np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)


def _spread(b: la.Vector, V: fem.FunctionSpace) -> NDArray[np.float64]:
    """Weights from a vector of parts of a measure, each rank's own."""
    b.scatter_reverse(la.InsertMode.add)
    first = b.array.reshape(-1, V.dofmap.index_map_bs)[:, 0].copy()
    return first / V.mesh.comm.allreduce(float(first[: V.dofmap.index_map.size_local].sum()))


def _nearest(key: str, at: tuple[float, ...], V: fem.FunctionSpace) -> Nodes:
    comm, d = V.mesh.comm, V.dofmap.index_map_bs
    points = V.tabulate_dof_coordinates()
    if len(at) != d:
        raise UserError(f"{key}: {list(at)}: expected {d} coordinates")
    distance = np.linalg.norm(points[:, :d] - np.array(at), axis=1)
    ends = comm.allgather((points.min(axis=0, initial=np.inf).tolist(), points.max(axis=0, initial=-np.inf).tolist()))
    extent = float((np.max([high for _, high in ends], axis=0) - np.min([low for low, _ in ends], axis=0)).max())
    closest = int(distance.argmin()) if len(distance) else None
    own = (np.inf, []) if closest is None else (float(distance[closest]), points[closest, :d].tolist())
    least, place = min(comm.allgather(own))
    if least > NEAR * extent:
        raise UserError(f"{key}: {list(at)} is no node of the mesh; the nearest is at {[round(x, 6) for x in place]}")
    return np.flatnonzero(distance <= NEAR * extent).astype(np.int32)
