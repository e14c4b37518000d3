"""Bodies of several materials: against closed forms, and a solver that shares nothing with ours."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import basix.ufl
import bodies
import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.mesh import compute_midpoints, meshtags
from mpi4py import MPI
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve

import elastune
from elastune import Geometry
from elastune.app.body.body import Body
from elastune.app.body.regions.solids import Solid
from elastune.app.body.unknowns import State
from elastune.app.errors import SceneError, UserError
from elastune.app.results.diagnose import diagnose
from elastune.app.run import Run
from elastune.app.scene.read import parse
from elastune.app.solvers.options import Options
from elastune.forms.elements import ELEMENTS
from elastune.forms.energy import MaterialError
from elastune.forms.spectral import build
from elastune.forms.tuned import tuned_energy

# Later releases of dolfinx keep one array for each cell type beside the only one there is here.
pytestmark = pytest.mark.filterwarnings("ignore:dofmap is deprecated:DeprecationWarning")

Tables = dict[str, Any]
Where = Callable[[np.ndarray], np.ndarray]
PULLED = {"left": elastune.Clamp(), "right": elastune.Translation((0.1, 0.05, 0.0))}


def ball(x: np.ndarray) -> np.ndarray:
    """An inclusion off the centre."""
    return np.linalg.norm(x - np.array([0.45, 0.55, 0.5]) * (np.ptp(x, axis=0) > 0), axis=1) < 0.35


def half(x: np.ndarray) -> np.ndarray:
    return x[:, 0] < 0.5


def meshed(element: str, cells: int, where: Where = ball, comm: Any = MPI.COMM_SELF, shape: str = "cube") -> Geometry:
    """A unit cube or square whose cells with midpoints somewhere are the region "inner", all others "outer"."""
    plane, simplex = shape == "square", element.startswith("P")
    cell = ("triangle" if simplex else "quadrilateral") if plane else "tetrahedron" if simplex else "hexahedron"
    given = elastune.geometry.build(comm, shape, 1.0, cells, cell)
    mesh, d = given.mesh, given.mesh.topology.dim
    everything = np.arange(
        mesh.topology.index_map(d).size_local + mesh.topology.index_map(d).num_ghosts, dtype=np.int32
    )
    inner = where(compute_midpoints(mesh, d, everything)) if len(everything) else np.empty(0, dtype=bool)
    tags = meshtags(mesh, d, everything, np.where(inner, 1, 2).astype(np.int32))
    return Geometry(mesh, given.facet_tags, given.faces, tags, {"inner": 1, "outer": 2})


def ended(body: Body, **options: Any) -> Run:
    run = Run(body, Options(**{"steps": 1, "tolerance": 1e-11, **options})).finish()
    assert run.summary.failure is None, run.summary.failure
    return run


# ---------------------------------------------------------------------- layers in series

SERIES: Tables = {
    "left": {"roller": ["x"]}, "front": {"roller": ["y"]}, "foot": {"roller": ["z"]}, "head": {"pull": [0.0, 0.0, 0.4]},
}  # fmt: skip
WAYS: dict[str, Callable[[Tables, Tables], Tables]] = {
    "both": lambda low, high: {"region": {"low": {"material": low}, "high": {"material": high}}},
    "default": lambda low, high: {"material": low, "region": {"high": {"material": high}}},
    "named default": lambda low, high: {"material": high, "region": {"low": {"material": low}, "high": {}}},
}


def layers(folder: Path, cell: str = "tetrahedron") -> Path:
    """Two unit cubes on top of each other; "both" overlaps each."""
    import gmsh

    path = folder / f"{cell}.msh"
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ, model = gmsh.model.occ, gmsh.model
        occ.fragment([(3, occ.addBox(0, 0, 0, 1, 1, 1))], [(3, occ.addBox(0, 0, 1, 1, 1, 1))])
        occ.synchronize()
        faces: dict[str, list[int]] = {"left": [], "front": [], "foot": [], "head": []}
        for _, tag in model.getEntities(2):
            x, y, z = occ.getCenterOfMass(2, tag)
            for name, on in zip(faces, (x < 0.1, y < 0.1, z < 0.1, z > 1.9), strict=True):
                faces[name] += [tag] * on
        for name, tags in faces.items():
            model.addPhysicalGroup(2, tags, name=name)
        for name, tag in (("low", 1), ("high", 2)):
            model.addPhysicalGroup(3, [tag], name=name)
        if cell == "hexahedron":
            for dim, number in ((1, 3), (2, None), (3, None)):
                for _, tag in model.getEntities(dim):
                    if dim == 1:
                        model.mesh.setTransfiniteCurve(tag, number)
                    elif dim == 2:
                        model.mesh.setTransfiniteSurface(tag)
                        model.mesh.setRecombine(2, tag)
                    else:
                        model.mesh.setTransfiniteVolume(tag)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.7)
        model.mesh.generate(3)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


def series(folder: Path, materials: Tables, element: str = "P2", **tables: Any) -> Tables:
    cell = "tetrahedron" if element.startswith("P") else "hexahedron"
    return {
        "mesh": {"shape": "file", "path": str(layers(folder, cell))},
        "solve": {"element": element, "steps": 1, "tolerance": 1e-11},
        "boundary": SERIES,
        "output": {"picture": False, "fields": []},
        **materials,
        **tables,
    }


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("element", "ratio"), [("P2", 3.0), ("Q1", 3.0), ("Q2", 1e4), ("P1", 1e-4)])
def test_layers_in_series(tmp_path: Path, way: str, element: str, ratio: float) -> None:
    """Without a ν each layer of log neo-Hookean only lengthens: μ (s - 1/s) = T, whatever the other does."""
    moduli = np.array([1.0, ratio])
    given = WAYS[way](*({"name": "neo-hookean", "E": E, "nu": 0.0} for E in moduli.tolist()))
    run = bodies.solved(parse(series(tmp_path, given, element), tmp_path / "series.toml"))
    relative = 0.4 / (moduli / 2)
    stretches = (relative + np.sqrt(relative**2 + 4)) / 2
    stored = float(np.sum(moduli / 2 * ((stretches**2 - 1) / 2 - np.log(stretches))))
    tip = float(np.sum(stretches - 1))
    last = run.summary.steps[-1]
    assert last.energy == pytest.approx(stored - 0.4 * tip, rel=1e-9)
    assert last.max_displacement == pytest.approx(tip, rel=1e-9)
    assert last.newton_iterations <= 12
    fields = run.fields("von_mises", "energy", "J", "region")
    # Cauchy stress of the nominal stress 0.4 with sides that keep their length, the same in both layers.
    np.testing.assert_allclose(fields["von_mises"], 0.4, rtol=1e-8)
    numbers = {"both": (1, 2), "default": (0, 1), "named default": (1, 2)}[way]
    for number, stretch in zip(numbers, stretches, strict=True):
        np.testing.assert_allclose(fields["J"][fields["region"] == number], stretch, rtol=1e-9)
    assert set(fields["region"]) == set(numbers)


def test_two_layers_of_the_small_strain(
    tmp_path: Path, elastune: Callable[..., Any], solved: Callable[..., Tables]
) -> None:
    """0.01 pulls 0.01 and 0.01/3 out of layers of E = 1 and 3; and what a run says of materials, on 1 and 2 ranks."""
    import tomli_w

    given = WAYS["both"](*({"name": "linear-elasticity", "E": E, "nu": 0.0, "alpha": 1.0} for E in (1.0, 3.0)))
    boundary = {**SERIES, "head": {"pull": [0.0, 0.0, 0.01]}}
    scene = tmp_path / "layers.toml"
    fields = {"picture": False, "fields": ["displacement", "region"]}
    scene.write_text(tomli_w.dumps(series(tmp_path, given, boundary=boundary, output=fields)))
    for ranks in (1, 2):
        summary = solved(scene, ranks=ranks)
        assert summary["steps"][-1]["max_displacement"] == pytest.approx(0.01 * 4 / 3, rel=1e-8)
        assert summary["steps"][-1]["energy"] == pytest.approx(-0.005 * 0.01 * 4 / 3, rel=1e-8)
        assert list(summary["materials"]) == ["low", "high"]
        assert [entry["E"] for entry in summary["materials"].values()] == pytest.approx([1.0, 3.0])
        assert summary["material"] == summary["materials"]["low"]
    # What is written beside a run repeats it.
    repeated = solved(sorted(tmp_path.glob("run-*/scene.toml"))[0])
    assert repeated["steps"][-1]["energy"] == pytest.approx(summary["steps"][-1]["energy"], rel=1e-12)


# ---------------------------------------------------------------------- inclusions

# Log neo-Hookean with U = log²J/2 or (J - 1)²/2, by name.
VOLUMES: dict[str, Callable[[Any], Any]] = {
    "neo-hookean": lambda J: ufl.ln(J) ** 2 / 2,
    "neo-hookean-ogden": lambda J: (J - 1) ** 2 / 2,
}


def stored(name: str, p: Any, compliance: Any) -> Any:
    """U*(p), by Newton's method written out for y = log j."""
    if name == "neo-hookean-ogden":
        return compliance * p**2 / 2
    y: Any = compliance * p
    for _ in range(4):
        y = y - (y * ufl.exp(-y) - compliance * p) / ((1 - y) * ufl.exp(-y))
    return p * (ufl.exp(y) - 1) - y**2 / (2 * compliance)


