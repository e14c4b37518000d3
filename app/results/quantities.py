"""Numbers that people read off a solution: forces and moments of faces, displacements of points."""

from collections.abc import Mapping, Sequence

import numpy as np
from dolfinx import fem, geometry
from dolfinx.mesh import Mesh
from mpi4py import MPI
from numpy.typing import NDArray

from elastune.app.errors import UserError

Array = NDArray[np.float64]
Nodes = NDArray[np.int32]

# How far outside its nearest cell a point may lie, over the size of that cell: cells cut the corners of round bodies.
OUTSIDE = 0.1


def force(u: fem.Function, forces: Array, nodes: Nodes) -> Array:
    """Sum of the nodal forces of a face over all ranks, shape (3,).

    Args:
        u: Displacement.
        forces: Of the nodes of this rank, owned first, shape (n, d).
        nodes: Of the face on this rank, owned and ghost.
    """
    return u.function_space.mesh.comm.allreduce(_owned(u, forces, nodes)[1].sum(axis=0))


def moment(u: fem.Function, forces: Array, nodes: Nodes) -> Array:
    """Moment of the nodal forces about the origin, at the places where the nodes are now, shape (3,)."""
    V = u.function_space
    d = V.dofmap.index_map_bs
    own, padded = _owned(u, forces, nodes)
    places = V.tabulate_dof_coordinates()[own]
    places[:, :d] += u.x.array.reshape(-1, d)[own]
    return V.mesh.comm.allreduce(np.cross(places, padded).sum(axis=0))


def _owned(u: fem.Function, forces: Array, nodes: Nodes) -> tuple[Nodes, Array]:
    """Those of the nodes that this rank owns, and their forces, shape (n, 3)."""
    dofmap = u.function_space.dofmap
    own = nodes[nodes < dofmap.index_map.size_local]
    return own, np.pad(forces[own], ((0, 0), (0, 3 - dofmap.index_map_bs)))


class Probes:
    """Material points of a body by name; each is evaluated by one rank, in the cell that holds it.

    Attributes:
        names: Of the points.
    """

    def __init__(self, u: fem.Function, points: Mapping[str, Sequence[float]], table: str = "points") -> None:
        """Finds the cells; collective.

        Args:
            u: Displacement, of any degree.
            points: Places at rest by name, shape (2,) in a plane body, else (3,).
            table: What people call the table of points.

        Raises:
            UserError: If a point has another number of coordinates, or lies outside the body.
        """
        mesh = u.function_space.mesh
        self._u, self._comm, self._dimension = u, mesh.comm, mesh.geometry.dim
        for name, at in points.items():
            if len(at) != self._dimension:
                raise UserError(f"{table}.{name} = {list(at)}: expected {self._dimension} coordinates")
        self.names = list(points)
        self._places = np.array([[*at, *[0.0] * (3 - len(at))] for at in points.values()]).reshape(-1, 3)
        cells, outside = _nearest(mesh, self._places)
        # Of the ranks that are as near, the first has it.
        near = np.array(self._comm.allgather(outside)).reshape(self._comm.size, -1)
        for k, name in enumerate(self.names):
            if near[:, k].min() > OUTSIDE:
                raise UserError(f"{table}.{name} = {list(points[name])}: lies outside the body")
        self._own = np.flatnonzero(near.argmin(axis=0) == self._comm.rank)
        self._cells = cells[self._own]

    def displacements(self) -> dict[str, list[float]]:
        """Displacement of each point along x, y (and z) in the present state; collective."""
        values = np.zeros((len(self.names), self._dimension))
        if len(self._own):
            values[self._own] = self._u.eval(self._places[self._own], self._cells).reshape(len(self._own), -1)
        total = self._comm.allreduce(values, op=MPI.SUM) if self.names else values
        return dict(zip(self.names, total.tolist(), strict=True))


def _nearest(mesh: Mesh, places: Array) -> tuple[NDArray[np.int32], Array]:
    """For each place the nearest cell that this rank owns, and the distance from it over its size."""
    dimension = mesh.topology.dim
    owned = np.arange(mesh.topology.index_map(dimension).size_local, dtype=np.int32)
    if not (len(owned) and len(places)):
        return np.full(len(places), -1, dtype=np.int32), np.full(len(places), np.inf)
    tree = geometry.bb_tree(mesh, dimension, entities=owned)
    middles = geometry.create_midpoint_tree(mesh, dimension, owned)
    cells = geometry.compute_closest_entity(tree, middles, mesh, places)
    squared = geometry.squared_distance(mesh, dimension, cells, places)
    return cells, np.sqrt(squared) / mesh.h(dimension, cells)
