"""What tests measure on meshes, and files of every kind that people have."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import basix
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import entities_to_geometry
from mpi4py import MPI

from elastune.geometry import Geometry

COMM = MPI.COMM_WORLD


def area(g: Geometry, name: str) -> float:
    """Area of a named face, length in 2D, inner facets once; one form for all faces, so that it is compiled once."""
    ds = ufl.Measure("ds", domain=g.mesh, subdomain_data=[(1, integration_entities(g, name))])
    return _integral(g, ds(1))


def size(g: Geometry, region: str) -> float:
    """Volume of a region."""
    cells = g.cells(region)
    owned = cells[cells < g.mesh.topology.index_map(g.mesh.topology.dim).size_local]
    return _integral(g, ufl.Measure("dx", domain=g.mesh, subdomain_data=[(1, owned)])(1))


def count(g: Geometry, dim: int, indices: np.ndarray) -> int:
    """Number of entities of all ranks."""
    owned = np.count_nonzero(indices < g.mesh.topology.index_map(dim).size_local)
    return int(COMM.allreduce(int(owned), op=MPI.SUM))


def _integral(g: Geometry, measure: Any) -> float:
    form = fem.form(fem.Constant(g.mesh, 1.0) * measure)
    return float(COMM.allreduce(fem.assemble_scalar(form), op=MPI.SUM))


def length(g: Geometry, curve: str) -> float:
    """Length of a curve with straight edges."""
    edges = g.edges(curve)
    owned = edges[edges < g.mesh.topology.index_map(1).size_local]
    ends = entities_to_geometry(g.mesh, 1, owned)[:, :2] if len(owned) else np.empty((0, 2), dtype=np.int32)
    x = g.mesh.geometry.x[ends]
    return float(COMM.allreduce(np.linalg.norm(x[:, 1] - x[:, 0], axis=1).sum(), op=MPI.SUM))


def degree(g: Geometry) -> int:
    """Order of the cells."""
    return int(g.mesh.ufl_domain().ufl_coordinate_element().basix_element.degree)


def integration_entities(g: Geometry, name: str) -> np.ndarray:
    """Pairs (cell, local facet) of a face, one for each facet that this rank owns."""
    topology = g.mesh.topology
    tdim = topology.dim
    topology.create_connectivity(tdim, tdim - 1)
    to_cells, to_facets = topology.connectivity(tdim - 1, tdim), topology.connectivity(tdim, tdim - 1)
    owned = topology.index_map(tdim - 1).size_local
    pairs = [(to_cells.links(facet)[0], facet) for facet in g.facets(name) if facet < owned]
    local = [(cell, int(np.flatnonzero(to_facets.links(cell) == facet)[0])) for cell, facet in pairs]
    return np.array(local, dtype=np.int32).reshape(-1)


def jacobians(g: Geometry) -> np.ndarray:
    """Determinants of the cells' maps on a lattice with the corners, shape (cells, points)."""
    element = g.mesh.ufl_domain().ufl_coordinate_element().basix_element
    tdim = g.mesh.topology.dim
    points = basix.create_lattice(element.cell_type, 4, basix.LatticeType.equispaced, True)
    gradients = element.tabulate(1, points)[1:, :, :, 0]
    x = g.mesh.geometry.x[:, :tdim][g.mesh.geometry.dofmap]
    return np.linalg.det(np.einsum("cni,jpn->cpij", x, gradients))


# ---------------------------------------------------------------------- files


def write(folder: Path, draw: Callable[[Any], None], name: str = "part.msh", **options: float) -> str:
    """Write a file with gmsh on rank 0, in the folder of rank 0, and return its path on all."""
    path = str(COMM.bcast(folder / name, root=0))
    if COMM.rank == 0:
        _write(Path(path), draw, **options)
    COMM.barrier()
    return path