class Reference:
    """One functional of UFL's whose coefficients are functions of cells, solved by Newton's method and LU.

    Of a mixed element each region has pressures in the whole body; those that touch no cell of it are left out.
    """

    def __init__(self, geometry: Geometry, element: str, materials: Mapping[str, tuple[str, float, float]]) -> None:
        mesh, kind, names = geometry.mesh, ELEMENTS[element], list(materials)
        d, cell = mesh.geometry.dim, mesh.basix_cell()
        family = None if kind.pressure is None else "P" if kind.pressure.continuous else "DPC"
        family = "DG" if kind.pressure is not None and kind.pressure.degree == 0 else family
        own = basix.ufl.element("P", cell, kind.degree, shape=(d,))
        pressure = None if kind.pressure is None else basix.ufl.element(family, cell, kind.pressure.degree)
        elements = [own] if pressure is None else [own, *[pressure] * len(names)]
        self.space = fem.functionspace(mesh, basix.ufl.mixed_element(elements))
        self.x = fem.Function(self.space)
        u, *pressures = ufl.split(self.x)
        F = ufl.Identity(3) + ufl.as_tensor(
            [[ufl.grad(u)[i, j] if max(i, j) < d else 0 for j in range(3)] for i in range(3)]
        )
        J, total = ufl.det(F), 0
        dx = ufl.Measure("dx", mesh, subdomain_data=geometry.cell_tags, metadata={"quadrature_degree": kind.quadrature})
        numbers = fem.functionspace(mesh, ("DG", 0))
        for k, (name, (energy, E, nu)) in enumerate(materials.items()):
            cells = dx(geometry.regions[name])
            mu, compliance = fem.Function(numbers), fem.Function(numbers)
            mu.x.array[:], compliance.x.array[:] = E / 2 / (1 + nu), (1 + nu) * (1 - 2 * nu) / (E * nu)
            shear = mu / 2 * (ufl.inner(F, F) - 3) - mu * ufl.ln(J)
            if pressures:
                total += (shear + pressures[k] * (J - 1) - stored(energy, pressures[k], compliance)) * cells
            else:
                total += (shear + VOLUMES[energy](J) / compliance) * cells
        residual = ufl.derivative(total, self.x)
        self._energy, self._residual = fem.form(total), fem.form(residual)
        self._tangent = fem.form(ufl.derivative(residual, self.x))
        self.held, self.motion = np.zeros(len(self.x.x.array), dtype=bool), np.zeros(len(self.x.x.array))
        V, places = self.space.sub(0), geometry.mesh
        places.topology.create_connectivity(d - 1, d)
        for face, motion in (("left", np.zeros(d)), ("right", np.array(PULLED["right"].vector[:d]))):
            for i in range(d):
                dofs = fem.locate_dofs_topological(V.sub(i), d - 1, geometry.facets(face))
                self.held[dofs], self.motion[dofs] = True, motion[i]

    def energy(self, loads: int = 8) -> float:
        """Π at full load."""
        x = self.x.x.array
        for load in np.arange(1, loads + 1) / loads:
            step = np.where(self.held, load * self.motion - x, 0.0)
            for _ in range(30):
                matrix = fem.assemble_matrix(self._tangent)
                K = csr_matrix((matrix.data, matrix.indices, matrix.indptr))
                free = ~self.held & (np.asarray(abs(K).sum(axis=1)).ravel() > 0)
                forces = fem.assemble_vector(self._residual).array + K @ step
                step[free] -= spsolve(K[free][:, free].tocsc(), forces[free])
                x += step
                size, step = np.abs(step).max(), np.zeros_like(x)
                if size < 1e-12:
                    break
            assert size < 1e-12
        return float(fem.assemble_scalar(self._energy))


