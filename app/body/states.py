"""States in files, and on other meshes and elements."""

from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from elastune.app.body.body import Body
from elastune.app.body.unknowns import State
from elastune.app.errors import UserError

Array = NDArray[np.float64]

# Relative to a cell, how far outside the source's cells a point of the target may lie.
PADDING = 1e-6


def write(body: Body, state: State, path: Path) -> None:
    """Writes a state as values by cell of the mesh's source, which any number of ranks can read; collective.

    Args:
        body: Whose state it is.
        state: The state.
        path: An HDF5 file.
    """
    import h5py

    body.take(state)
    fields = {name: _by_cell(body, field) for name, field in _fields(body).items()}
    if body.comm.rank == 0:
        with h5py.File(path, "w") as file:
            file.attrs["element"], file.attrs["load"] = body.element, state.load
            for name, values in fields.items():
                file[name] = values


def read(body: Body, path: Path) -> State:
    """Reads a state of the same mesh and element; collective.

    Raises:
        UserError: If the file is of another mesh or element, or cannot be read.
    """
    import h5py

    mesh = body.geometry.mesh
    own = mesh.topology.original_cell_index[: mesh.topology.index_map(mesh.topology.dim).size_local]
    order = np.argsort(own)
    try:
        with h5py.File(path, "r") as file:
            found = file.attrs["element"], len(file["displacement"])
            if found != (body.element, body.geometry.cells_count):
                expected = f"{body.element} on {body.geometry.cells_count} cells"
                raise UserError(f"{path}: expected a state of {expected}, got {found[0]} on {found[1]}")
            for name, field in _fields(body).items():
                values = np.empty((len(own), *file[name].shape[1:]))
                if len(own):
                    values[order] = file[name][own[order]]
                    dofs = field.function_space.dofmap
                    field.x.array.reshape(-1, dofs.bs)[dofs.list[: len(own)]] = values
                field.x.scatter_forward()
            load = float(file.attrs["load"])
    except (OSError, KeyError) as error:
        raise UserError(f"{path}: expected the file of a state; {error}") from None
    return State(body.layout.joined(body.u.x.array, None if body.p is None else body.p.x.array), load)


def prolongated(state: State, source: Body, target: Body) -> State:
    """The state of one body as one of another: on another mesh of the same shape, or with another element.

    Pressures are carried over where both bodies have them, and are zero otherwise.

    Args:
        state: Of the source.
        source: One body.
        target: The other one, on the same ranks.
    """
    source.take(state)
    pairs = zip(_fields(source).items(), _fields(target).values(), strict=False)
    for (_, given), wanted in pairs:
        _carry(given, wanted)
    pressures = None if target.p is None else target.p.x.array
    return target.placed(target.layout.joined(target.u.x.array, pressures), state.load)


def _fields(body: Body) -> dict[str, fem.Function]:
    return {"displacement": body.u} | ({} if body.p is None else {"pressure": body.p})


def _by_cell(body: Body, field: fem.Function) -> Array:
    """Values of each cell, shape (cells, nodes of a cell, components), in the source's order; on rank 0."""
    mesh, dofs = body.geometry.mesh, field.function_space.dofmap
    count = mesh.topology.index_map(mesh.topology.dim).size_local
    # dolfinx divides by the number of cells.
    own: Any = field.x.array.reshape(-1, dofs.bs)[dofs.list[:count]] if count else None
    parts = body.comm.gather((mesh.topology.original_cell_index[:count], own))
    if parts is None:
        return np.empty(0)
    indices, values = zip(*((i, v) for i, v in parts if v is not None), strict=True)
    return np.concatenate(values)[np.argsort(np.concatenate(indices))]


def _carry(given: fem.Function, wanted: fem.Function) -> None:
    """Interpolates a field into another space."""
    mesh = wanted.function_space.mesh
    if given.function_space.mesh is mesh:
        wanted.interpolate(given)
    else:
        cells = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local, dtype=np.int32)
        data = fem.create_interpolation_data(wanted.function_space, given.function_space, cells, PADDING)
        wanted.interpolate_nonmatching(given, cells, data)
    wanted.x.scatter_forward()