def _write(path: Path, draw: Callable[[Any], None], **options: float) -> None:
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.4)
        for option, value in options.items():
            gmsh.option.setNumber(f"Mesh.{option}", value)
        gmsh.model.add("part")
        draw(gmsh)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def across(gmsh: Any, x: float, dim: int = 2) -> list[int]:
    """Entities in the plane x = …."""
    return [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(x - 1e-3, -9, -9, x + 1e-3, 9, 9, dim)]


def layers(gmsh: Any, named: bool = True, joined: bool = True, hexahedra: bool = False, order: int = 1) -> None:
    """Two unit cubes along x: ends, joint and skin, halves and whole, an edge and a corner; some groups overlap."""
    occ, model = gmsh.model.occ, gmsh.model
    blocks = [(3, occ.addBox(x, 0, 0, 1, 1, 1)) for x in (0, 1)]
    if joined:
        occ.fragment(blocks[:1], blocks[1:])
    occ.synchronize()
    outer = [tag for _, tag in model.getEntities(2) if tag not in across(gmsh, 1)]
    groups: list[tuple[int, list[int], int, str]] = [
        (2, across(gmsh, 0), 30, "foot"), (2, across(gmsh, 1), 8, "joint"), (2, across(gmsh, 2), 7, "head"),
        (2, outer, 9, "skin"), (3, [blocks[0][1]], 7, "soft"), (3, [blocks[1][1]], 11, "hard"),
        (3, [blocks[0][1], blocks[1][1]], 12, "all of it"),
        (1, across(gmsh, 0, 1)[:1], 4, "edge"), (0, across(gmsh, 0, 0)[:1], 1, "corner"),
    ]  # fmt: skip
    for dim, entities, tag, name in groups:
        model.addPhysicalGroup(dim, entities, tag, name if named else "")
    _generate(gmsh, hexahedra, order)


def _generate(gmsh: Any, hexahedra: bool = False, order: int = 1) -> None:
    if hexahedra:
        gmsh.option.setNumber("Mesh.TransfiniteTri", 1)
        gmsh.model.mesh.setTransfiniteAutomatic()
    gmsh.model.mesh.generate(3 if gmsh.model.getEntities(3) else 2)
    gmsh.model.mesh.setOrder(order)


def plain(gmsh: Any) -> None:
    """The same without any group."""
    layers(gmsh)
    gmsh.model.removePhysicalGroups()


def parted(gmsh: Any) -> None:
    """The same in three parts, as for another program's ranks."""
    layers(gmsh)
    gmsh.option.setNumber("Mesh.PartitionCreateTopology", 1)
    gmsh.model.mesh.partition(3)


def rod(gmsh: Any, order: int, hexahedra: bool = False) -> None:
    """A quarter of a rod of unit radius and height about z, whose side is curved; a few cells."""
    geo, model = gmsh.model.geo, gmsh.model
    gmsh.option.setNumber("Mesh.MeshSizeMax", 9)
    center, a, b = geo.addPoint(0, 0, 0), geo.addPoint(1, 0, 0), geo.addPoint(0, 1, 0)
    middle = geo.addPoint(math.sqrt(0.5), math.sqrt(0.5), 0)
    lines = [geo.addLine(center, a), geo.addCircleArc(a, center, middle), geo.addCircleArc(middle, center, b)]
    lines.append(geo.addLine(b, center))
    section = geo.addPlaneSurface([geo.addCurveLoop(lines)])
    if hexahedra:
        for line in lines:
            geo.mesh.setTransfiniteCurve(line, 2)
        geo.mesh.setTransfiniteSurface(section)
        geo.mesh.setRecombine(2, section)
    made = geo.extrude([(2, section)], 0, 0, 1, numElements=[1] if hexahedra else [], recombine=hexahedra)
    geo.synchronize()
    model.addPhysicalGroup(2, [made[3][1], made[4][1]], name="side")
    model.addPhysicalGroup(3, [made[1][1]], name="body")
    _generate(gmsh, order=order)


