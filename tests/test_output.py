"""What a run leaves: fields against closed forms, files against the readers that people use, and every failure."""

import csv
import json
import logging
import math
import os
import resource
import subprocess
import sys
import typing
import xml.etree.ElementTree as xml
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dolfinx.mesh import entities_to_geometry
from mpi4py import MPI
from scipy.linalg import logm

from elastune.app.body.body import Body
from elastune.app.body.conditions.loads import BodyForce, Pressure, Pull
from elastune.app.body.conditions.motions import Clamp, Rotation, Translation
from elastune.app.body.conditions.places import Everywhere, Face
from elastune.app.body.unknowns import State
from elastune.app.errors import SceneError, UserError
from elastune.app.results.fields import CELL_FIELDS, Fields
from elastune.app.results.files import replace_text
from elastune.app.results.folder import Outputs, RunFolder
from elastune.app.results.measures import Measures
from elastune.app.results.pictures import curve, picture
from elastune.app.results.record import Failure, Record, Summary
from elastune.app.results.xdmf import FieldFile, WholeMesh
from elastune.app.scene.schema.output import Output
from elastune.forms.materials import make
from elastune.geometry import build

ALL = ["displacement", "J", "von_mises", "pressure", "stretches", "energy", "stress"]
ALL += ["max_principal", "pk1", "log_strain"]
LAM, MU = 0.7, 0.4
SHEARED = np.array([[1.3, 0.2, -0.1], [0.05, 0.8, 0.3], [0.1, -0.2, 1.1]])

# Cell, its order, and the degree of the displacement: equal, higher and lower.
CASES = [
    *[(cell, order, order) for cell in ("tetrahedron", "hexahedron", "triangle", "quadrilateral") for order in (1, 2)],
    *[("tetrahedron", 1, 3), ("hexahedron", 1, 2), ("hexahedron", 2, 1), ("quadrilateral", 2, 3)],
]


def _deformed(
    cell: str,
    order: int,
    degree: int,
    F: np.ndarray,
    comm: Any = MPI.COMM_SELF,
    energy: Any = None,
    quadrature: Any = None,
) -> Body:
    """A body of two by two cells with U = (F - I) X."""
    solid = cell in ("tetrahedron", "hexahedron")
    geometry = build(comm, shape="cube" if solid else "square", cells=2, cell=cell, order=order)
    letter = "P" if cell in ("tetrahedron", "triangle") else "Q"
    energy = energy or make("neo-hookean", lam=LAM, mu=MU)
    motion = (0.3, 0.0, 0.4) if solid else (0.3, 0.4)
    conditions = {"left": Clamp(), "right": Translation(motion)}
    body = Body(geometry, energy, f"{letter}{degree}", conditions)
    _bend(body, lambda X: X @ (F - np.eye(3)).T)
    return body


def _bend(body: Body, displacement: Any) -> None:
    body.take(State(body.layout.joined(displacement(body.points)[:, : body.dimension].ravel())))


def _count(mesh: Any) -> int:
    return int(mesh.topology.index_map(mesh.topology.dim).size_local)


def _plane(F: np.ndarray, d: int) -> np.ndarray:
    """F in three dimensions, F in its plane in two."""
    G = np.eye(3)
    G[:d, :d] = F[:d, :d]
    return G


def _neo_hookean(F: np.ndarray) -> dict[str, Any]:
    J = np.linalg.det(F)
    C = F.T @ F
    sigma = (MU * (F @ F.T - np.eye(3)) + LAM * math.log(J) * np.eye(3)) / J
    principal = np.linalg.eigvalsh(sigma)
    return {
        "J": J,
        "stretches": np.sqrt(np.linalg.eigvalsh(C))[::-1],
        "energy": MU / 2 * (np.trace(C) - 3) - MU * math.log(J) + LAM / 2 * math.log(J) ** 2,
        "stress": sigma,
        "pressure": -np.trace(sigma) / 3,
        "max_principal": principal[-1],
        "pk1": J * sigma @ np.linalg.inv(F).T,
        "log_strain": logm(F @ F.T).real / 2,
        "von_mises": math.sqrt(sum((principal[i] - principal[i - 1]) ** 2 for i in range(3)) / 2),
    }


# ---------------------------------------------------------------- fields


