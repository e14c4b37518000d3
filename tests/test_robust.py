"""The minimiser where solvers break: twisted, scrambled, collapsed, and what is told when nothing helps."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bodies
import numpy as np
import pytest
from bodies import free_stiffness, made, newton_steps, nodal, shipped
from scipy.linalg import eigvalsh

from elastune.app.body.body import Body
from elastune.app.body.shapes import Start, started
from elastune.app.body.unknowns import State
from elastune.app.path.follow import follow
from elastune.app.path.steps import PathFailure
from elastune.app.results.diagnose import diagnose
from elastune.app.scene.build import options, start
from elastune.app.scene.read import load
from elastune.app.solvers.options import Options
from elastune.app.verify.independent import out_of_balance

HEX, TET = ["mesh.cell=hexahedron", "solve.element=Q1"], ["mesh.cell=tetrahedron", "solve.element=P1"]
HEX2, TET2 = ["mesh.cell=hexahedron", "solve.element=Q2"], ["mesh.cell=tetrahedron", "solve.element=P2"]
BARRIER = "material.name=stable-neo-hookean-barrier"


def steps_home(name: str, *overrides: str) -> int:
    """Newton steps to the shape at rest; the test fails if the body ends elsewhere."""
    run = shipped(name, *overrides)
    assert np.abs(run.body.state.values).max() < 1e-8, overrides
    assert out_of_balance(run.body) < 1e-8
    return newton_steps(run)


# ---------------------------------------------------------------------- twist


@pytest.mark.parametrize("linear", ["direct", "iterative"])
def test_twist_by_half_a_turn(linear: str) -> None:
    quarter, half = shipped("cube-twist", "solve.tolerance=1e-10", f'solve.linear="{linear}"').summary.steps
    assert (quarter.load, half.load) == (0.5, 1.0)
    assert quarter.newton_iterations <= 12
    assert half.newton_iterations <= 14
    assert quarter.linear_iterations <= 700
    assert half.linear_iterations <= 900


@pytest.mark.parametrize(
    ("material", "energies"),
    [("stable-neo-hookean", (0.0636284974, 0.260457354)), ("fixed-corotational", (0.0657089823, 0.286787029))],
)
def test_twist_energies(material: str, energies: tuple[float, float]) -> None:
    run = shipped("cube-twist", "solve.tolerance=1e-10", f"material.name={material}")
    assert [record.energy for record in run.summary.steps] == pytest.approx(energies, rel=1e-8)


def test_twist_ends_symmetric_where_cells_buckle() -> None:
    """At nu = 0.3 on few cells the twisted cube has a saddle point, at which filtered steps end or crawl."""
    *_, last = shipped("cube-twist", "mesh.cells=4", "material.nu=0.3", "solve.tolerance=1e-10").summary.steps
    assert last.load == 1.0
    assert last.newton_iterations <= 60


# ---------------------------------------------------------------------- scramble


@pytest.mark.parametrize("cell", [HEX, TET], ids=["hex", "tet"])
@pytest.mark.parametrize("seed", range(4))
def test_scrambled_cube_comes_home(cell: list[str], seed: int) -> None:
    assert steps_home("scramble", *cell, f"start.seed={seed}") <= 120


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.49, 0.499])
@pytest.mark.parametrize("cell", [HEX, TET], ids=["hex", "tet"])
def test_a_hundred_scrambled_cubes_come_home(cell: list[str], nu: float) -> None:
    steps = [steps_home("scramble", *cell, f"material.nu={nu}", f"start.seed={seed}") for seed in range(100)]
    assert np.median(steps) <= 50
    assert max(steps) <= 120


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.49, 0.499])
@pytest.mark.parametrize("cell", [HEX2, TET2], ids=["hex", "tet"])
def test_twenty_scrambled_cubes_of_second_order_come_home(cell: list[str], nu: float) -> None:
    for seed in range(20):
        assert steps_home("scramble", "mesh.cells=4", *cell, f"material.nu={nu}", f"start.seed={seed}") <= 120


@pytest.mark.parametrize("cell", [HEX2, TET2], ids=["hex", "tet"])
def test_scrambled_nodes_of_second_order_come_home(cell: list[str]) -> None:
    assert steps_home("scramble", "mesh.cells=3", *cell) <= 120


@pytest.mark.parametrize("setting", ["solve.method=trust-region", "solve.filter=absolute", BARRIER])
def test_other_methods_bring_it_home(setting: str) -> None:
    assert steps_home("scramble", "mesh.cells=5", setting) <= 120


def test_scramble_is_the_same_on_any_number_of_ranks(solved: Callable[..., Any]) -> None:
    """The energies at home are zero: what is compared is a body that is squeezed as it comes home."""
    squeezed = ["mesh.cells=4", "boundary.left={fix=true}", "boundary.right={move=[-0.2,0.0,0.0]}", "start.pins=[]"]
    one, three = (solved("scramble", *squeezed, ranks=ranks) for ranks in (1, 3))
    assert one["steps"][-1]["energy"] > 1e-3
    assert one["steps"][-1]["energy"] == pytest.approx(three["steps"][-1]["energy"], rel=1e-9)


def test_scramble_fills_twice_the_volume() -> None:
    body = made(load("scramble"))
    places = body.points + started(body, Start("scramble")).reshape(-1, 3)
    edge = 2 ** (1 / 3)
    assert np.abs(places - 0.5).max() <= edge / 2
    assert np.ptp(places, axis=0) == pytest.approx(edge, rel=0.01)
    assert body.held.sum() == 12


# ---------------------------------------------------------------------- collapse


@pytest.mark.parametrize("material", ["stable-neo-hookean", "stable-neo-hookean-barrier"])
@pytest.mark.parametrize("shape", ["plane", "line", "point", "inside-out"])
@pytest.mark.parametrize("cell", [HEX, TET], ids=["hex", "tet"])
def test_collapsed_cube_comes_home(cell: list[str], shape: str, material: str) -> None:
    assert steps_home("collapse", *cell, f"start.shape={shape}", f"material.name={material}") <= 120


@pytest.mark.parametrize("shape", ["plane", "line", "point", "inside-out"])
def test_collapsed_cube_on_a_wall_comes_home(shape: str) -> None:
    settings = ["start.pins=[]", "boundary.left={fix=true}", f"start.shape={shape}", "mesh.cells=5"]
    assert steps_home("collapse", *settings) <= 120


# ---------------------------------------------------------------------- buckling

# Clamped at both ends and eight times as high as wide: it buckles at a strain of about 4 pi^2/12 / 8^2 = 5 %.
COLUMN = [
    "mesh.shape=box", "mesh.size=[1.0, 0.8, 8.0]", "mesh.cells=[2, 2, 8]", "solve.element=Q2", "solve.steps=1",
    "material.nu=0.3", "boundary.top={move=[0.0, 0.0, -1.2]}", "output.picture=false",
]  # fmt: skip


def least_eigenvalue(body: Body) -> float:
    """Of the tangent at the body's state, between the free displacements."""
    return float(eigvalsh(free_stiffness(body), subset_by_index=[0, 0])[0])