def disc(gmsh: Any, order: int, quadrilaterals: bool = False) -> None:
    """A disc of unit radius."""
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.8)
    gmsh.option.setNumber("Mesh.RecombineAll", int(quadrilaterals))
    gmsh.model.occ.addDisk(0, 0, 0, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(1, [1], name="rim")
    gmsh.model.addPhysicalGroup(2, [1], name="body")
    _generate(gmsh, order=order)


def grid(cells: int = 2, hexahedra: bool = False) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """The box 2 × 1 × 1 by hand: points, cells, and facets of its ends x = 0 and x = 2, in VTK's order."""
    n = np.array([2 * cells, cells, cells])
    axes = [np.linspace(0, length, k + 1) for length, k in zip((2, 1, 1), n, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape(n + 1)
    i, j, k = (each.ravel() for each in np.meshgrid(*map(np.arange, n), indexing="ij"))
    shifts = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    bricks = np.stack([number[i + a, j + b, k + c] for a, b, c in shifts], axis=1)
    ends = {"foot": (0, [0, 4, 7, 3]), "head": (2, [1, 2, 6, 5])}
    facets = {}
    for name, (x, corners) in ends.items():
        quads = bricks[:, corners]
        facets[name] = quads[np.isclose(points[quads][:, :, 0], x).all(axis=1)]
    if hexahedra:
        return points, bricks, facets
    # Six about a diagonal: facets of neighbours match.
    parts = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
    tetrahedra = np.concatenate([bricks[:, part] for part in parts])
    split: dict[str, np.ndarray] = {}
    for name, (x, _) in ends.items():
        triangles = np.concatenate([np.delete(tetrahedra, k, axis=1) for k in range(4)])
        split[name] = triangles[np.isclose(points[triangles][:, :, 0], x).all(axis=1)]
    return points, tetrahedra, split


def by_meshio(path: Path, data: str | None = None, zero_elementary: bool = False, extra: bool = False) -> None:
    """The box by meshio, its facets numbered 1 and 2 and its halves 3 and 4, in data of a name or in sets.

    With `zero_elementary` all elements of a `.msh` say that they lie on one geometric entity; with `extra` there are
    nodes of nothing, loose lines and points beside.
    """
    import meshio

    points, cells, facets = grid()
    half = (points[cells].mean(axis=1)[:, 0] > 1).astype(np.int32)
    blocks: list[tuple[str, np.ndarray]] = [("triangle", np.concatenate(list(facets.values()))), ("tetra", cells)]
    numbers = [np.repeat([1, 2], [len(each) for each in facets.values()]).astype(np.int32), half + np.int32(3)]
    if extra:
        points = np.vstack([points, [[7, 7, 7], [8, 8, 8], [9, 9, 9]]])
        blocks += [("line", np.array([[len(points) - 1, len(points) - 2], [0, 1]])), ("vertex", np.array([[0]]))]
        numbers += [np.array([5, 6], dtype=np.int32), np.array([7], dtype=np.int32)]
    mesh = meshio.Mesh(points, blocks)
    if data is not None:
        mesh.cell_data[data] = numbers
    if path.suffix == ".msh":
        mesh.cell_data["gmsh:geometrical"] = [np.ones_like(each) for each in numbers]
        mesh.field_data = {"foot": np.array([1, 2]), "head": np.array([2, 2]), "soft": np.array([3, 3])}
    if path.suffix == ".med":
        mesh.cell_data["cell_tags"] = [-each for each in numbers]
        mesh.cell_tags = {-1: ["foot", "ends"], -2: ["head", "ends"], -3: ["soft"], -4: ["hard"]}
        mesh.point_data["point_tags"] = np.array([8, 9] + [0] * (len(points) - 2))
        mesh.point_tags = {8: ["corner", "edge"], 9: ["edge"]}
    formats = {".msh": "gmsh22", ".bdf": "nastran", ".vtk": "vtk42" if extra else "vtk"}
    kind = formats.get(path.suffix)
    meshio.write(path, mesh, file_format=kind, **({"binary": False} if path.suffix == ".msh" else {}))


def curved_facets(path: Path) -> None:
    """Facets of second order on cells of first order, which some programs write."""
    import meshio

    points, cells, facets = grid()
    corners = facets["foot"]
    middles = np.concatenate([(points[corners[:, k]] + points[corners[:, (k + 1) % 3]]) / 2 for k in range(3)])
    numbers = (len(points) + np.arange(3 * len(corners))).reshape(3, -1).T
    blocks = [("triangle6", np.hstack([corners, numbers])), ("tetra", cells)]
    tags = [np.full(len(block), k + 1, dtype=np.int32) for k, (_, block) in enumerate(blocks)]
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    names = {"foot": np.array([1, 2]), "body": np.array([2, 3])}
    meshio.write(path, meshio.Mesh(np.vstack([points, middles]), blocks, cell_data=data, field_data=names), "gmsh22")


def inp(path: Path) -> None:
    """What CalculiX reads: bricks, sets by number, range and name, surfaces of element sides and of nodes."""
    points, bricks, _ = grid(hexahedra=True)

    def wrapped(numbers: np.ndarray) -> list[str]:
        return [", ".join(map(str, part)) + "," for part in np.split(numbers, range(8, len(numbers), 8))]

    x = points[bricks].mean(axis=1)[:, 0]
    low, soft = np.flatnonzero(x < 0.5) + 1, np.flatnonzero(x < 1) + 1
    lines = ["*Heading", "** by hand", "*NODE, NSET=Nall"]
    lines += [f"{k}, {p[0]!r}, {p[1]!r}, {p[2]!r}" for k, p in enumerate(points.tolist(), 1)]
    lines += ["*ELEMENT, TYPE=C3D8R, ELSET=Eall"]
    lines += [f"{k}, " + ", ".join(map(str, nodes)) for k, nodes in enumerate((bricks + 1).tolist(), 1)]
    lines += ["*ELSET, ELSET=low", *wrapped(low), "*ELSET, ELSET=soft, GENERATE", f"{soft[0]}, {soft[-1]}, 1"]
    lines += ["*ELSET, ELSET=again", "soft", "*NSET, NSET=head", *wrapped(np.flatnonzero(points[:, 0] == 2) + 1)]
    # The side x = 0 of a brick whose first edge runs along x is its sixth.
    lines += ["*SURFACE, NAME=foot, TYPE=ELEMENT", "low, S6", "*SURFACE, NAME=end, TYPE=NODE", "head"]
    lines += ["*ELEMENT, TYPE=MASS, ELSET=mass", "9999, 1", "*MATERIAL, NAME=steel", "*ELASTIC", "210000., 0.3"]
    path.write_text("\n".join(lines) + "\n")


def salome(path: Path) -> None:
    """A universal file with its groups in the dataset that Salome writes."""
    _write(path, layers, SaveGroupsOfElements=1)
    path.write_text(path.read_text().replace("  2477\n", "  2467\n"))


def body(gmsh: Any) -> None:
    """A unit cube with a spherical hole inside."""
    occ = gmsh.model.occ
    occ.cut([(3, occ.addBox(0, 0, 0, 1, 1, 1))], [(3, occ.addSphere(0.5, 0.5, 0.5, 0.25))])
    occ.synchronize()


def shells(gmsh: Any) -> None:
    """Triangles around it, and around another cube beside."""
    body(gmsh)
    gmsh.model.occ.addBox(2, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(2)


GEO = """// A plain script: no SystemCall in it.
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 2, 1, 1};
Physical Surface("foot") = {1};
Printf("drawn");
"""


@dataclass(frozen=True)
class Kind:
    """A file, and what is in it.

    Attributes:
        name: Of the file.
        make: Writes it.
        volume: Closed form.
        faces: Areas.
        regions: Volumes.
        curves: Lengths.
        points: Numbers of vertices.
        arguments: Of `elastune.geometry.build`.
        rel: Relative tolerance.
    """

    name: str
    make: Callable[[Path], None]
    volume: float
    faces: dict[str, float] = field(default_factory=dict)
    regions: dict[str, float] = field(default_factory=dict)
    curves: dict[str, float] = field(default_factory=dict)
    points: dict[str, int] = field(default_factory=dict)
    arguments: dict[str, Any] = field(default_factory=dict)
    rel: float = 1e-8


def drawn(draw: Callable[..., None], *arguments: Any, **options: float) -> Callable[[Path], None]:
    """A file that gmsh writes."""
    return lambda path: _write(path, lambda gmsh: draw(gmsh, *arguments), **options)


ENDS = {"foot": 1.0, "head": 1.0}
LAYERS: dict[str, Any] = {
    "volume": 2.0,
    "faces": ENDS | {"joint": 1.0, "skin": 10.0},
    "regions": {"soft": 1.0, "hard": 1.0, "all of it": 2.0},
    "curves": {"edge": 1.0},
    "points": {"corner": 1},
}
SELECT = {
    "faces": {"foot": {"plane": "x", "at": 0.0}, "skin": {"all": True}},
    "regions": {"soft": {"box": [[0, 0, 0], [1, 1, 1]]}},
}
NUMBERED = {"1": 1.0, "2": 1.0}
HALVES = {"3": 1.0, "4": 1.0}
KINDS: dict[str, Kind] = {
    **{
        f"overlapping groups, {version}{', binary' if binary else ''}": Kind(
            "part.msh", drawn(layers, MshFileVersion=version, Binary=binary), **LAYERS
        )
        for version, binary in ((2.2, 0), (2.2, 1), (4.0, 0), (4.1, 0), (4.1, 1))
    },
    "parted": Kind("part.msh", drawn(parted), **LAYERS),
    "parted, 2.2": Kind("part.msh", drawn(parted, MshFileVersion=2.2), **LAYERS),
    "overlapping groups, hexahedra": Kind("part.msh", drawn(layers, True, True, True), **LAYERS),
    "overlapping groups, second order": Kind("part.msh", drawn(layers, True, True, False, 2), **LAYERS),
    "groups without names": Kind(
        "part.msh", drawn(layers, False), 2, {"30": 1, "8": 1, "7": 1, "9": 10}, {"7": 1, "11": 1, "12": 2}, {"4": 1},
        {"1": 1},
    ),
    "no groups": Kind("part.msh", drawn(plain), 2, {"1": 1}, {"1": 1, "2": 1}),
    "no groups, selected": Kind("part.msh", drawn(plain), 2, {"foot": 1, "skin": 10}, {"soft": 1}, arguments=SELECT),
    "loose pieces": Kind(
        "part.msh", drawn(layers, True, False), 2, {"foot": 1, "joint": 2, "head": 1}, {"soft": 1, "hard": 1}
    ),
    "numbers of elements, one entity": Kind(
        "part.msh", lambda path: by_meshio(path, "gmsh:physical"), 2, ENDS, {"soft": 1, "4": 1}
    ),
    "nodes, lines and points beside": Kind(
        "part.msh", lambda path: by_meshio(path, "gmsh:physical", extra=True), 2, ENDS, {"soft": 1}, {"6": 0.5},
        {"7": 1},
    ),
    "curved facets on straight cells": Kind("part.msh", curved_facets, 2, {"foot": 1}, {"body": 2}),
    "hexahedron 20": Kind(
        "rod.msh", drawn(rod, 2, True, SecondOrderIncomplete=1), math.pi / 4, {"side": math.pi / 2}, rel=1e-2
    ),
    "hexahedron 64": Kind("rod.msh", drawn(rod, 3, True), math.pi / 4, {"side": math.pi / 2}, rel=1e-3),
    "tetrahedron 20": Kind("rod.msh", drawn(rod, 3), math.pi / 4, {"side": math.pi / 2}, rel=1e-3),
    "tetrahedron 35": Kind("rod.msh", drawn(rod, 4), math.pi / 4, {"side": math.pi / 2}, rel=1e-3),
    "quadrilateral 8": Kind(
        "disc.msh", drawn(disc, 2, True, SecondOrderIncomplete=1), math.pi, {"rim": 2 * math.pi}, rel=1e-3
    ),
    "triangle 10": Kind("disc.msh", drawn(disc, 3), math.pi, {"rim": 2 * math.pi}, rel=1e-3),
    "vtk": Kind("part.vtk", lambda path: by_meshio(path, "CellEntityIds"), 2, NUMBERED, HALVES),
    "vtk, any whole numbers": Kind("part.vtk", lambda path: by_meshio(path, "material"), 2, NUMBERED, HALVES),
    "vtu": Kind("part.vtu", lambda path: by_meshio(path, "gmsh:physical", extra=True), 2, NUMBERED, HALVES),
    "vtu, bare": Kind("part.vtu", by_meshio, 2, {"foot": 1, "skin": 10}, {"soft": 1}, arguments=SELECT),
    "xdmf": Kind("part.xdmf", lambda path: by_meshio(path, "gmsh:physical"), 2, NUMBERED, HALVES),
    "med": Kind(
        "part.med", by_meshio, 2, ENDS | {"ends": 2}, {"soft": 1, "hard": 1}, points={"corner": 1, "edge": 2}
    ),
    "bdf": Kind("part.bdf", lambda path: by_meshio(path, "nastran:ref"), 2, NUMBERED, HALVES),
    "bdf of gmsh": Kind("part.bdf", drawn(plain, SaveAll=1), 2, arguments={"faces": SELECT["faces"]}),
    "mesh": Kind("part.mesh", lambda path: by_meshio(path, "medit:ref"), 2, NUMBERED, HALVES),
    "inp": Kind(
        "part.inp", inp, 2, ENDS | {"end": 1, "Nall": 10}, {"soft": 1, "again": 1, "Eall": 2, "low": 0.5},
        points={"head": 9},
    ),
    "inp of gmsh": Kind("part.inp", drawn(layers, SaveGroupsOfNodes=1), 2, {"head": 1}, {"soft": 1, "hard": 1}),
    "unv": Kind("part.unv", salome, 2, LAYERS["faces"], {"soft": 1, "hard": 1, "all_of_it": 2}, LAYERS["curves"]),
    "step": Kind(
        "part.step", drawn(body), 1 - math.pi / 48, {"7": math.pi / 4}, arguments={"h": 0.3, "order": 2}, rel=3e-3
    ),
    "brep": Kind("part.brep", drawn(body), 1 - math.pi / 48, {"1": 1}, arguments={"h": 0.1}, rel=5e-3),
    "geo": Kind("part.geo", lambda path: path.write_text(GEO) and None, 2, {"foot": 1, "2": 1}, arguments={"h": 0.5}),
    "stl": Kind(
        "part.stl", drawn(shells, MeshSizeMax=0.05), 2 - math.pi / 48, {"skin": 12 + math.pi / 4, "foot": 1},
        {"soft": 1 - math.pi / 48}, arguments=SELECT | {"h": 0.15}, rel=1e-2,
    ),
}  # fmt: skip


def file_of(kind: str, folder: Path) -> str:
    """Write a file of a kind on rank 0, in the folder of rank 0, and return its path on all."""
    path = COMM.bcast(folder / KINDS[kind].name, root=0)
    if COMM.rank == 0:
        KINDS[kind].make(path)
    COMM.barrier()
    return str(path)