INCLUSIONS: dict[str, tuple[str, str, int, tuple[str, float, float], tuple[str, float, float]]] = {
    "Q1": ("Q1", "cube", 3, ("neo-hookean", 3.0, 0.2), ("neo-hookean", 1.0, 0.45)),
    "Q2": ("Q2", "square", 4, ("neo-hookean", 1.0, 0.3), ("neo-hookean", 1.0, 0.499)),
    "Q2, bone": ("Q2", "cube", 3, ("neo-hookean", 1e4, 0.3), ("neo-hookean", 1.0, 0.45)),
    "P2, other energies": ("P2", "cube", 2, ("neo-hookean", 5.0, 0.3), ("neo-hookean-ogden", 1.0, 0.4)),
    "P1, plane": ("P1", "square", 6, ("neo-hookean", 0.01, 0.3), ("neo-hookean", 1.0, 0.4)),
    "Q2-P1d": ("Q2-P1d", "cube", 3, ("neo-hookean-ogden", 1.0, 0.3), ("neo-hookean-ogden", 1.0, 0.499)),
    "Q2-P1d, bone": ("Q2-P1d", "cube", 3, ("neo-hookean-ogden", 1e4, 0.3), ("neo-hookean-ogden", 1.0, 0.5)),
    "Q2-P1d, other U": ("Q2-P1d", "square", 4, ("neo-hookean", 3.0, 0.3), ("neo-hookean-ogden", 1.0, 0.499)),
    "Q1-P0": ("Q1-P0", "square", 6, ("neo-hookean-ogden", 1.0, 0.3), ("neo-hookean-ogden", 1.0, 0.499)),
    "P2-P1": ("P2-P1", "cube", 2, ("neo-hookean-ogden", 1.0, 0.3), ("neo-hookean-ogden", 1.0, 0.499)),
    "P2-P1, bone": ("P2-P1", "square", 5, ("neo-hookean-ogden", 1e4, 0.3), ("neo-hookean-ogden", 1.0, 0.5)),
    "P2-P1, other U": ("P2-P1", "square", 4, ("neo-hookean", 0.2, 0.4), ("neo-hookean", 1.0, 0.499)),
}