def test_registry_has_what_a_scene_may_ask_for() -> None:
    annotation = Output.model_fields["fields"].annotation
    allowed = typing.get_args(typing.get_args(annotation)[0])
    assert sorted(allowed) == sorted(["displacement", "region", *CELL_FIELDS])
    assert sorted(allowed) == sorted(["region", *ALL])


@pytest.mark.parametrize(("cell", "order", "degree"), CASES)
def test_fields_of_a_uniform_deformation(cell: str, order: int, degree: int) -> None:
    body = _deformed(cell, order, degree, SHEARED)
    mesh = body.geometry.mesh
    F = _plane(SHEARED, mesh.geometry.dim)
    fields = Fields(body)
    cells = fields.cells(CELL_FIELDS)
    for name, expected in _neo_hookean(F).items():
        values = cells[name]
        assert len(values) == _count(mesh)
        np.testing.assert_allclose(values, np.broadcast_to(expected, values.shape), atol=2e-12, err_msg=name)
        nodes = fields.averages([name])[name]
        assert len(nodes) == len(mesh.geometry.x)
        np.testing.assert_allclose(nodes, np.broadcast_to(expected, nodes.shape), atol=2e-12, err_msg=name)
    np.testing.assert_allclose(fields.displacement(), mesh.geometry.x @ (F - np.eye(3)).T, atol=1e-13)
    corners = [x for x in mesh.geometry.x if set(x) <= {0.0, 1.0}]
    largest = max(np.linalg.norm((F - np.eye(3)) @ x) for x in corners)
    assert Measures(body).largest_displacement() == pytest.approx(largest, abs=1e-13)


def averaged(comm: Any) -> None:
    """J = 1 + x²/2 on cells cut at x = 1/2: nodes at the ends have a cell's mean, those between the mean of both."""
    body = _deformed("hexahedron", 1, 3, np.eye(3), comm)
    _bend(body, lambda X: np.column_stack([X[:, 0] ** 3 / 6, 0 * X[:, 1:]]))
    x, found = body.geometry.mesh.geometry.x, Fields(body).averages(["J", "stretches"])
    owned = x[: body.geometry.mesh.geometry.index_map().size_local, 0]
    ends = {0.0: 1 + 1 / 24, 0.5: 1 + 1 / 6, 1.0: 1 + 7 / 24}
    np.testing.assert_allclose(found["J"], [ends[place] for place in owned], rtol=1e-12)
    np.testing.assert_allclose(found["stretches"][:, 0], found["J"], rtol=1e-12)


def test_averages_at_nodes() -> None:
    averaged(MPI.COMM_SELF)


@pytest.mark.parallel
def test_averages_on_all_ranks() -> None:
    averaged(MPI.COMM_WORLD)


def test_averages_are_written(tmp_path: Path) -> None:
    outputs = Outputs(fields=("displacement", "J", "region"), average=True, picture=False)
    RunFolder(tmp_path, outputs, MPI.COMM_SELF).start(_deformed("tetrahedron", 1, 1, SHEARED))
    attributes = xml.parse(tmp_path / "fields.xdmf").iter("Attribute")
    centers = {entry.get("Name"): entry.get("Center") for entry in attributes}
    assert centers == {"displacement": "Node", "J": "Node", "region": "Cell"}


def test_only_what_is_asked_for_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*arguments: Any, **options: Any) -> None:
        raise AssertionError("the kernel was called")

    monkeypatch.setattr("elastune.forms.response.stress", never)
    fields = Fields(_deformed("hexahedron", 1, 1, SHEARED))
    assert list(fields.cells(["J", "stretches"])) == ["J", "stretches"]
    with pytest.raises(AssertionError):
        fields.cells(["energy"])


def test_average_of_J_is_the_ratio_of_volumes(monkeypatch: pytest.MonkeyPatch) -> None:
    """On curved cells, whose points carry different volumes, and in several blocks."""
    monkeypatch.setattr("elastune.app.results.fields.whole.BLOCK", 100)
    geometry = build(MPI.COMM_SELF, shape="cylinder", size=[0.5, 1.0], cells=4, order=2)
    body = Body(geometry, make("neo-hookean"), "Q2", {"bottom": Clamp()}, quadrature=8)
    mesh = geometry.mesh
    x, nodes = mesh.geometry.x, entities_to_geometry(mesh, 3, np.arange(_count(mesh), dtype=np.int32))
    rest = _volumes(x[nodes], mesh)
    _bend(
        body,
        lambda X: np.stack([0.3 * X[:, 0] * X[:, 1], 0.2 * X[:, 0] ** 2 + 0.1 * X[:, 2], -0.2 * X[:, 2] ** 2], axis=1),
    )
    fields = Fields(body)
    deformed = _volumes((x + fields.displacement())[nodes], mesh)
    assert np.ptp(deformed / rest) > 0.1
    np.testing.assert_allclose(fields.cells(["J"])["J"], deformed / rest, rtol=1e-12)


