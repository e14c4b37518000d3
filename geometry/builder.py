"""From a request to a distributed mesh with named faces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

from elastune.geometry.errors import GeometryError
from elastune.geometry.named import Geometry
from elastune.geometry.select.asked import Selector, selectors
from elastune.geometry.session import on_root, session
from elastune.geometry.shapes import Plan, check_order, make_plan

if TYPE_CHECKING:
    from dolfinx.mesh import Mesh
    from mpi4py import MPI

    from elastune.geometry.distribute import Members


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
    faces: Mapping[str, Mapping[str, Any]] | None = None,
    regions: Mapping[str, Mapping[str, Any]] | None = None,
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
        path: For shape "file": a mesh (`elastune.geometry.files.read.MESHES`), or a body that gmsh meshes with
            tetrahedra of size `h` (`BODIES`). The physical groups of surfaces (curves in 2D) become faces, those
            of volumes regions, by name or else by number; geometric entities in no group are reachable by number
            too. Cells keep their type and size, and their order unless `order` is higher.
        refine: For shape "file": how often each cell is split, with 2 parts along each edge. Its cells must
            be straight, of order 1.
        faces: Further faces by name, each a selector: {"tag": 3}, a group or else an entity of this number;
            {"plane": "z", "at": 0.0} or {"plane": {"normal": [...], "point": [...]}}, facets in it, inner ones too;
            {"box": [[...], [...]]}, {"sphere": {"center", "radius"}}, {"cylinder": {"axis", "center", "radius"}},
            facets of the skin with all vertices within; {"all": True}, the skin. "tolerance" in each is a part of
            the body's largest extent, 1e-6 by default.
        regions: Further regions by name: cells whose midpoint lies within, with selectors as above but the plane.

    Returns:
        The mesh and its faces.

    Raises:
        GeometryError: On every rank; an argument is impossible, a selector finds nothing, or the file has no usable
            mesh.
    """
    if shape == "file":
        asked = (selectors("faces", faces, None), selectors("regions", regions, None))
        return _from_file(comm, path, order, grade, refine, h, asked)
    if path is not None:
        raise GeometryError(f'path = {str(path)!r}: expected shape = "file" with it, got {shape!r}')
    if refine:
        raise GeometryError(f'refine = {refine!r}: expected shape = "file" with it, got {shape!r}; use cells')
    plan = make_plan(shape, size, cells, cell, h, order, grade)
    dim = plan.shape.dim
    asked = (selectors("faces", faces, dim), selectors("regions", regions, dim))

    from elastune.geometry.arrays.extract import extract
    from elastune.geometry.distribute import distribute
    from elastune.geometry.files.msh import groups_of
    from elastune.geometry.sections import make_model

    def content(model: Any) -> Any:
        make_model(model, plan)
        groups = [group for group in groups_of(model) if group.physical and group.name]
        return extract(model, shape, dim, groups, _tags(asked))

    with session(comm) as model:
        mesh, members = distribute(comm, on_root(comm, lambda: content(model)), shape)
    _stretch(mesh, plan)
    return _geometry(mesh, members, asked)


def _tags(asked: tuple[dict[str, Selector], ...]) -> dict[int, dict[str, int]]:
    """Numbers of groups that have a further name, by codimension and name."""
    return {
        codim: {name: each.number for name, each in table.items() if each.kind == "tag"}
        for table, codim in zip(asked, (1, 0), strict=True)
    }


def _geometry(mesh: Mesh, members: Members, asked: tuple[dict[str, Selector], ...]) -> Geometry:
    """Add what selectors find to what the mesh names."""
    from elastune.geometry.named import tagged

    dim = mesh.topology.dim
    if any(asked):
        from elastune.geometry.select.find import add

        add(mesh, members, asked)
    tags = {}
    for each, found in members.items():
        if found:
            indices = {name: where for name, (_, where) in found.items()}
            tags[each] = tagged(mesh, each, indices, {name: number for name, (number, _) in found.items()})
    facet_tags, faces = tags.get(dim - 1) or tagged(mesh, dim - 1, {}, {})
    cell_tags, regions = tags.get(dim, (None, {}))
    edge_tags, curves = tags.get(1, (None, {})) if dim == 3 else (None, {})
    vertex_tags, points = tags.get(0, (None, {}))
    return Geometry(mesh, facet_tags, faces, cell_tags, regions, edge_tags, curves, vertex_tags, points)


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
    comm: MPI.Comm,
    path: str | PathLike[str] | None,
    order: int,
    grade: Mapping[str, float] | None,
    refine: int,
    h: float | None,
    asked: tuple[dict[str, Selector], ...],
) -> Geometry:
    if path is None:
        raise GeometryError('path: expected the path of a mesh file with shape = "file", got none')
    check_order(order)
    if grade:
        raise GeometryError(f'grade = {grade!r}: expected none with shape = "file", whose cells are given')

    from elastune.geometry.distribute import distribute
    from elastune.geometry.files.read import load

    with session(comm) as model:
        content = on_root(comm, lambda: load(model, path, order, refine, h, _tags(asked)))
        mesh, members = distribute(comm, content, str(path))
    return _geometry(mesh, members, asked)