@pytest.mark.parametrize("case", INCLUSIONS)
def test_inclusions(case: str) -> None:
    element, shape, cells, inner, outer = INCLUSIONS[case]
    geometry = meshed(element, cells, shape=shape)
    solids: dict[str | None, Solid] = {
        name: Solid(tuned_energy(*given, mixed=True)) for name, given in (("inner", inner), ("outer", outer))
    }
    d = geometry.mesh.geometry.dim
    conditions = {**PULLED, "right": elastune.Translation(PULLED["right"].vector[:d])}
    body = Body(geometry, solids, element, conditions)
    record = ended(body).summary.steps[-1]
    assert record.energy == pytest.approx(
        Reference(geometry, element, {"inner": inner, "outer": outer}).energy(), rel=1e-9
    )
    assert record.newton_iterations <= 10


@pytest.mark.parametrize("element", ["Q1", "P2", "Q2-P1d", "Q1-P0"])
@pytest.mark.parametrize("name", ["neo-hookean", "fixed-corotational"])
def test_regions_of_one_material_are_one_body(element: str, name: str) -> None:
    """Every cell is integrated once, by the same kernel; fields too."""
    geometry = meshed(element, 3)
    energy = tuned_energy(name, 1.5, 0.4)
    results = []
    for material in (energy, {"inner": Solid(energy), None: Solid(energy.with_values({}))}):
        body = Body(geometry, material, element, PULLED)
        run = ended(body)
        results.append((run.summary.steps[-1], run.fields("stress", "energy")))
        cells = [body.quadrature_points.owned if part.cells is None else part.cells for part in body.parts]
        assert sorted(np.concatenate(cells)) == list(range(geometry.cells_count))
    (one, fields), (two, others) = results
    assert two.energy == pytest.approx(one.energy, rel=1e-12)
    assert two.newton_iterations == one.newton_iterations
    for key, values in fields.items():
        np.testing.assert_allclose(others[key], values, rtol=1e-7, atol=1e-9)