def _volumes(nodes: np.ndarray, mesh: Any) -> np.ndarray:
    """Volumes of cells from the coordinates of their nodes, shape (cells, nodes, 3)."""
    import basix

    element = mesh.ufl_domain().ufl_coordinate_element().basix_element
    points, weights = basix.make_quadrature(element.cell_type, 9)
    gradients = element.tabulate(1, points)[1:, :, :, 0]
    jacobians = np.einsum("dpn,cnx->cpxd", gradients, nodes)
    return np.linalg.det(jacobians) @ weights


def test_inverted_cells_have_a_negative_stretch_and_collapsed_ones_no_warning() -> None:
    for last, energy in ((-0.5, "stable-neo-hookean"), (0.0, "stable-neo-hookean")):
        body = _deformed("tetrahedron", 1, 1, np.diag([2.0, 1.5, last]), energy=make(energy))
        cells = Fields(body).cells(CELL_FIELDS)
        np.testing.assert_allclose(cells["stretches"], np.tile([2.0, 1.5, last], (48, 1)), atol=1e-13)
        assert np.isfinite(cells["energy"]).all()


def test_energy_of_the_small_strain() -> None:
    body = _deformed("hexahedron", 1, 1, SHEARED, energy=make("linear-elasticity", lam=LAM, mu=MU))
    cells = Fields(body).cells(["energy", "stress"])
    strain = (SHEARED + SHEARED.T) / 2 - np.eye(3)
    P = LAM * np.trace(strain) * np.eye(3) + 2 * MU * strain
    np.testing.assert_allclose(cells["energy"], np.sum(P * strain) / 2, rtol=1e-12)
    expected = P @ SHEARED.T / np.linalg.det(SHEARED)
    np.testing.assert_allclose(cells["stress"], np.broadcast_to(expected, (8, 3, 3)), atol=1e-13)


# ---------------------------------------------------------------- the field file


def _write(folder: Path, body: Body, times: tuple[float, ...] = (0.0, 0.5, 1.0)) -> None:
    """Steps t of the displacement t u, with all fields."""
    full, fields, whole = body.state.values, Fields(body), WholeMesh(body.geometry.mesh)
    file = FieldFile(folder, whole) if body.comm.rank == 0 else None
    for time in times:
        body.take(State(time * full))
        nodes = {"displacement": whole.nodes_to_root(fields.displacement())}
        cells = {name: whole.cells_to_root(values) for name, values in fields.cells(CELL_FIELDS).items()}
        if file:
            file.write(time, nodes, cells)


Read = tuple[np.ndarray, np.ndarray, str, list[tuple[float, dict[str, np.ndarray]]]]

# What VTK calls meshio's cells: its own node order is what the file must have.
VTK_CELLS = {
    "tetra": "vtkTetra",
    "tetra10": "vtkQuadraticTetra",
    "hexahedron": "vtkHexahedron",
    "hexahedron27": "vtkTriQuadraticHexahedron",
    "triangle": "vtkTriangle",
    "triangle6": "vtkQuadraticTriangle",
    "quad": "vtkQuad",
    "quad9": "vtkBiQuadraticQuad",
}


def _read(folder: Path) -> Read:
    """Points, cells, their type, and the steps with all fields, as another program sees them."""
    import meshio

    with meshio.xdmf.TimeSeriesReader(folder / "fields.xdmf") as reader:
        points, cells = reader.read_points_cells()
        steps = []
        for k in range(reader.num_steps):
            time, at_nodes, in_cells = reader.read_data(k)
            steps.append((time, at_nodes | {name: parts[0] for name, parts in in_cells.items()}))
    return points, cells[0].data, cells[0].type, steps


