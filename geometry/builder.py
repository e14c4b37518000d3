"""From a request to a distributed mesh with named faces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING

from elastune.geometry.errors import GeometryError
from elastune.geometry.named import Geometry
from elastune.geometry.session import on_root, session
from elastune.geometry.shapes import Plan, check_order, make_plan

if TYPE_CHECKING:
    from dolfinx.mesh import Mesh
    from mpi4py import MPI


def build(
    comm: MPI.Comm,
    shape: str = "cube",
    size: float | Sequence[float] = 1.0,
    cells: int | Sequence[int] = 10,
    cell: str = "hexahedron",
    h: float | None = None,
    order: int = 1,
    grade: Mapping[str, float] | None = None,
    path: str | PathLike[str] | None = None,
    refine: int = 0,
) -> Geometry:
    """Build a mesh with named faces; collective.

    A cube, box, square or rectangle has a corner at the origin and its edges along the axes; a cylinder
    stands on z = 0 about the z axis. Faces: left and right (x), front and back (y), bottom and top (z);
    in 2D left and right (x), bottom and top (y); of a cylinder bottom, top and side.

    Args:
        comm: Communicator of the mesh. gmsh runs on rank 0.
        shape: "cube", "box", "cylinder", "square", "rectangle" or "file".
        size: Edge of a cube or square; [x, y, z] of a box; [x, y] of a rectangle; [radius, height] of a
            cylinder. Any unit of length; the mesh has the same.
        cells: Cells along the longest edge, across the diameter of a cylinder (at least 4), the other
            directions in proportion; or one count for each edge, [across, along] for a cylinder.
        cell: "hexahedron" or "tetrahedron" (six in the place of a hexahedron); in 2D "quadrilateral" or
            "triangle" (two).
        h: Size of the cells, used instead of `cells`: the edges are cut in parts of at most h.
        order: 1 for straight cells, 2 for curved ones, whose nodes all lie on the cylinder's side.
        grade: Size of the cells at a face over the average size along that direction, by face, from
            0.01 to 1. Sizes change smoothly to the opposite face, symmetrically if both have one ratio.
            Towards a cylinder's side the ring outside the square core is graded, half of the radius.
        path: Gmsh's `.msh` file, for shape "file". Its named physical groups of surfaces (curves in 2D)
            become faces, those of volumes regions. Cells keep their type and size, and their order
            unless `order` is higher; `size`, `cells`, `cell` and `h` do not matter.
        refine: For shape "file": how often each cell is split, with 2 parts along each edge. Its cells must
            be straight, of order 1.

    Returns:
        The mesh and its faces.

    Raises:
        GeometryError: On every rank; an argument is impossible, or the file has no usable mesh.
    """
    if shape == "file":
        return _from_file(comm, path, order, grade, refine)
    if path is not None:
        raise GeometryError(f'path = {str(path)!r}: expected shape = "file" with it, got {shape!r}')
    if refine:
        raise GeometryError(f'refine = {refine!r}: expected shape = "file" with it, got {shape!r}; use cells')
    plan = make_plan(shape, size, cells, cell, h, order, grade)

    from elastune.geometry.compat import model_to_mesh
    from elastune.geometry.sections import make_model

    with session(comm) as model:
        on_root(comm, lambda: make_model(model, plan))
        mesh, _, facet_tags = model_to_mesh(model, comm, plan.shape.dim)
    _stretch(mesh, plan)
    return Geometry(mesh, facet_tags, {name: tag for tag, name in enumerate(plan.shape.faces, start=1)})


def _stretch(mesh: Mesh, plan: Plan) -> None:
    """Bring a mesh of unit size to its lengths, graded.

    Along an extruded or straight direction all nodes lie on layers, between cells or through their
    middles, so a node takes the place of its layer: exactly, where gmsh's own places carry errors of 1e-9.
    """
    import numpy as np

    from elastune.geometry.grading import knots

    x = mesh.geometry.x
    if plan.round:
        x[:, :2] *= plan.lengths[0]
    for direction in range(1 if plan.round else 0, len(plan.counts)):
        axis, count = (2 if plan.round else direction), plan.counts[direction]
        ends = knots(plan.lengths[direction], count, *plan.grades(direction))
        layers = np.interp(np.linspace(0.0, count, plan.order * count + 1), np.arange(count + 1), ends)
        x[:, axis] = layers[np.rint(x[:, axis] * plan.order * count).astype(np.int64)]


def _from_file(
    comm: MPI.Comm, path: str | PathLike[str] | None, order: int, grade: Mapping[str, float] | None, refine: int
) -> Geometry:
    if path is None:
        raise GeometryError('path: expected the path of a .msh file with shape = "file", got none')
    check_order(order)
    if grade:
        raise GeometryError(f'grade = {grade!r}: expected none with shape = "file", whose cells are given')

    from mpi4py import MPI

    from elastune.geometry.compat import model_to_mesh
    from elastune.geometry.msh import load

    with session(comm) as model:
        content = on_root(comm, lambda: load(model, path, order, refine))
        mesh, cell_tags, facet_tags = model_to_mesh(model, comm, content.dim)
    g = Geometry(mesh, facet_tags, content.faces, cell_tags if content.grouped else None, content.regions)
    owned = mesh.topology.index_map(content.dim - 1).size_local
    for name, count in content.facets.items():
        found = comm.allreduce(int((g.facets(name) < owned).sum()), op=MPI.SUM)
        if found != count:
            raise GeometryError(f"{path}: face {name!r}: expected {count} facets of cells, got {found}")
    return g