def test_pressures_jump_where_materials_meet() -> None:
    """An incompressible layer on a compressible one: one pressure for both sides errs by 1 %, the other way."""
    energies = {}
    for element, cells in (("P2-P1", 4), ("P2-P1", 6), ("Q2-P1d", 6)):
        solids: dict[str | None, Solid] = {
            "inner": Solid(tuned_energy("neo-hookean-ogden", 10.0, 0.3, mixed=True)),
            None: Solid(tuned_energy("neo-hookean-ogden", 1.0, 0.5, mixed=True)),
        }
        body = Body(meshed(element, cells, half), solids, element, PULLED)
        energies[element, cells] = ended(body).summary.steps[-1].energy
    limit = energies["Q2-P1d", 6]
    coarse, fine = (energies["P2-P1", cells] / limit - 1 for cells in (4, 6))
    assert 0 < fine < 0.7 * coarse < 0.03


@pytest.mark.parametrize(("element", "most"), [("Q1", 30), ("P2", 45), ("Q2-P1d", 45), ("P2-P1", 50), ("Q1-P0", 40)])
def test_iterative_solvers_know_contrast(element: str, most: int) -> None:
    """A bone of 10,000 times the stiffness: iterations of a linear solve, and the balance that was asked for."""
    solids: dict[str | None, Solid] = {
        "inner": Solid(tuned_energy("neo-hookean", 1e4, 0.3)),
        None: Solid(tuned_energy("stable-neo-hookean", 1.0, 0.45)),
    }
    runs = [
        ended(Body(meshed(element, 4), solids, element, PULLED), linear=linear, tolerance=1e-9).summary.steps[-1]
        for linear in ("direct", "iterative")
    ]
    assert runs[1].energy == pytest.approx(runs[0].energy, rel=1e-8)
    assert runs[1].newton_iterations <= 12
    assert runs[1].linear_iterations <= most * (runs[1].newton_iterations + 1)