def _check_file(folder: Path, F: np.ndarray) -> None:
    points, cells, kind, steps = _read(folder)
    d = 3 if kind.startswith(("tetra", "hexa")) else 2
    assert [time for time, _ in steps] == [0.0, 0.5, 1.0]
    for time, found in steps:
        G = np.eye(3) + time * (_plane(F, d) - np.eye(3))
        expected = _neo_hookean(G)
        assert found.keys() == {"displacement", *expected}
        np.testing.assert_allclose(found["displacement"], points @ (G - np.eye(3)).T, atol=1e-13)
        assert found["stress"].shape == (len(cells), 9)
        for name, values in expected.items():
            flat = np.broadcast_to(np.ravel(values) if np.ndim(values) else values, found[name].shape)
            np.testing.assert_allclose(found[name], flat, atol=2e-12, err_msg=name)


@pytest.mark.parametrize(("cell", "order", "degree"), CASES)
def test_field_file_is_read_by_others(cell: str, order: int, degree: int, tmp_path: Path) -> None:
    from vtkmodules import vtkCommonDataModel

    _write(tmp_path, _deformed(cell, order, degree, SHEARED))
    _check_file(tmp_path, SHEARED)
    points, cells, kind, _ = _read(tmp_path)
    standard = getattr(vtkCommonDataModel, VTK_CELLS[kind])().GetParametricCoords()
    standard = np.c_[np.reshape(standard, (-1, 3)), np.ones(cells.shape[1])]
    for nodes in cells:
        # The nodes are an affine image of those of VTK's standard cell, in this order, not turned inside out.
        image = np.linalg.lstsq(standard, points[nodes], rcond=None)[0]
        np.testing.assert_allclose(standard @ image, points[nodes], atol=1e-12)
        assert np.linalg.det(image[:3] if np.ptp(points[:, 2]) else image[:2, :2]) > 1e-3


def test_one_grid_a_step_and_the_mesh_only_once(tmp_path: Path) -> None:
    import xml.etree.ElementTree as ET

    import h5py

    _write(tmp_path, _deformed("hexahedron", 1, 1, SHEARED))
    collection = ET.parse(tmp_path / "fields.xdmf").find("Domain/Grid[@CollectionType='Temporal']")
    assert collection is not None
    assert [len(grid.findall("Attribute")) for grid in collection] == 3 * [len(ALL)]
    assert sorted(os.listdir(tmp_path / "fields")) == ["0000.h5", "0001.h5", "0002.h5", "mesh.h5"]
    with h5py.File(tmp_path / "fields" / "mesh.h5") as file:
        assert set(file) == {"points", "cells"}


PARALLEL = """
import sys
from pathlib import Path
from mpi4py import MPI
from scipy.linalg import logm
sys.path.insert(0, sys.argv[1])
import test_output as t
comm, folder = MPI.COMM_WORLD, Path(sys.argv[2])
body = t._deformed("tetrahedron", 2, 2, t.SHEARED, comm)
full = body.state.values.copy()
t._write(folder, body)
body.take(t.State(full))
summary, files = t._play(t.RunFolder(folder / "run", t.OUTPUTS, comm), body)
assert (len(files) > 0) == (comm.rank == 0)
assert summary.peak_memory_mb > comm.size * 20
try:
    t.RunFolder(folder / "fields.xdmf" / "below", t.OUTPUTS, comm)
except t.SceneError as error:
    print(f"rank {comm.rank}: {error}")
"""


