"""Meshes of `geometry`: volumes, faces, sizes of cells, refusals; serial and on several ranks."""

from __future__ import annotations

import functools
import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import basix
import numpy as np
import pytest
from dolfinx import fem
from dolfinx.mesh import entities_to_geometry, exterior_facet_indices
from meshes import COMM, area, degree, jacobians

from elastune.geometry import Geometry, GeometryError, build, face_names
from elastune.geometry.grading import relative_sizes

# Later releases of dolfinx keep one array for each cell type beside the only one there is here.
pytestmark = pytest.mark.filterwarnings("ignore:dofmap is deprecated:DeprecationWarning")

SOLID, PLANE = ("tetrahedron", "hexahedron"), ("triangle", "quadrilateral")
SIZES: dict[str, Any] = {
    "cube": 2.0,
    "box": [1.0, 2.0, 3.0],
    "cylinder": [0.5, 2.0],
    "square": 2.0,
    "rectangle": [3.0, 2.0],
}
GRADES: dict[str, tuple[dict[str, float], ...]] = {
    "cube": ({}, {"left": 0.3}, {"bottom": 0.2, "top": 0.2, "back": 0.4}),
    "box": ({}, {"top": 0.3}, {"left": 0.5, "right": 0.5, "front": 0.5, "back": 0.5}),
    "cylinder": ({}, {"bottom": 0.3, "top": 0.3}, {"side": 0.1, "top": 0.5}),
    "square": ({}, {"top": 0.3}),
    "rectangle": ({}, {"left": 0.4, "right": 0.4, "bottom": 0.6}),
}
CASES = [
    pytest.param(shape, cell, order, grade, id=f"{shape}-{cell}-{order}-{'+'.join(grade) or 'even'}")
    for shape in SIZES
    for cell in (SOLID if "cylinder" in shape or shape in ("cube", "box") else PLANE)
    for order in (1, 2)
    for grade in GRADES[shape]
]
# Coordinate and value of it that a flat face lies at, for the sizes above.
ENDS = {
    3: {"left": (0, 0), "right": (0, 1), "front": (1, 0), "back": (1, 1), "bottom": (2, 0), "top": (2, 1)},
    2: {"left": (0, 0), "right": (0, 1), "bottom": (1, 0), "top": (1, 1)},
}


@functools.cache
def made(shape: str, cell: str, order: int, grade: tuple[tuple[str, float], ...]) -> Geometry:
    """Build once what several tests look at."""
    cells = {"cylinder": 8, "box": 9}.get(shape, 6)
    return build(COMM, shape, SIZES[shape], cells, cell, order=order, grade=dict(grade))


def lengths(shape: str) -> list[float]:
    """Extents of the shape along x, y, z."""
    size = SIZES[shape]
    if shape == "cylinder":
        return [2 * size[0], 2 * size[0], size[1]]
    return list(size) if isinstance(size, list) else [size] * (2 if shape == "square" else 3)


def layers(g: Geometry, axis: int, where: Callable[[np.ndarray], np.ndarray] = np.atleast_2d) -> np.ndarray:
    """Sorted distinct coordinates of the vertices of all ranks; `axis` 3 is the distance to the z axis."""
    mesh = g.mesh
    corners = mesh.ufl_domain().ufl_coordinate_element().basix_element.cell_type
    x = mesh.geometry.x[np.unique(mesh.geometry.dofmap[:, : len(basix.topology(corners)[0])])]
    x = where(np.column_stack([x, np.hypot(x[:, 0], x[:, 1])]))
    values = np.sort(np.concatenate(COMM.allgather(x[:, axis])))
    return values[np.concatenate([[True], np.diff(values) > 1e-9])]


