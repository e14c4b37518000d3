"""What of a distributed mesh a selector means; each rank looks at its own entities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from elastune.geometry.errors import GeometryError
from elastune.geometry.named import skin
from elastune.geometry.select.asked import Selector

if TYPE_CHECKING:
    from dolfinx.mesh import Mesh

    from elastune.geometry.distribute import Members

Array = NDArray[np.float64]
CORNERS = {"triangle": 3, "quadrilateral": 4, "tetrahedron": 4, "hexahedron": 8}


class Finder:
    """Vertices, bounds and skin of a mesh, for all its selectors."""

    def __init__(self, mesh: Mesh) -> None:
        """Looks at the mesh; collective."""
        self._mesh, self.dim = mesh, mesh.topology.dim
        topology = mesh.topology
        topology.create_entities(self.dim - 1)
        topology.create_connectivity(self.dim - 1, 0)
        corners = CORNERS[topology.cell_name()]
        cells = topology.connectivity(self.dim, 0).array.reshape(-1, corners)
        vertices = topology.index_map(0)
        self._x = np.zeros((vertices.size_local + vertices.num_ghosts, self.dim))
        self._x[cells] = mesh.geometry.x[mesh.geometry.dofmap[:, :corners], : self.dim]
        self._midpoints = self._x[cells].mean(axis=1)
        count = 2 if self.dim == 2 else 3 if corners == 4 else 4
        self._facets = topology.connectivity(self.dim - 1, 0).array.reshape(-1, count)
        self._skin = skin(mesh)
        x = mesh.geometry.x[:, : self.dim]
        self._low, self._high = x.min(axis=0, initial=np.inf), x.max(axis=0, initial=-np.inf)
        mesh.comm.Allreduce(MPI.IN_PLACE, self._low, op=MPI.MIN)
        mesh.comm.Allreduce(MPI.IN_PLACE, self._high, op=MPI.MAX)

    def facets(self, selector: Selector) -> NDArray[np.int32]:
        """Facets, owned and ghost, whose vertices all lie in a plane, or those of the skin in a solid; collective.

        Raises:
            GeometryError: There are none on any rank, or vectors have not the dimension of the mesh.
        """
        lie = self._holds(selector, self._x)[self._facets].all(axis=1)
        return self._found(selector, lie if selector.kind == "plane" else lie & self._skin, "facet")

    def cells(self, selector: Selector) -> NDArray[np.int32]:
        """Cells, owned and ghost, whose midpoint lies in a solid; collective; see `facets`."""
        return self._found(selector, self._holds(selector, self._midpoints), "cell")

    def _found(self, selector: Selector, mask: NDArray[np.bool_], what: str) -> NDArray[np.int32]:
        if not any(self._mesh.comm.allgather(bool(mask.any()))):
            bounds = f"from {_point(self._low)} to {_point(self._high)}"
            raise GeometryError(f"{selector.key} = {selector.text}: no {what} lies there; the body is {bounds}")
        return np.flatnonzero(mask).astype(np.int32)

    def _holds(self, selector: Selector, x: Array) -> NDArray[np.bool_]:
        """Whether each point lies in the plane or solid, shape (n,)."""
        slack = selector.tolerance * float((self._high - self._low).max())
        vectors = [np.array(vector) for vector in selector.vectors]
        if selector.kind == "plane":
            # A plane across x or y is the same in 2D, where it may be written before the dimension is known.
            vectors = [vector[: self.dim] if not vectors[0][self.dim :].any() else vector for vector in vectors]
        for vector in vectors:
            if len(vector) != self.dim:
                text = f"{selector.key} = {selector.text}"
                raise GeometryError(f"{text}: expected {self.dim} numbers, got {len(vector)}, in {self.dim}D")
        return np.asarray(_distance(selector, vectors, x) <= slack)


def _distance(selector: Selector, vectors: list[Array], x: Array) -> Array:
    """How far each point is from what is selected, shape (n,); negative or zero within a solid."""
    if selector.kind == "plane":
        normal, point = vectors
        return np.abs((x - point) @ normal)
    if selector.kind == "box":
        low, high = vectors
        return np.maximum(low - x, x - high).max(axis=1)
    if selector.kind == "sphere":
        return np.linalg.norm(x - vectors[0], axis=1) - selector.radius
    if selector.kind == "cylinder":
        axis, center = vectors
        away = x - center
        return np.linalg.norm(away - np.outer(away @ axis, axis), axis=1) - selector.radius
    return np.zeros(len(x))


def _point(x: Array) -> str:
    return "(" + ", ".join(f"{part:g}" for part in x) + ")"


def add(mesh: Mesh, members: Members, asked: tuple[dict[str, Selector], ...]) -> None:
    """Add the faces and the regions that are asked for to those that the mesh names; collective.

    Args:
        mesh: The mesh.
        members: What it names, and the groups that are asked for by number; gets the others.
        asked: Selectors of faces, and of regions.

    Raises:
        GeometryError: A selector finds nothing, or something else than what the mesh has by this name.
    """
    finder = Finder(mesh)
    for table, dim, look in zip(asked, (finder.dim - 1, finder.dim), (finder.facets, finder.cells), strict=True):
        known = members.setdefault(dim, {})
        for name, selector in table.items():
            if selector.kind == "tag":
                continue
            found = look(selector)
            if name in known:
                same = np.array_equal(found, np.sort(known[name][1]))
                if not all(mesh.comm.allgather(same)):
                    text = f"{selector.key} = {selector.text}"
                    raise GeometryError(f"{text}: the mesh has another {name!r}; expected a name of its own")
            else:
                known[name] = (max((number for number, _ in known.values()), default=0) + 1, found)