@pytest.mark.parametrize("linear", ["direct", "iterative"])
def test_column_buckles(linear: str) -> None:
    """The straight column is in balance, but no minimum."""
    body = shipped("squeeze", *COLUMN, f"solve.linear={linear}").body
    assert least_eigenvalue(body) > 0
    assert np.abs(nodal(body)[:, :2]).max() > 1
    straight = np.zeros_like(nodal(body))
    straight[:, 2] = -0.15 * body.points[:, 2]
    assert body.assembly.energy(body.state) < 0.5 * body.assembly.energy(State(straight.ravel(), 1.0))


def test_column_buckles_on_any_number_of_ranks(solved: Callable[..., Any]) -> None:
    one, two = (solved("squeeze", *COLUMN, ranks=ranks)["steps"][-1] for ranks in (1, 2))
    assert one["energy"] == pytest.approx(two["energy"], rel=1e-9)


@pytest.mark.parametrize(
    ("material", "nu"),
    [("fixed-corotational", 0.499), ("valanis-landel", 0.49), ("neo-hookean", 0.49), ("symmetric-seth-hill", 0.45)],
)
def test_squeezed_cube_buckles(material: str, nu: float) -> None:
    """Its sides fold at some load; filtered steps then crawl along the saddle point that the unfolded shape is."""
    settings = ["mesh.cells=4", "solve.smallest_step=0.01", f"material.name={material}", f"material.nu={nu}"]
    assert least_eigenvalue(shipped("squeeze", *settings).body) > 0


# ---------------------------------------------------------------------- the stretched cylinder


def test_stable_neo_hookean_keeps_its_volume_best() -> None:
    changes = {}
    for name in ("stable-neo-hookean", "fixed-corotational", "neo-hookean"):
        extension = ["material.extension=0.25"] if name == "neo-hookean" else []
        run = shipped("cylinder-stretch", f"material.name={name}", *extension)
        changes[name] = abs(run.summary.steps[-1].volume_ratio - 1)
    assert min(changes, key=changes.__getitem__) == "stable-neo-hookean"
    assert max(changes.values()) < 0.05


