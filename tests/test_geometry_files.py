"""Meshes from files: groups, refinement, second order, refusals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from meshes import COMM, area, degree, jacobians, write
from mpi4py import MPI

from elastune.geometry import GeometryError, build

# Later releases of dolfinx keep one array for each cell type beside the only one there is here.
pytestmark = pytest.mark.filterwarnings("ignore:dofmap is deprecated:DeprecationWarning")


def two_blocks(gmsh: Any, order: int = 1, rest: bool = False) -> None:
    """Join two unit cubes along x: ends and joint named, the first in a named group, the second in none.

    With `rest` the second is in a group without a name.
    """
    occ, model = gmsh.model.occ, gmsh.model
    blocks = [(3, occ.addBox(x, 0, 0, 1, 1, 1)) for x in (0, 1)]
    occ.fragment(blocks[:1], blocks[1:])
    occ.synchronize()

    def across(x: float) -> list[int]:
        return [tag for _, tag in model.getEntitiesInBoundingBox(x - 1e-3, -1, -1, x + 1e-3, 2, 2, 2)]

    model.addPhysicalGroup(2, across(0), 30, "clamped end")
    model.addPhysicalGroup(2, across(2), 7, "load")
    model.addPhysicalGroup(2, across(1), 8, "joint")
    model.addPhysicalGroup(2, [tag for _, tag in model.getEntities(2)][-1:], 9)
    model.addPhysicalGroup(3, [blocks[0][1]], 7, "soft")
    if rest:
        model.addPhysicalGroup(3, [blocks[1][1]], 11)
    model.addPhysicalGroup(1, [1], 7, "edge")
    model.addPhysicalGroup(0, [1], 1, "corner")
    model.mesh.generate(3)
    model.mesh.setOrder(order)


@pytest.mark.parametrize(
    ("options", "rest"),
    [({}, False), ({}, True), ({"Binary": 1}, False), ({"MshFileVersion": 2.2}, True)],
    ids=["4.1-all", "4.1", "binary", "2.2"],
)
@pytest.mark.parametrize("order", [1, 2])
def test_file(tmp_path: Path, options: dict[str, float], rest: bool, order: int) -> None:
    """Groups of surfaces become faces, those of volumes regions; cells and surfaces without a group have numbers."""
    path = write(tmp_path, lambda gmsh: two_blocks(gmsh, order, rest), SaveAll=0 if rest else 1, **options)
    g = build(COMM, "file", path=path)
    named = {"clamped end": 30, "load": 7, "joint": 8, "9": 9}
    assert g.faces.items() >= named.items()
    assert all(name in named or name == str(number) for name, number in g.faces.items())
    assert g.regions == {"soft": 7, **({"11": 11} if rest else {"2": 2})}
    assert (tuple(g.curves), tuple(g.points)) == (("edge",), ("corner",))
    assert degree(g) == order
    assert g.volume() == pytest.approx(2)
    assert area(g, "clamped end") == pytest.approx(1)
    assert area(g, "load") == pytest.approx(1)
    assert g.cell_tags is not None
    owned = g.mesh.topology.index_map(3).size_local
    soft = COMM.allreduce(int((g.cell_tags.find(7) < owned).sum()), op=MPI.SUM)
    assert 0 < soft < g.cells_count
    assert (jacobians(g) > 0).all()


def test_file_raised_to_second_order(tmp_path: Path) -> None:
    """A file of straight cells gets mid nodes when curved cells are asked for."""
    g = build(COMM, "file", path=write(tmp_path, two_blocks, SaveAll=1), order=2)
    assert degree(g) == 2
    assert g.volume() == pytest.approx(2)


def test_file_refined(tmp_path: Path) -> None:
    """Each cell is split in eight, groups and faces stay; curved cells, whose shape is not known, are refused."""
    path = write(tmp_path, two_blocks, SaveAll=1)
    coarse = build(COMM, "file", path=path)
    for order in (1, 2):
        g = build(COMM, "file", path=path, refine=1, order=order)
        assert (g.faces, g.regions, degree(g)) == (coarse.faces, coarse.regions, order)
        assert g.cells_count == 8 * coarse.cells_count
        assert g.volume() == pytest.approx(2)
        assert area(g, "load") == pytest.approx(1)
    curved = write(tmp_path, lambda gmsh: two_blocks(gmsh, 2), "curved.msh", SaveAll=1)
    with pytest.raises(GeometryError, match="refine = 1: expected straight cells"):
        build(COMM, "file", path=curved, refine=1)


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_file_in_2d(tmp_path: Path, cell: str) -> None:
    """In a flat file the named groups of curves are the faces."""

    def draw(gmsh: Any) -> None:
        gmsh.model.occ.addRectangle(0, 0, 5, 2, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(1, [1], 1, "bottom")
        if cell == "quadrilateral":
            for tag in (1, 2, 3, 4):
                gmsh.model.mesh.setTransfiniteCurve(tag, 4)
            gmsh.model.mesh.setTransfiniteSurface(1)
            gmsh.model.mesh.setRecombine(2, 1)
        gmsh.model.mesh.generate(2)

    g = build(COMM, "file", path=write(tmp_path, draw, SaveAll=1))
    assert (g.mesh.topology.dim, g.mesh.geometry.dim) == (2, 2)
    assert g.mesh.topology.cell_name() == cell
    assert g.regions == {"1": 1}
    assert g.volume() == pytest.approx(2)
    assert area(g, "bottom") == pytest.approx(2)


def block(gmsh: Any, faces: dict[str, list[int]], volumes: tuple[str, ...] = ("body",), dim: int = 3) -> None:
    """Mesh a unit cube with physical groups."""
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    for name, tags in faces.items():
        gmsh.model.addPhysicalGroup(2, tags, name=name)
    for name in volumes:
        gmsh.model.addPhysicalGroup(3, [1], name=name)
    gmsh.model.mesh.generate(dim)


def detached(gmsh: Any) -> None:
    """Name a surface that no cell touches."""
    gmsh.model.occ.addRectangle(5, 5, 5, 1, 1, tag=100)
    block(gmsh, {"end": [1], "far": [100]})


def prisms(gmsh: Any) -> None:
    """Mesh with prisms."""
    occ, mesh = gmsh.model.occ, gmsh.model.mesh
    made = occ.extrude([(2, occ.addRectangle(0, 0, 0, 1, 1))], 0, 0, 1, numElements=[2], recombine=True)
    occ.synchronize()
    gmsh.model.addPhysicalGroup(3, [made[1][1]], name="body")
    mesh.generate(3)


DRAWN: dict[str, tuple[Callable[[Any], None], str]] = {
    "surface only": (lambda gmsh: block(gmsh, {"end": [1, 3]}, (), 2), "got surface cells, not flat in z"),
    "nothing": (lambda gmsh: block(gmsh, {}, (), 1), "volume cells, or surface cells in 2D; got neither"),
    "prisms": (prisms, "expected all cells tetrahedra or hexahedra; got Prism 6; this splits them: python3 -c "),
    "detached": (detached, "face 'far': expected facets of cells, got nodes of no cell"),
}


@pytest.mark.parametrize("case", DRAWN)
def test_unusable_mesh(tmp_path: Path, case: str) -> None:
    """A mesh that cannot serve is refused on every rank in one line with the path."""
    draw, message = DRAWN[case]
    path = write(tmp_path, draw)
    with pytest.raises(GeometryError, match=message) as raised:
        build(COMM, "file", path=path)
    assert str(raised.value).startswith(f"{path}: ")
    assert "\n" not in str(raised.value)


def test_facets_that_fit_no_cell(tmp_path: Path) -> None:
    """Elements between nodes of cells that are no facets of them are refused, not dropped."""

    def draw(gmsh: Any) -> None:
        block(gmsh, {"end": [1]})
        corners = [gmsh.model.mesh.getNodes(0, point)[0][0] for point in (1, 2, 3)]
        gmsh.model.mesh.addElementsByType(1, 2, [], corners)

    path = write(tmp_path, draw)
    with pytest.raises(GeometryError, match=r"face 'end': expected \d+ facets of cells, got \d+"):
        build(COMM, "file", path=path)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("missing.msh", None, "expected a readable .msh file, got: No such file"),
        ("folder.msh", "folder", "expected a readable .msh file, got: Is a directory"),
        ("missing.vtk", None, "expected a readable .vtk file, got: No such file"),
        ("part.txt", "", r"expected a mesh \(.msh, .unv, .vtk, .*\) or a body \(.step, .*\)"),
        ("part.stl", "solid", "expected closed shells|gmsh stopped with"),
        ("garbage.step", "nonsense", "expected a complete .step file; gmsh stopped with"),
        ("empty.geo", "Point(1) = {0, 0, 0};", "expected a volume, or a flat surface, to mesh; got neither"),
        ("garbage.geo", "Nonsense(", "expected a complete .geo file; gmsh stopped with"),
        ("script.geo", 'SystemCall "touch ran";', "expected a .geo that draws a body and no more; got SystemCall"),
        ("other.geo", 'Merge "script.geo";', "got Merge; .* mesh it: gmsh -3 other.geo"),
        ("print.geo", 'Printf("x") > "ran";', "got Printf"),
        ("garbage.vtk", "nonsense", "expected a complete .vtk file; VTK "),
        ("garbage.vtu", "nonsense", "expected a complete .vtu file; VTK "),
        ("garbage.med", "nonsense", "expected a complete .med file; meshio stopped with"),
        ("garbage.unv", "nonsense", "expected "),
        ("garbage.inp", "*NODE\n1, a", "expected a complete .inp file; got ValueError"),
        ("shell.inp", "*NODE\n1, 0, 0, 0\n*ELEMENT, TYPE=XY3\n1, 1", "expected elements of bodies.*; got 'XY3'"),
        ("two.inp", "*PART\n*END PART\n*PART", "expected one part, got several"),
        ("empty.msh", "", "starting with \\$MeshFormat"),
        ("script.msh", 'SystemCall "touch ran";\n', "starting with \\$MeshFormat"),
        (
            "twice.msh",
            '$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n2 1 "a"\n2 2 "a"\n$EndPhysicalNames\n',
            "expected one physical group 'a' of surfaces, got two",
        ),
        ("garbage.msh", "$MeshFormat\nnonsense\n", "expected .*; g"),
        ("cut.msh", "cut", "expected a complete .msh file; gmsh stopped with: Could not read"),
    ],
)
def test_unreadable_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, content: str | None, message: str
) -> None:
    """What is no mesh file is refused on every rank, and never run as a gmsh script."""
    path = Path(write(tmp_path, lambda gmsh: block(gmsh, {"a": [1]}), "whole.msh")).with_name(name)
    if COMM.rank == 0:
        if content == "folder":
            path.mkdir()
        elif content == "cut":
            whole = path.with_name("whole.msh").read_bytes()
            path.write_bytes(whole[: len(whole) // 2])
        elif content is not None:
            path.write_text(content)
    COMM.barrier()
    monkeypatch.chdir(path.parent)
    with pytest.raises(GeometryError, match=message) as raised:
        build(COMM, "file", path=path, h=1.0)
    assert str(raised.value).startswith(f"{path}: ")
    assert "\n" not in str(raised.value)
    assert not Path("ran").exists()