@pytest.mark.parametrize(("shape", "cell", "order", "grade"), CASES)
def test_shape(shape: str, cell: str, order: int, grade: dict[str, float]) -> None:
    """Volume and areas have their closed forms, faces are where their names say, no cell is inverted."""
    g = made(shape, cell, order, tuple(grade.items()))
    tdim, extents = g.mesh.topology.dim, lengths(shape)
    assert degree(g) == order
    assert set(g.faces) == set(face_names(shape))
    assert g.cell_tags is None
    assert (jacobians(g) > 0).all()

    volume, areas = math.prod(extents[:tdim]), {}
    for name, (axis, _) in ENDS[tdim].items():
        areas[name] = math.prod(extents[:tdim]) / extents[axis]
    tolerance = 1e-10
    if shape == "cylinder":
        radius, height = SIZES[shape]
        chords = 16  # four sides of the core, four cells each at 8 across
        section = chords / 2 * math.sin(2 * math.pi / chords) * radius**2
        around = 2 * chords * radius * math.sin(math.pi / chords)
        if order == 2:  # arcs are parabolas: fourth order, not exact
            section, around, tolerance = math.pi * radius**2, 2 * math.pi * radius, 1e-4
        volume, areas = section * height, {"bottom": section, "top": section, "side": around * height}
    # gmsh places nodes on a circle within 1e-8.
    tolerance = max(tolerance, 1e-7 if shape == "cylinder" else 0)
    assert g.volume() == pytest.approx(volume, rel=tolerance)
    for name in g.faces:
        assert area(g, name) == pytest.approx(areas[name], rel=tolerance), name

    dim = tdim - 1
    g.mesh.topology.create_connectivity(dim, 0)
    g.mesh.topology.create_connectivity(tdim, dim)
    for name in set(g.faces) - {"side"}:
        axis, end = ENDS[tdim][name]
        if len(g.facets(name)):  # dolfinx 0.9 divides by the number of entities
            x = g.mesh.geometry.x[entities_to_geometry(g.mesh, dim, g.facets(name))]
            np.testing.assert_array_equal(x[..., axis], end * extents[axis])


@pytest.mark.parametrize(("shape", "cell", "order", "grade"), CASES)
def test_boundary_is_named_once(shape: str, cell: str, order: int, grade: dict[str, float]) -> None:
    """Every boundary facet is in one face and nothing else is: the mesh conforms, and no face is missed."""
    g = made(shape, cell, order, tuple(grade.items()))
    topology = g.mesh.topology
    topology.create_connectivity(topology.dim - 1, topology.dim)
    named = np.concatenate([g.facets(name) for name in g.faces])
    assert named.dtype == np.int32
    np.testing.assert_array_equal(np.sort(named), np.sort(exterior_facet_indices(topology)))


@pytest.mark.parametrize("cell", SOLID)
def test_curved_cells_converge(cell: str) -> None:
    """The volume of a cylinder converges with order 2 for straight cells and 4 for curved ones."""

    def error(cells: int, order: int) -> float:
        g = build(COMM, "cylinder", [1.0, 1.0], [cells, 1], cell, order=order)
        return abs(g.volume() - math.pi)

    for order, rate, cap in ((1, 2, 5e-2), (2, 4, 2e-4)):
        coarse, fine = error(8, order), error(16, order)
        assert coarse < (cap * math.pi)
        assert math.log2(coarse / fine) == pytest.approx(rate, abs=0.1)


@pytest.mark.parametrize("cell", SOLID)
def test_mid_nodes_lie_on_the_side(cell: str) -> None:
    """All nodes of second-order cells on the side of a cylinder have its radius."""
    g = build(COMM, "cylinder", [0.5, 1.0], 8, cell, order=2)
    space = fem.functionspace(g.mesh, ("Lagrange", 2))
    x = space.tabulate_dof_coordinates()[fem.locate_dofs_topological(space, 2, g.facets("side"))]
    np.testing.assert_allclose(np.hypot(x[:, 0], x[:, 1]), 0.5, rtol=1e-12)


@pytest.mark.parametrize("cell", SOLID)
@pytest.mark.parametrize(("cells", "grade"), [(4, 1.0), (5, 1.0), (7, 0.01), (12, 0.01)])
def test_coarse_curved_cells_are_not_inverted(cell: str, cells: int, grade: float) -> None:
    """Few curved cells around, and thin ones at the side, keep their orientation."""
    g = build(COMM, "cylinder", [1.0, 1.0], [cells, 1], cell, order=2, grade={"side": grade})
    assert (jacobians(g) > 0).all()


@pytest.mark.parametrize("cell", SOLID)
@pytest.mark.parametrize("order", [1, 2])
def test_grading_of_a_box(cell: str, order: int) -> None:
    """The cell at a graded face has the ratio asked for, both ends alike, other directions stay even."""
    grade = {"left": 0.25, "bottom": 0.3, "top": 0.3}
    g = build(COMM, "box", [2.0, 1.0, 1.0], [6, 3, 5], cell, order=order, grade=grade)
    x, y, z = (np.diff(layers(g, axis)) for axis in range(3))
    assert (len(x), len(y), len(z)) == (6, 3, 5)
    assert x[0] / x.mean() == pytest.approx(0.25)
    assert np.all(np.diff(x) > 0)
    np.testing.assert_allclose(x[1:] / x[:-1], x[1] / x[0])
    np.testing.assert_allclose(y, 1 / 3)
    assert z[0] / z.mean() == pytest.approx(0.3)
    np.testing.assert_allclose(z, z[::-1])
    assert z.argmax() == 2