def test_two_ranks_write_what_one_writes(tmp_path: Path) -> None:
    command = ["mpirun", "-n", "2", sys.executable, "-c", PARALLEL, str(Path(__file__).parent), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    # Ranks write when they like: their lines may run together.
    assert all(f"rank {rank}: " in done.stdout for rank in (0, 1)), done.stdout
    (tmp_path / "one").mkdir()
    _write(tmp_path / "one", _deformed("tetrahedron", 2, 2, SHEARED))
    _check_file(tmp_path, SHEARED)
    for two, one in zip(_read(tmp_path)[:3], _read(tmp_path / "one")[:3], strict=True):
        np.testing.assert_array_equal(two, one)
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["steps"][1]["max_displacement"] > 0


KILLED = """
import os, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import h5py
import test_output as t

def die(*arguments):
    os._exit(9)

def die_at(owner, name, wanted, half=False):
    real, calls = getattr(owner, name), 0
    def stop(self, *arguments, **options):
        nonlocal calls
        calls += bool(wanted(self))
        if calls == 1 and wanted(self):
            if half:
                with open(self, "wb") as file:
                    file.write(arguments[0][: len(arguments[0]) // 2])
            os._exit(9)
        return real(self, *arguments, **options)
    setattr(owner, name, stop)

where = sys.argv[3]
last = lambda path: path.name == ".0003.h5.part"
if where == "half":
    die_at(Path, "write_bytes", last, half=True)
elif where == "rename":
    die_at(Path, "replace", last)
elif where in ("add", "close"):
    owner, name = (h5py.Group, "__setitem__") if where == "add" else (h5py.File, "close")
    real, files = getattr(owner, name), []
    def stop(self, *arguments):
        if not files or files[-1] is not self.id:
            files.append(self.id)
        result = real(self, *arguments)
        # The mesh, and three steps, are before it.
        if len(files) == 5:
            os._exit(9)
        return result
    setattr(owner, name, stop)
else:
    real, synced = os.fsync, 0
    def stop(descriptor):
        global synced
        name = os.readlink(f"/proc/self/fd/{descriptor}")
        synced += name.endswith(".h5.part")
        if synced == 5 and ("xdmf" in name) == (where == "document"):
            os._exit(9)
        real(descriptor)
    os.fsync = stop
t._write(Path(sys.argv[2]), t._deformed("hexahedron", 1, 1, t.SHEARED), (0.0, 0.5, 1.0, 2.0))
"""


@pytest.mark.parametrize("where", ["add", "close", "half", "sync", "rename", "document"])
def test_run_killed_in_the_middle_of_a_step_keeps_the_steps_before(where: str, tmp_path: Path) -> None:
    command = [sys.executable, "-c", KILLED, str(Path(__file__).parent), str(tmp_path), where]
    assert subprocess.run(command, timeout=60, check=False).returncode == 9
    _check_file(tmp_path, SHEARED)
    # What is left aside is gone when the next run begins, and what is not ours stays.
    left = [path.name for path in (tmp_path / "fields").iterdir() if path.name.endswith(".part")]
    assert left == ([".0003.h5.part"] if where in ("half", "sync", "rename") else [])
    (tmp_path / "fields" / "mine.txt").write_text("mine")
    RunFolder(tmp_path, Outputs(fields=(), picture=False), MPI.COMM_SELF).start(_deformed("hexahedron", 1, 1, SHEARED))
    assert [path.name for path in tmp_path.rglob("*")] == ["fields", "mine.txt"]


def test_half_a_file_aside_hides_nothing(tmp_path: Path) -> None:
    _write(tmp_path, _deformed("hexahedron", 1, 1, SHEARED))
    whole = (tmp_path / "fields" / "0002.h5").read_bytes()
    for size in (0, 100, len(whole) // 2, len(whole) - 1):
        (tmp_path / "fields" / ".0003.h5.part").write_bytes(whole[:size])
        (tmp_path / ".fields.xdmf.part").write_bytes((tmp_path / "fields.xdmf").read_bytes()[:size])
        _check_file(tmp_path, SHEARED)


def test_file_that_another_program_reads_can_be_written(tmp_path: Path) -> None:
    file = FieldFile(tmp_path, WholeMesh(_deformed("hexahedron", 1, 1, SHEARED).geometry.mesh))
    reader = "import h5py, sys; file = h5py.File(sys.argv[1]); print('open', flush=True); sys.stdin.read()"
    with subprocess.Popen(
        [sys.executable, "-c", reader, str(tmp_path / "fields" / "mesh.h5")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"open\n"
        file.write(0.0, {}, {"J": np.ones(8)})
        other.communicate()
    assert _read(tmp_path)[3][0][1].keys() == {"J"}


def test_text_is_replaced_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "summary.json"
    replace_text(path, "old")

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        replace_text(path, "new")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["summary.json"]


# ---------------------------------------------------------------- the folder of a run


OUTPUTS = Outputs("pulled", ("displacement", "von_mises"), picture=False)


def _record(number: int, load: float, d: int = 3) -> Record:
    reaction = {"left": [-load, 0.0, 0.0][:d], "right": [load, 0.0, 2 * load][-d:]}
    return Record(load, load**2, reaction, 1.0, 0.9, 3, 7, 0.1, number, "", 7 * load)


def _play(
    output: RunFolder, body: Body, loads: tuple[float, ...] = (0.5, 1.0), failure: Failure | None = None
) -> tuple[Summary, list[Path]]:
    """A run without a solver."""
    full = body.state.values
    body.take(State(np.zeros_like(full)))
    output.start(body, "scene")
    records = [_record(number, load, body.dimension) for number, load in enumerate(loads, 1)]
    for record in records:
        body.take(State(record.load * full))
        output.step(record)
    summary = Summary("pulled", "failed" if failure else "converged", failure, {"name": "neo-hookean"}, "Q1", 8, 81, 1)
    summary.steps = records
    return summary, output.finish(summary)


def _names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


NUMBERS = ["fields", "fields.xdmf", "history.csv", "scene.toml", "summary.json"]
PICTURES = ["curve.png", "deformed.png"]
DRAWN = replace(OUTPUTS, picture=True)


def test_a_run_leaves_summary_history_and_fields(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    output = RunFolder(folder, OUTPUTS, MPI.COMM_SELF)
    assert not (tmp_path / "a").exists(), "nothing may be written before the run starts"
    summary, files = _play(output, _deformed("hexahedron", 1, 1, SHEARED))
    assert _names(folder) == NUMBERS == sorted(path.name for path in files)

    document = json.loads((folder / "summary.json").read_text())
    assert list(document) == [
        "scene", "status", "failure", "material", "element", "cells", "dofs", "ranks",
        "steps", "wall_s", "peak_memory_mb", "versions", "materials", "events", "locking",
    ]  # fmt: skip
    assert {"elastune", "dolfinx", "petsc", "python"} <= set(document["versions"])
    assert all(version[0].isdigit() for version in document["versions"].values())
    assert 20 < document["peak_memory_mb"] < 1e5
    assert document["steps"] == [vars(record) for record in summary.steps]

    with (folder / "history.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["load"]) for row in rows] == [0.5, 1.0]
    assert [float(row["reaction_right_z"]) for row in rows] == [1.0, 2.0]
    assert [float(row["energy"]) for row in rows] == [0.25, 1.0]
    steps = _read(folder)[3]
    assert [time for time, _ in steps] == [0.0, 0.5, 1.0]
    assert {frozenset(found) for _, found in steps} == {frozenset({"displacement", "von_mises"})}
    assert steps[0][1]["von_mises"].max() < 1e-14 < 0.1 < steps[2][1]["von_mises"].min()


def test_no_field_nobody_asked_for(tmp_path: Path) -> None:
    nothing = RunFolder(tmp_path, Outputs(fields=(), picture=False), MPI.COMM_SELF)
    _, files = _play(nothing, _deformed("hexahedron", 1, 1, SHEARED))
    assert [path.name for path in files] == ["scene.toml", "summary.json", "history.csv"]


def test_two_states_of_one_load_are_two_steps(tmp_path: Path) -> None:
    """Beyond a limit load the load falls again."""
    _play(RunFolder(tmp_path, OUTPUTS, MPI.COMM_SELF), _deformed("hexahedron", 1, 1, SHEARED), (0.5, 1.0, 0.5))
    steps = json.loads((tmp_path / "summary.json").read_text())["steps"]
    assert [(step["number"], step["load"]) for step in steps] == [(1, 0.5), (2, 1.0), (3, 0.5)]
    assert [time for time, _ in _read(tmp_path)[3]] == [0.0, 0.5, 1.0, 0.5]


def test_failed_run_leaves_the_same_files(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    failure = Failure("line_search", "no descent", 0.25)
    (tmp_path / "curve.png").write_text("of an earlier run")
    for loads in ((0.5,), ()):
        output = RunFolder(tmp_path, DRAWN, MPI.COMM_SELF)
        _play(output, _deformed("quadrilateral", 2, 2, SHEARED), loads, failure)
        assert _names(tmp_path) == sorted(NUMBERS + PICTURES)
        document = json.loads((tmp_path / "summary.json").read_text())
        assert document["status"] == "failed"
        told = {key: document["failure"][key] for key in ("kind", "message", "load")}
        assert told == {"kind": "line_search", "message": "no descent", "load": 0.25}
        assert len(_read(tmp_path)[3]) == len(loads) + 1
    assert caplog.text == ""


def test_numbers_that_JSON_has_not(tmp_path: Path) -> None:
    output = RunFolder(tmp_path, Outputs(fields=(), picture=False), MPI.COMM_SELF)
    output.start(_deformed("hexahedron", 1, 1, SHEARED))
    summary = Summary("x", "converged", None, {"parameters": {"mu": (math.inf, 1.0)}}, "Q1", 8, 81, 1)
    output.finish(summary)
    text = (tmp_path / "summary.json").read_text()
    assert json.loads(text, parse_constant=pytest.fail)["material"] == {"parameters": {"mu": [None, 1.0]}}


@pytest.mark.parametrize("where", ["{}/file/below", "{}/file", "/proc/elastune/deep"])
def test_folder_that_cannot_be_written_is_one_line(where: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    folder = Path(where.format(tmp_path))
    with pytest.raises(SceneError) as caught:
        RunFolder(folder, OUTPUTS, MPI.COMM_SELF)
    assert str(folder) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert _names(tmp_path) == ["file"]


def test_disk_that_fills_up_is_one_line(tmp_path: Path) -> None:
    output = RunFolder(tmp_path, OUTPUTS, MPI.COMM_SELF)
    output.start(_deformed("hexahedron", 2, 2, SHEARED))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(UserError) as caught:
            output.step(_record(1, 0.5))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert str(caught.value).startswith(f"{tmp_path}: cannot be written: ")
    assert "\n" not in str(caught.value)
    assert [time for time, _ in _read(tmp_path)[3]] == [0.0]


# ---------------------------------------------------------------- pictures


def test_picture_and_curve_are_drawn(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    from matplotlib.image import imread

    before = _children()
    _play(RunFolder(tmp_path, DRAWN, MPI.COMM_SELF), _deformed("hexahedron", 2, 2, SHEARED))
    assert caplog.text == ""
    for name in PICTURES:
        pixels = imread(tmp_path / name)
        assert min(pixels.shape[:2]) > 400
        drawn = (pixels[..., :3] < 0.98).any(axis=-1).mean()
        assert 0.01 < drawn < 0.9, f"{name} is empty or full"
    assert _children() <= before


def _children() -> set[str]:
    """Numbers of this process's children, ended ones that nobody waited for among them."""
    return {pid for path in Path("/proc/self/task").glob("*/children") for pid in path.read_text().split()}


@pytest.mark.parametrize("script", ["raise ImportError('no such module:\\n pyvista')", "", "import os; os.abort()"])
def test_picture_that_fails_is_a_warning(
    script: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "render.py").write_text(script)
    monkeypatch.setattr(picture, "RENDER", tmp_path / "render.py")
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    folder = tmp_path / "run"
    _play(RunFolder(folder, DRAWN, MPI.COMM_SELF), _deformed("hexahedron", 1, 1, SHEARED))
    assert _names(folder) == NUMBERS
    assert [record.levelno for record in caplog.records] == [logging.WARNING] * 2
    for record, name in zip(caplog.records, PICTURES, strict=True):
        assert record.getMessage().startswith(f"{name} was not drawn: ")
        assert "\n" not in record.getMessage()


@pytest.mark.parametrize(
    ("condition", "label", "last"),
    [
        (Translation((0.3, 0.0, 0.4)), "displacement of the right face", (0.5, (1.0 * 0.3 + 2.0 * 0.4) / 0.5)),
        (Rotation((1, 0, 0), (0, 0, 0), 90.0), "rotation of the right face", (90.0, 1.0)),
        (Pull((3.0, 0.0, 4.0)), "traction on the right face", (7.0, 5.0)),
        (Pressure(-2.0), "pressure on the right face", (7.0, -2.0)),
    ],
)
def test_points_of_the_curve(condition: Any, label: str, last: tuple[float, float]) -> None:
    labels, points = curve.points(
        [(Face("left"), Clamp()), (Face("right"), condition)], [_record(1, 0.5), _record(2, 1.0)]
    )
    assert any(text.startswith(label) for text in labels)
    assert points[0] == (0.0, 0.0)
    assert len(points) == 3
    assert points[-1] == pytest.approx(last)


def test_curve_of_a_body_force() -> None:
    labels, points = curve.points([(Everywhere(), BodyForce((0.0, 0.0, -9.0)))], [_record(1, 1.0)])
    assert labels == ("largest displacement", "body force")
    assert points == [(0.0, 0.0), (7.0, 9.0)]