@pytest.mark.parametrize(("element", "unit"), [("Q1", 1.0), ("P2", 1e7)])
def test_small_loads_on_a_soft_part_are_balanced(element: str, unit: float) -> None:
    """Rounding of the stiff part's forces is no measure of the soft one's: a load of 1e-5 E, to 1e-8 of it."""
    solids: dict[str | None, Solid] = {
        "inner": Solid(tuned_energy("neo-hookean", 1e4 * unit, 0.3)),
        None: Solid(tuned_energy("neo-hookean", unit, 0.3)),
    }
    ends = {"left": elastune.Clamp(), "right": elastune.Pull((1e-5 * unit, 0.0, 0.0))}
    body = Body(meshed(element, 3), solids, element, ends)
    ended(body, tolerance=1e-8)
    left = np.linalg.norm(np.where(body.held, 0.0, body.assembly.residual(body.state)))
    assert left <= 1e-8 * np.linalg.norm(body.assembly.forces(body.state)[0])


def test_one_kernel_for_each_energy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build, "_cache_folder", lambda: tmp_path)
    geometry = meshed("Q1", 2, half)

    def kernels(inner: Any, outer: Any) -> int:
        Body(geometry, {"inner": Solid(inner), "outer": Solid(outer)}, "Q1", PULLED)
        return len(list(tmp_path.glob("*.so")))

    one, other = (tuned_energy("fixed-corotational", E, nu) for E, nu in ((1.0, 0.3), (1e4, 0.45)))
    assert kernels(one, other) == 1
    assert kernels(other, tuned_energy("fixed-corotational", 7.0, 0.1)) == 1
    assert kernels(one, tuned_energy("stable-neo-hookean", 1.0, 0.3)) == 2


# ---------------------------------------------------------------------- the language and its refusals