@pytest.mark.parametrize("cell", SOLID)
def test_grading_of_a_cylinder(cell: str) -> None:
    """A cylinder is graded along its axis, and towards its side in the ring outside the core."""
    g = build(COMM, "cylinder", [2.0, 3.0], [16, 6], cell, grade={"top": 0.2, "side": 0.4})
    z = np.diff(layers(g, 2))
    assert z[-1] / z.mean() == pytest.approx(0.2)
    assert np.all(np.diff(z) < 0)
    # On the diagonal the ring goes from 0.6 of the radius to the side.
    r = layers(g, 3, lambda x: x[(np.abs(x[:, 0] - x[:, 1]) < 1e-6) & (x[:, 0] > 0) & (x[:, 3] > 1.2 - 1e-6)])
    sizes = np.diff(r)
    assert len(sizes) == 4
    assert sizes[-1] / sizes.mean() == pytest.approx(0.4, rel=1e-6)
    assert np.all(np.diff(sizes) < 0)


@pytest.mark.parametrize("count", [3, 4, 10, 101])
def test_relative_sizes(count: int) -> None:
    """Sizes keep their average and end with the ratios asked for, also two different ones."""
    for start, end in ((None, None), (0.01, None), (None, 0.5), (0.2, 0.2), (0.01, 0.9)):
        sizes = relative_sizes(count, start, end)
        assert sizes.shape == (count,)
        assert sizes.min() > 0
        assert sizes.mean() == pytest.approx(1)
        assert start is None or sizes[0] == pytest.approx(start)
        assert end is None or sizes[-1] == pytest.approx(end)


@pytest.mark.parametrize(
    ("arguments", "counts"),
    [
        ({"shape": "box", "size": [2, 1, 4], "cells": 8}, (4, 2, 8)),
        ({"shape": "box", "size": [2, 1, 4], "cells": [1, 2, 3]}, (1, 2, 3)),
        ({"shape": "box", "size": np.array([10.0, 0.1, 1.0]), "cells": np.int64(10)}, (10, 1, 1)),
        ({"shape": "cube", "size": 1.0, "h": 0.1}, (10, 10, 10)),
        ({"shape": "cube", "size": 1.0, "h": 0.3}, (4, 4, 4)),
        ({"shape": "cube", "size": 1e-6, "cells": 3}, (3, 3, 3)),
        ({"shape": "cube", "size": 1e6, "cells": 3}, (3, 3, 3)),
        ({"shape": "rectangle", "size": [2, 1], "cells": 6, "cell": "quadrilateral"}, (6, 3)),
    ],
)
def test_counts(arguments: dict[str, Any], counts: tuple[int, ...]) -> None:
    """Cells are counted along the longest edge, the others in proportion, or as given; any unit of length."""
    g = build(COMM, **arguments)
    unit = functools.partial(np.multiply, 1 / np.max(arguments["size"]))
    sizes = [layers(g, axis, unit) for axis in range(len(counts))]
    assert g.cells_count == math.prod(counts)
    assert [len(size) - 1 for size in sizes] == list(counts)


@pytest.mark.parametrize(
    ("arguments", "cells"),
    [
        ({"cells": 4}, 12 * 4),
        ({"cells": 5}, (9 + 4 * 3) * 5),
        ({"cells": [8, 2]}, 48 * 2),
        ({"cells": 8, "cell": "tetrahedron"}, 6 * 48 * 8),
        ({"h": 0.25}, 48 * 8),
        ({"h": 5.0}, 12),
    ],
)
def test_counts_of_a_cylinder(arguments: dict[str, Any], cells: int) -> None:
    """Cells are counted across the diameter, the height in proportion; a hexahedron is six tetrahedra."""
    assert build(COMM, "cylinder", [1.0, 2.0], **arguments).cells_count == cells


