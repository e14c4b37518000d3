"""Rigid motions of a body's pieces that nothing holds."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from elastune.app.body.conditions.constraints import Constraints
from elastune.app.body.conditions.loads import Spring
from elastune.app.body.conditions.stages import Stage
from elastune.app.errors import UserError
from elastune.geometry import Geometry

Array = NDArray[np.float64]

# Of the largest eigenvalue, in lengths of the piece squared: what is held by less is free.
FREE = 1e-11


class Piece(NamedTuple):
    """A part of the body that hangs together.

    Attributes:
        nodes: On this rank, owned.
        center: Mean of its nodes at rest, shape (d,).
        size: Of its extent, for modes without a unit.
        free: Its rigid motions that nothing holds, a column each: translations, then turns about its centre over its
            size.
    """

    nodes: NDArray[np.int64]
    center: Array
    size: float
    free: Array


def pieces(V: fem.FunctionSpace, held: Array) -> list[Piece]:
    """The pieces of a body, the one with the lowest node first; collective.

    Args:
        V: Displacement space.
        held: How strongly each degree of freedom is held, owned and ghost; zero where it is free.
    """
    comm, d = V.mesh.comm, V.dofmap.index_map_bs
    owned = V.dofmap.index_map.size_local
    labels, count = _labels(V)
    points, held = V.tabulate_dof_coordinates()[:owned, :d], held.reshape(-1, d)[:owned]
    found = []
    for label in range(count):
        nodes = np.flatnonzero(labels[:owned] == label)
        X = points[nodes]
        total = comm.allreduce(np.append(X.sum(axis=0), len(X)))
        low, high = X.min(axis=0, initial=np.inf), X.max(axis=0, initial=-np.inf)
        comm.Allreduce(MPI.IN_PLACE, low, op=MPI.MIN)
        comm.Allreduce(MPI.IN_PLACE, high, op=MPI.MAX)
        center, size = total[:d] / total[d], float((high - low).max()) or 1.0
        modes = motions((X - center) / size)
        rows = modes[held[nodes] > 0]
        values, vectors = np.linalg.eigh(comm.allreduce(rows.T @ rows))
        found.append(Piece(nodes, center, size, vectors[:, values <= FREE * max(values[-1], 1.0)]))
    return found


def motions(X: Array) -> Array:
    """Values of the rigid motions at points of shape (n, d), shape (n, d, 3 or 6)."""
    n, d = X.shape
    modes = np.zeros((n, d, d + len(_turns(d))))
    modes[:, range(d), range(d)] = 1.0
    padded = np.pad(X, ((0, 0), (0, 3 - d)))
    for k, axis in enumerate(_turns(d)):
        modes[:, :, d + k] = np.cross(np.eye(3)[axis], padded)[:, :d]
    return modes


def _turns(d: int) -> list[int]:
    """Axes about which a body of 2 or 3 dimensions turns."""
    return [2] if d == 2 else [0, 1, 2]


def _labels(V: fem.FunctionSpace) -> tuple[NDArray[np.int64], int]:
    """The piece of each node on this rank, owned and ghost, and the number of all pieces."""
    comm, index_map = V.mesh.comm, V.dofmap.index_map
    n = index_map.size_local + index_map.num_ghosts
    dofs = V.dofmap.list.reshape(-1, V.dofmap.list.shape[1]) if len(V.dofmap.list) else np.empty((0, 1), dtype=np.int32)
    rows = np.repeat(dofs[:, 0], dofs.shape[1])
    count, own = connected_components(coo_matrix((np.ones(len(rows)), (rows, dofs.ravel())), shape=(n, n)), False)
    # A number for each part that hangs together on one rank; those that share a node are one piece.
    first = comm.exscan(count) or 0
    total = comm.allreduce(count)
    number = fem.Function(V)
    values = number.x.array.reshape(n, V.dofmap.index_map_bs)
    values[:] = (own + first)[:, None]
    number.x.scatter_forward()
    pairs = np.unique(np.stack([own + first, values[:, 0].astype(np.int64)], axis=1), axis=0)
    joined = np.concatenate(comm.allgather(pairs))
    graph = coo_matrix((np.ones(len(joined)), tuple(joined.T)), shape=(total, total))
    together = connected_components(graph, False)[1]
    # In the order of their lowest corner, the same on any number of ranks.
    corner = np.full((together.max(initial=-1) + 1, 3), np.inf)
    points = V.tabulate_dof_coordinates()
    for label in np.unique(together[own + first]):
        mine = points[together[own + first] == label]
        corner[label] = mine[np.lexsort(mine.T)[0]]
    corners = np.array(comm.allgather(corner))
    lowest = [min(map(tuple, corners[:, k, ::-1])) for k in range(corners.shape[1])]
    rank = {label: place for place, label in enumerate(sorted(range(len(lowest)), key=lambda k: lowest[k]))}
    return np.array([rank[label] for label in together], dtype=np.int64)[own + first], len(rank)


def names(piece: Piece, d: int) -> str:
    """Its free motions in words."""
    free, turns = piece.free, _turns(d)
    slides = [axis for axis in range(d) if _within(free, np.eye(len(free))[axis])]
    about = []
    for k, axis in enumerate(turns):
        # A turn about some line along the axis: whatever translation goes with it.
        rest = np.delete(free, d + k, axis=0)[d:]
        kernel = np.linalg.svd(rest)[2][np.linalg.matrix_rank(rest, tol=1e-6) :] if len(rest) else np.eye(free.shape[1])
        if len(kernel) and np.abs(free[d + k] @ kernel.T).max() > 1e-6:
            about.append(axis)
    words = []
    if slides:
        words.append(f"slide along {_listed('xyz'[axis] for axis in slides)}")
    if about:
        words.append("turn" if d == 2 else f"turn about {_listed('xyz'[axis] for axis in about)}")
    if len(slides) + len(about) < free.shape[1]:
        others = free.shape[1] - len(slides) - len(about)
        words.append(f"move in {others} other way{'s' * (others > 1)}" if words else f"move in {others} ways")
    return " and to ".join(words)


def complaint(found: Sequence[Piece], d: int) -> str | None:
    """What nothing holds, in a line, or None."""
    free = [piece for piece in found if piece.free.shape[1]]
    if not free:
        return None
    piece = free[0]
    number = piece.free.shape[1]
    what = f"{number} rigid motion{'s are' if number > 1 else ' is'} not held"
    if len(found) == 1:
        return f"the body is free to {names(piece, d)}: {what}; hold it by fix, move, roller, a point or a spring"
    where = ", ".join(f"{x:.4g}" for x in piece.center)
    if number == len(piece.free):
        how = f"the one around ({where}) is held by nothing"
    else:
        how = f"the one around ({where}) is free to {names(piece, d)}: {what}"
    return f"the mesh is in {len(found)} pieces, and {how}; join them in the mesh (gmsh: fragment), or hold each"


def pushed(V: fem.FunctionSpace, found: Sequence[Piece], forces: Array) -> bool:
    """Whether nodal forces, shape (owned nodes, d), do work on free motions; collective."""
    d = V.dofmap.index_map_bs
    points = V.tabulate_dof_coordinates()
    for piece in found:
        modes = motions((points[piece.nodes, :d] - piece.center) / piece.size) @ piece.free
        own = np.einsum("ni,nik->nk", forces[piece.nodes], modes)
        most = np.einsum("ni,nik->k", np.abs(forces[piece.nodes]), np.abs(modes))
        total = V.mesh.comm.allreduce(np.stack([own.sum(axis=0), most]))
        if (np.abs(total[0]) > 1e-8 * total[1].max(initial=0.0)).any():
            return True
    return False


def keep(
    constraints: Constraints, geometry: Geometry, V: fem.FunctionSpace, stage: Stage, free: bool
) -> tuple[list[Piece], str | None]:
    """Counts what holds a body, springs too, and supports what is left free if it may be; collective.

    Returns:
        The pieces as they were without supports, and what nothing holds, in a line, or None.

    Raises:
        UserError: If something is free that may not be.
    """
    holding = constraints.held.astype(float).reshape(-1, V.dofmap.index_map_bs)
    for place, conditions in stage.items():
        for spring in (condition for condition in conditions if isinstance(condition, Spring)):
            holding[place.nodes(geometry, V)] += np.array(spring.stiffness) > 0
    found = pieces(V, holding.ravel())
    said = complaint(found, V.dofmap.index_map_bs)
    if said is not None and not free:
        raise UserError(f"boundary: {said}")
    hold(constraints, V, found)
    return found, said


def hold(constraints: Constraints, V: fem.FunctionSpace, found: Sequence[Piece]) -> None:
    """Holds just enough nodes of pieces that are free; the same ones on any number of ranks.

    Where the loads do no work on the free motions these supports carry nothing.
    """
    comm, d = V.mesh.comm, V.dofmap.index_map_bs
    points = V.tabulate_dof_coordinates()
    for piece in found:
        free = piece.free
        modes = motions((points[piece.nodes, :d] - piece.center) / piece.size)
        while free.shape[1]:
            reach = np.linalg.norm(modes @ free, axis=2)
            best = (-np.inf, (), -1, -1)
            for i, c in np.argwhere(reach > reach.max(initial=0.0) - 1e-9):
                place = tuple(np.round((points[piece.nodes[i], :d] - piece.center) / piece.size, 7).tolist())
                best = max(best, (round(float(reach[i, c]), 7), (*place, -int(c)), int(i), int(c)))
            chosen = max(comm.allgather((best[:2], comm.rank)))
            node = int(piece.nodes[best[2]]) if chosen[1] == comm.rank else None
            component = comm.bcast(best[3], chosen[1])
            row = comm.bcast(None if node is None else modes[best[2], component] @ free, chosen[1])
            constraints.support(_everywhere(V, node, chosen[1]), component)
            free = free @ np.linalg.svd(row[None])[2][1:].T


def _everywhere(V: fem.FunctionSpace, node: int | None, owner: int) -> int | None:
    """This rank's number of a node of another one, or None if it does not have it."""
    index_map = V.dofmap.index_map
    known = index_map.local_to_global(np.array([] if node is None else [node], dtype=np.int32))
    number = V.mesh.comm.bcast(int(known[0]) if len(known) else None, owner)
    found = index_map.global_to_local(np.array([number], dtype=np.int64))[0]
    return None if found < 0 else int(found)


def _within(free: Array, motion: Array) -> bool:
    return bool(np.linalg.norm(motion - free @ (free.T @ motion)) < 1e-6)


def _listed(words: Iterable[str]) -> str:
    *most, last = words
    return f"{', '.join(most)} and {last}" if most else last