LOW: Tables = {"name": "neo-hookean", "E": 1.0, "nu": 0.3}
REFUSED: dict[str, tuple[Tables, list[str]]] = {
    "no material at all": ({}, ["material: missing; every scene needs"]),
    "a region without": ({"region": {"low": {}}}, ["region.low.material: missing"]),
    "cells without": ({"region": {"low": {"material": LOW}}}, ["material: missing", "cells lie in no region"]),
    "unknown region": ({"material": LOW, "region": {"bone": {}}}, ["region.bone", "which has low, high"]),
    "unknown key": ({"material": LOW, "region": {"low": {"materiel": LOW}}}, ["region.low.materiel", "mean material"]),
    "unknown material": (
        {"material": LOW, "region": {"low": {"material": {**LOW, "name": "rubber"}}}},
        ["region.low.material", "rubber"],
    ),
    "impossible nu": (
        {"material": LOW, "region": {"low": {"material": {**LOW, "nu": 0.7}}}}, ["region.low.material", "nu", "0.7"],
    ),
    "extension of small strain": (
        {"material": LOW, "region": {"low": {"material": {**LOW, "name": "linear-elasticity", "extension": 0.2}}}},
        ["region.low.material.extension", "no singularity"],
    ),
    "extension on a mixed element": (
        {"material": LOW, "region": {"low": {"material": {**LOW, "extension": 0.2}}}, "solve": {"element": "P2-P1"}},
        ["region.low.material.extension", "not for mixed"],
    ),
    "no λ on a mixed element": (
        {"material": LOW, "region": {"low": {"material": {**LOW, "nu": 0.0}}}, "solve": {"element": "P2-P1"}},
        ["region.low.material", "nu above 0"],
    ),
    "incompressible on another one": (
        {"material": LOW, "region": {"low": {"material": {**LOW, "nu": 0.5}}}, "solve": {"element": "P2"}},
        ["region.low.material", "0.5"],
    ),
    "undefined at the start": (
        {"material": LOW | {"extension": 0.2}, "region": {"low": {"material": LOW}}, "start": {"shape": "point"}},
        ["start.shape", "region.low.material.extension"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused(case: str, tmp_path: Path) -> None:
    materials, words = REFUSED[case]
    with pytest.raises(SceneError) as refusal:
        elastune.solve(parse(series(tmp_path, {}) | materials, tmp_path / "series.toml"), comm=MPI.COMM_SELF)
    assert "\n" not in str(refusal.value) and str(refusal.value).startswith("series.toml: ")
    assert all(word in str(refusal.value) for word in words), str(refusal.value)


@pytest.mark.parametrize("ranks", [1, 2])
def test_refusals_end_with_a_line(ranks: int, tmp_path: Path, elastune: Callable[..., Any]) -> None:
    import tomli_w

    scene = tmp_path / "layers.toml"
    scene.write_text(tomli_w.dumps(series(tmp_path, {"region": {"low": {"material": LOW}}})))
    done = elastune("run", scene, "--out", "left", ranks=ranks)
    assert done.returncode == 2 and not (tmp_path / "left").exists()
    assert "cells lie in no region with a material" in done.stderr and "Traceback" not in done.stderr


def test_regions_may_overlap_if_they_agree() -> None:
    given = meshed("Q1", 2, half)
    cells = np.arange(given.cells_count, dtype=np.int32)

    class Overlapping(Geometry):
        def cells(self, name: str) -> np.ndarray:
            return cells if name == "everything" else cells[:0] if name == "nothing" else super().cells(name)

    names = {**given.regions, "everything": 3, "nothing": 4}
    geometry = Overlapping(given.mesh, given.facet_tags, given.faces, given.cell_tags, names)
    same, other = (Solid(tuned_energy("neo-hookean", E, 0.3)) for E in (1.0, 2.0))
    again = Solid(tuned_energy("neo-hookean", 1.0, 0.3))
    assert [part.name for part in Body(geometry, {"inner": same, "everything": again}, "Q1", PULLED).parts] == [
        "inner", "everything",
    ]  # fmt: skip
    with pytest.raises(UserError, match=r"region\.everything: expected cells of its own, got some that region\.inner"):
        Body(geometry, {"inner": same, "everything": other}, "Q1", PULLED)
    with pytest.raises(UserError, match=r"region\.nothing: expected cells in it, got none"):
        Body(geometry, {None: same, "nothing": other}, "Q1", PULLED)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        ({}, {"nu": 0.499}, "P2-P1"),
        ({"nu": 0.5}, {}, "P2-P1"),
        ({}, {"nu": 0.49}, "P2"),
        ({"nu": 0.0}, {"nu": 0.499}, "P2"),
        ({"extension": 0.2}, {"nu": 0.499}, "P2"),
    ],
)
def test_a_mixed_element_is_chosen_if_a_region_needs_it_and_all_can(
    low: Tables, high: Tables, expected: str, tmp_path: Path
) -> None:
    given = WAYS["both"](LOW | low, LOW | high)
    scene = parse(
        series(
            tmp_path,
            given,
            solve={"element": "auto"},
            mesh={"cell": "tetrahedron", "shape": "file", "path": str(layers(tmp_path))},
        ),
        tmp_path / "series.toml",
    )
    assert bodies.made(scene).element == expected


# ---------------------------------------------------------------------- what else knows materials


def test_materials_in_python() -> None:
    soft, hard = elastune.material("neo-hookean", 1.0, 0.499), elastune.material("hencky", 1e3, 0.3)
    geometry = meshed("Q2", 2, half)
    body = elastune.body(geometry, {"inner": soft, None: hard}, PULLED)
    assert (body.element, [part.name for part in body.parts]) == ("Q2-P1d", [None, "inner"])
    run = elastune.solve(body, Options(steps=1))
    summary = json.loads(json.dumps(run.finish().summary.as_dict()))
    assert summary["material"]["name"] == "hencky" and list(summary["materials"]) == ["inner"]
    whole = elastune.body(geometry, {"inner": soft, "outer": soft}, PULLED)
    assert len(whole.parts) == 2
    with pytest.raises(UserError, match="cells lie in no region"):
        elastune.body(geometry, {"inner": soft}, PULLED)
    with pytest.raises(UserError, match="expected one"):
        elastune.body(geometry, {}, PULLED)
    with pytest.raises(MaterialError, match="needs a mixed element"):
        elastune.body(geometry, {"inner": soft, None: elastune.material("fung", 1.0, 0.5)}, PULLED, element="Q2")


def test_diagnosis_knows_regions() -> None:
    """Ellipticity is lost where a material is not elliptic, not where the same strain is harmless to another."""
    geometry, found = meshed("Q1", 2, half), {}
    stiff, weak = tuned_energy("stable-neo-hookean", 1e3, 0.4), tuned_energy("st-venant-kirchhoff", 1.0, 0.3)
    for names in (("inner", "outer"), ("outer", "inner")):
        body = Body(geometry, dict(zip(names, (Solid(weak), Solid(stiff)), strict=True)), "Q1", PULLED)
        values = np.zeros((body.size // 3, 3))
        # The half of the region "inner" is pressed together.
        values[:, 0] = -0.5 * np.minimum(body.points[:, 0], 0.5)
        found[names[0]] = diagnose(body, Options(), State(values.ravel(), 1.0), "stalled")["ellipticity"]
    assert found["inner"] < -0.1 and found["outer"] > 0.5
    locking = Body(geometry, {"inner": Solid(weak), None: Solid(tuned_energy("fung", 1.0, 0.4999))}, "Q1", PULLED)
    said = diagnose(locking, Options(), None, "stalled")["locking"]
    assert said is not None and "0.4999" in said
    undefined = Body(geometry, {"inner": Solid(tuned_energy("hencky", 1.0, 0.3)), None: Solid(stiff)}, "Q1", PULLED)
    assert "region.inner.material.extension" in diagnose(undefined, Options(), None, "undefined")["advice"][0]


def test_a_tangled_body_of_two_materials_comes_home(tmp_path: Path) -> None:
    """Collapsed onto a plane; the stiffer, less compressible one is softened on the way."""
    given = WAYS["both"]({**LOW, "name": "stable-neo-hookean"}, {"name": "arap", "E": 5.0, "nu": 0.0})
    given["region"]["low"]["material"]["nu"] = 0.49
    scene = series(
        tmp_path, given, "Q1", start={"shape": "scramble", "seed": 1},
        boundary={"foot": {"fix": True}, "head": {"fix": True}},
        solve={"element": "Q1", "steps": 1, "quadrature": 3},
    )  # fmt: skip
    run = bodies.solved(parse(scene, tmp_path / "series.toml"))
    low, high = run.body.parts
    assert low.solid.softened is not None and high.solid.softened is None
    assert abs(run.summary.steps[-1].energy) < 1e-12
    assert list(low.strain.parameters.value) == low.energy.constants()


@pytest.mark.parallel
@pytest.mark.parametrize("element", ["Q1", "P2", "Q2-P1d", "P2-P1", "P1-bubble", "Q1-P0"])
@pytest.mark.parametrize("cells", [2, 4])
def test_ranks_agree(element: str, cells: int) -> None:
    """On few cells some rank has none of a region; with a volume part that is not quadratic."""
    linear = "iterative" if cells == 4 else "direct"
    results = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        nu = 0.45 if ELEMENTS[element].pressure is None else 0.499
        solids: dict[str | None, Solid] = {
            "inner": Solid(tuned_energy("neo-hookean", 100.0, 0.3)),
            None: Solid(tuned_energy("stable-neo-hookean", 1.0, nu)),
        }
        run = ended(Body(meshed(element, cells, half, comm), solids, element, PULLED), linear=linear, tolerance=1e-10)
        fields = {key: comm.allreduce(float(np.sum(own))) for key, own in run.fields("region", "von_mises").items()}
        results.append((run.summary.steps[-1], run.summary.dofs, fields))
    (one, size, fields), (two, other, others) = results
    assert one.energy == pytest.approx(two.energy, rel=1e-9)
    assert one.reaction["right"] == pytest.approx(two.reaction["right"], rel=1e-6, abs=1e-9)
    assert size == other
    assert fields == pytest.approx(others, rel=1e-7)