def test_corotational_cylinder_collapses_and_is_reported(solved: Callable[..., Any]) -> None:
    summary = solved("cylinder-stretch", "material.name=linear-corotational", "solve.smallest_step=0.2")
    assert summary["steps"][-1]["volume_ratio"] < 0.25
    diagnosis = summary["failure"]["diagnosis"]
    assert diagnosis["inverted_cells"] > 0
    assert any("another material" in advice for advice in diagnosis["advice"])


# ---------------------------------------------------------------------- failures


CRUSH = [
    "mesh.cells=3",
    "solve.steps=4",
    "solve.smallest_step=0.5",
    "material.nu=0.3",
    "boundary.right.move=[-1.3,0.0,0.0]",
]


def test_failure_has_a_diagnosis_and_the_last_good_state(solved: Callable[..., Any], tmp_path: Path) -> None:
    summary = solved("cube-pull", *CRUSH)
    failure = summary["failure"]
    found = failure["diagnosis"]
    assert summary["status"] == "failed"
    assert summary["steps"][-1]["load"] < failure["load"]
    assert set(found) == {
        "inverted_cells", "worst_cells", "J", "stretches", "ellipticity", "residual", "energy", "unbounded_below",
        "locking", "advice",
    }  # fmt: skip
    assert found["advice"]
    json.dumps(found, allow_nan=False)


def diagnosis_of(name: str, *overrides: str, kind: str = "stalled", scale: float = 0.0) -> dict[str, Any]:
    """Of the shape at rest, or of one compressed along x."""
    body = made(load(name, overrides))
    values = np.zeros_like(nodal(body))
    values[:, 0] = -scale * body.points[:, 0]
    return diagnose(body, Options(), State(values.ravel()), kind)


def test_diagnosis_finds_inverted_cells() -> None:
    found = diagnosis_of("cube-pull", "mesh.cells=3", "material.name=stable-neo-hookean", scale=1.5)
    assert found["inverted_cells"] == 27
    assert found["J"] == pytest.approx([-0.5, -0.5])
    assert found["stretches"] == pytest.approx([0.5, 1.0])


def test_diagnosis_finds_locking() -> None:
    found = diagnosis_of("cube-pull", "mesh.cells=2", *TET, "material.nu=0.49")
    assert "P1" in found["locking"]
    assert any("P2" in advice for advice in found["advice"])
    assert diagnosis_of("cube-pull", "mesh.cells=2", "solve.element=Q2", "material.nu=0.49")["locking"] is None


def test_diagnosis_finds_loss_of_ellipticity() -> None:
    """St. Venant-Kirchhoff under uniaxial compression beyond 1/sqrt(3), and not before."""
    settings = ("mesh.cells=2", "material.name=st-venant-kirchhoff")
    assert diagnosis_of("cube-pull", *settings, scale=0.5)["ellipticity"] < 0
    assert diagnosis_of("cube-pull", *settings, scale=0.1)["ellipticity"] > 0


def test_diagnosis_finds_energies_that_grow_too_slowly() -> None:
    pulled = ["mesh.cells=2", "boundary.right={pull=[1.0,0.0,0.0]}"]
    assert diagnosis_of("cube-pull", *pulled, "material.name=hencky")["unbounded_below"]
    assert not diagnosis_of("cube-pull", *pulled)["unbounded_below"]


def test_time_limit() -> None:
    given = load("scramble", ["solve.time_limit=0.05"])
    with pytest.raises(PathFailure) as caught:
        list(follow(made(given), options(given), start(given)))
    assert caught.value.kind == "time"
    assert caught.value.state is not None


def test_independent_residual_agrees_with_the_kernel() -> None:
    """At a random state: by UFL, and by singular values in numpy."""
    for material in ("stable-neo-hookean", "linear-corotational", "st-venant-kirchhoff", "fixed-corotational"):
        for cell in (HEX, TET, ["solve.element=Q2"]):
            body = made(load("scramble", ["mesh.cells=2", f"material.name={material}", *cell]))
            values = np.where(body.held, 0.0, 0.1 * np.random.default_rng(0).standard_normal(body.size))
            residual = bodies.out_of_balance(body, values)
            assert out_of_balance(body) == pytest.approx(body.layout.norm(residual), rel=1e-10)