def test_faces_by_name() -> None:
    """Names are known without a mesh; a face that is not there names those that are."""
    assert face_names("cube") == face_names("box") == ("left", "right", "front", "back", "bottom", "top")
    assert sorted(face_names("cylinder")) == ["bottom", "side", "top"]
    assert face_names("square") == face_names("rectangle") == ("left", "right", "bottom", "top")
    assert face_names("file") == ()
    with pytest.raises(GeometryError, match="'lid': expected one of left, right, front, back, bottom, top"):
        build(COMM, cells=1).facets("lid")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"shape": "sphere"}, r"shape = 'sphere': expected \"cube\", .* or \"file\""),
        ({"shape": ["cube"]}, "shape = "),
        ({"size": 0.0}, "size = 0.0: expected its edge, a length, positive, for a cube"),
        ({"size": -1}, "size = -1"),
        ({"size": math.nan}, "size = nan"),
        ({"size": math.inf}, "size = inf"),
        ({"size": True}, "size = True"),
        ({"size": 10**400}, "size = 1000"),
        ({"size": "1 m"}, "size = '1 m'"),
        ({"size": [1, 1, 1]}, r"size = \[1, 1, 1\]: expected its edge"),
        ({"shape": "box"}, r"size = 1.0: expected \[x, y, z\]"),
        ({"shape": "box", "size": [1, 2]}, r"expected \[x, y, z\]"),
        ({"shape": "cylinder", "size": [1, 0]}, r"size = \[1, 0\]: expected \[radius, height\]"),
        ({"shape": "rectangle", "size": [1, 2, 3], "cell": "triangle"}, r"expected \[x, y\]"),
        ({"cells": 0}, "cells = 0: expected a whole number from 1 to 100,000,000, or 3 of them"),
        ({"cells": 2.5}, "cells = 2.5"),
        ({"cells": []}, r"cells = \[\]"),
        ({"cells": [1, 2]}, "or 3 of them"),
        ({"cells": 10**400}, "expected a whole number"),
        ({"cells": 1000}, "cells = 1000: expected at most 100,000,000 cells, got about 1,000,000,000"),
        ({"shape": "cylinder", "size": [1, 1], "cells": 3}, "cells = 3: expected at least 4 cells across"),
        ({"h": 0}, "h = 0: expected a positive"),
        ({"h": 1e-300}, "expected at most 100,000,000 cells"),
        ({"cell": "prism"}, 'cell = \'prism\': expected "tetrahedron" or "hexahedron" for a cube'),
        ({"shape": "square"}, 'expected "triangle" or "quadrilateral" for a square'),
        ({"order": 3}, "order = 3: expected 1"),
        ({"order": True}, "order = True"),
        ({"grade": 0.3}, "grade = 0.3: expected ratios by face"),
        ({"grade": {"side": 0.3}}, "grade.side: expected a face of a cube: left, right, front"),
        ({"grade": {"left": 1.5}}, "grade.left = 1.5: expected .* from 0.01 to 1"),
        ({"grade": {"left": 0}}, "grade.left = 0"),
        ({"grade": {"left": 0.5}, "cells": 1}, "towards left: expected at least 2 cells between .* got 1"),
        ({"grade": {"left": 0.5, "right": 0.5}, "cells": 2}, "left and right: expected at least 3 cells"),
        ({"shape": "cylinder", "size": [1, 1], "grade": {"side": 0.5}, "cells": 6}, "at least 7 cells"),
        ({"path": "part.msh"}, "path = 'part.msh': expected shape = \"file\""),
        ({"refine": 1}, 'refine = 1: expected shape = "file"'),
        ({"shape": "file"}, "path: expected the path of a mesh file"),
        ({"shape": "file", "path": "a.msh", "grade": {"left": 0.5}}, "grade = .*: expected none"),
        ({"shape": "file", "path": "a.msh", "order": 0}, "order = 0"),
    ],
)
def test_impossible_arguments(arguments: dict[str, Any], message: str) -> None:
    """An impossible argument is refused in one line that names it, and gmsh is never started."""
    with pytest.raises(GeometryError, match=message) as raised:
        build(COMM, **arguments)
    assert "\n" not in str(raised.value)
    assert isinstance(raised.value, ValueError)


def test_import_is_cheap() -> None:
    """Scenes are checked without the libraries that meshes need."""
    script = (
        "import sys, geometry; geometry.face_names('cube'); "
        "sys.exit(any(name in sys.modules for name in ('dolfinx', 'gmsh', 'mpi4py', 'numpy', 'ufl')))"
    )
    root = Path(__file__).parents[1]
    assert subprocess.run([sys.executable, "-c", script], cwd=root, check=False).returncode == 0


def test_failure_on_rank_0_reaches_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever gmsh raises on rank 0 is a GeometryError of one line everywhere, and gmsh is ended."""

    def fail(model: Any, plan: Any) -> None:
        raise RuntimeError("Unable to\nrecover an edge")

    monkeypatch.setattr("elastune.geometry.sections.make_model", fail)
    with pytest.raises(GeometryError, match=r"gmsh: .* the error: Unable to recover an edge"):
        build(COMM)
    if COMM.rank == 0:
        import gmsh

        assert not gmsh.isInitialized()


def test_gmsh_of_the_caller_survives() -> None:
    """A gmsh that runs already is left running, with its models."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("mine")
        build(COMM, cells=2)
        assert gmsh.isInitialized()
        assert gmsh.model.list() == ["", "mine"]
    finally:
        gmsh.finalize()
