"""The solver against closed forms, published figures, and itself on other numbers of ranks."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import ended, free_stiffness, made, newton_steps
from bodies import solved as solved_run
from dolfinx import fem

from elastune.app.body.body import Body
from elastune.app.body.unknowns import State
from elastune.app.path.follow import follow
from elastune.app.results.measures import Measures
from elastune.app.scene.build import options
from elastune.app.scene.read import parse
from elastune.app.tuning.response import respond
from elastune.forms.energy import CATALOGUE
from elastune.forms.normalize import lame_pair

Tables = dict[str, Any]
BAR: Tables = {"left": {"roller": ["x"]}, "front": {"roller": ["y"]}, "bottom": {"roller": ["z"]}}


def scene(material: Tables, boundary: Tables, **tables: Tables) -> Any:
    data = {
        "mesh": {"cells": 2, **tables.pop("mesh", {})},
        "solve": {"steps": 1, **tables.pop("solve", {})},
        "material": {"E": 2.0, "nu": 0.3, **material},
        "boundary": boundary,
        **tables,
    }
    return parse(data, Path("test.toml"))


def mean(body: Body, face: str) -> np.ndarray:
    """Mean displacement of the nodes of a face, on one rank."""
    facets = body.geometry.facets(face)
    nodes = fem.locate_dofs_topological(body.V, body.geometry.mesh.topology.dim - 1, facets)
    return body.u.x.array.reshape(-1, body.dimension)[nodes].mean(axis=0)


# ---------------------------------------------------------------------- published and earlier figures


@pytest.mark.parametrize("assembly", ["ufl", "spectral"])
def test_cube_pull_reactions(assembly: str, solved: Callable[..., Any]) -> None:
    summary = solved("cube-pull", f'solve.assembly="{assembly}"')
    reactions = {round(step["load"], 6): step["reaction"]["right"][0] for step in summary["steps"]}
    assert summary["status"] == "converged"
    for load, expected in {0.1: 0.09955498, 0.5: 0.40059956, 1.0: 0.67679296}.items():
        assert abs(reactions[load] - expected) < 1e-7 * expected + 5e-9


def test_ranks_agree(solved: Callable[..., Any]) -> None:
    runs = [solved("cube-pull", "solve.tolerance=1e-11", ranks=ranks) for ranks in (1, 2, 3)]
    assert [run["ranks"] for run in runs] == [1, 2, 3]
    for other in runs[1:]:
        for one, two in zip(runs[0]["steps"], other["steps"], strict=True):
            assert one["energy"] == pytest.approx(two["energy"], rel=1e-10)
            assert one["reaction"]["right"][0] == pytest.approx(two["reaction"]["right"][0], rel=1e-10)
            assert one["min_J"] == pytest.approx(two["min_J"], rel=1e-8)


# ---------------------------------------------------------------------- homogeneous deformation


@pytest.mark.parametrize("name", [name for name, material in CATALOGUE.items() if material.objective])
def test_bar_under_uniaxial_stress(name: str) -> None:
    material: Tables = {"name": name}
    if len(CATALOGUE[name].pair) < 2:
        material["volume"] = "neo-hookean-ogden"
    stretch = 1.3
    bar = scene(material, {**BAR, "right": {"pull": [1.0, 0.0, 0.0]}}, mesh={"cells": 1}, solve={"tolerance": 1e-11})
    stress, lateral = respond(made(bar).parts[0].energy, "uniaxial", [stretch])
    pulled = scene(
        material,
        {**BAR, "right": {"pull": [float(stress[0]), 0.0, 0.0]}},
        mesh={"cells": 1},
        solve={"tolerance": 1e-11},
    )
    problem = solved_run(pulled).body
    assert mean(problem, "right")[0] == pytest.approx(stretch - 1, rel=1e-8)
    assert mean(problem, "back")[1] == pytest.approx(lateral[0] - 1, rel=1e-8)


def test_nominal_stress_under_prescribed_stretch() -> None:
    """Confined tension: no lateral motion, so that the reaction is p1(stretch, 1, 1)."""
    sides = {face: {"roller": ["y", "z"]} for face in ("front", "back", "bottom", "top")}
    boundary = {"left": {"fix": True}, "right": {"move": [0.7, 0.0, 0.0]}, **sides}
    problem = solved_run(scene({"name": "neo-hookean"}, boundary)).body
    lam, mu = lame_pair(2.0, 0.3)
    stress = mu * (1.7 - 1 / 1.7) + lam * np.log(1.7) / 1.7
    assert Measures(problem).reactions()["right"][0] == pytest.approx(stress, rel=1e-9)
    assert Measures(problem).volume_ratio() == pytest.approx(1.7, rel=1e-12)
    assert Measures(problem).min_J() == pytest.approx(1.7, rel=1e-12)


def test_body_force_stretches_a_hanging_bar() -> None:
    """Small strain with nu = 0: the end moves by b L^2 / (2 E)."""
    force = 1e-6
    problem = solved_run(
        scene({"name": "st-venant-kirchhoff", "nu": 0.0}, {"left": {"fix": True}}, body={"force": [force, 0.0, 0.0]})
    ).body
    assert mean(problem, "right")[0] == pytest.approx(force / (2 * 2.0), rel=1e-5)
    assert Measures(problem).reactions()["left"][0] == pytest.approx(-force, rel=1e-9)


def test_follower_pressure_is_force_per_deformed_area() -> None:
    pressure = 0.4
    boundary = {**BAR, "right": {"pressure": pressure}}
    problem = solved_run(scene({"name": "neo-hookean"}, boundary, solve={"tolerance": 1e-11})).body
    axial, lateral = 1 + mean(problem, "right")[0], 1 + mean(problem, "back")[1]
    stress, width = respond(problem.parts[0].energy, "uniaxial", [axial])
    assert width[0] == pytest.approx(lateral, rel=1e-8)
    assert stress[0] == pytest.approx(-pressure * lateral**2, rel=1e-8)


def test_follower_pressure_converges_quadratically() -> None:
    """Its part of the tangent is a second form in the same matrix; without it 60 steps are not enough."""
    boundary = {"left": {"fix": True}, "right": {"pressure": 0.4}, "top": {"pressure": 0.2}}
    pressed = scene({"name": "neo-hookean"}, boundary, mesh={"cells": 3}, solve={"tolerance": 1e-11})
    assert newton_steps(solved_run(pressed)) <= 6


@pytest.mark.parametrize("angle", [30.0, 180.0, 250.0])
def test_turning_both_ends_is_a_rigid_motion(angle: float) -> None:
    turn = {"axis": [1.0, 2.0, -0.5], "center": [0.3, 0.1, 0.7], "angle": angle}
    boundary = {"left": {"rotate": turn}, "right": {"rotate": turn}}
    run = solved_run(scene({"name": "stable-neo-hookean"}, boundary, solve={"steps": 6}))
    problem = run.body
    assert abs(run.summary.steps[-1].energy) < 1e-13
    assert Measures(problem).volume_ratio() == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("name", ["stable-neo-hookean", "linear-corotational"])
def test_plane_strain_is_a_slab_between_rollers(name: str) -> None:
    """A slab of one layer of cells between two walls deforms as its plane section does."""
    material = {"name": name}
    boundary = {"left": {"fix": True}, "right": {"move": [0.3, 0.2]}}
    flat = scene(material, boundary, mesh={"shape": "square", "cells": 3, "cell": "quadrilateral"})
    section = solved_run(flat).body
    walls = {"front": {"roller": ["y"]}, "back": {"roller": ["y"]}}
    slab = solved_run(
        scene(
            material,
            {"left": {"fix": True}, "right": {"move": [0.3, 0.0, 0.2]}, **walls},
            mesh={"shape": "box", "size": [1.0, 0.1, 1.0], "cells": [3, 1, 3]},
        )
    ).body
    flat_reaction = Measures(section).reactions()["right"]
    slab_reaction = Measures(slab).reactions()["right"]
    assert slab_reaction[0] / 0.1 == pytest.approx(flat_reaction[0], rel=1e-8)
    assert slab_reaction[2] / 0.1 == pytest.approx(flat_reaction[1], rel=1e-8)


# ---------------------------------------------------------------------- calibration and nonlinearity in a body


def _stiffness(material: Tables) -> np.ndarray:
    boundary = {"left": {"fix": True}, "right": {"move": [1.0, 0.0, 0.0]}}
    return free_stiffness(made(scene(material, boundary, mesh={"cells": 3})))


def test_calibrated_materials_share_their_stiffness_at_rest() -> None:
    """What Chen & Barbič, Fig. 1, normalises; and what goes wrong without it."""
    reference = _stiffness({"name": "linear-corotational", "nu": 0.2})
    calibrated = _stiffness({"name": "stable-neo-hookean", "nu": 0.2})
    assert np.abs(calibrated - reference).max() < 1e-10 * np.abs(reference).max()
    lam, mu = lame_pair(2.0, 0.2)
    naive = _stiffness({"name": "stable-neo-hookean", "E": None, "nu": None, "parameters": {"lam": lam, "mu": mu}})
    assert np.abs(naive - reference).max() > 0.1 * np.abs(reference).max()
    # The naive material is that of E' = 0.625 E and nu' = -0.25.
    mistaken = _stiffness({"name": "linear-corotational", "E": 0.625 * 2.0, "nu": -0.25})
    assert np.abs(naive - mistaken).max() < 1e-10 * np.abs(reference).max()


ALPHAS = (0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0)


def _pull(alpha: float, distance: float, steps: int) -> list[float]:
    boundary = {"left": {"fix": True}, "right": {"move": [distance, 0.0, 0.0]}}
    material = {"name": "stable-neo-hookean", "alpha": alpha, "E": 1.0}
    run = solved_run(scene(material, boundary, mesh={"cells": 4}, solve={"steps": steps, "tolerance": 1e-10}))
    return [record.reaction["right"][0] for record in run.summary.steps]


def test_alpha_curves_share_their_slope_and_are_ordered() -> None:
    """Chen & Barbič, Fig. 3: seven exponents, one slope at rest, stiffer with alpha under large stretch."""
    slopes = np.array([_pull(alpha, 1e-7, 1)[0] / 1e-7 for alpha in ALPHAS])
    assert np.abs(slopes / slopes[2] - 1).max() < 1e-6
    curves = np.array([_pull(alpha, 1.0, 5) for alpha in ALPHAS])
    assert (np.diff(curves, axis=0) > 0).all()


# ---------------------------------------------------------------------- the load path


def test_steps_are_cut_back_where_the_energy_is_undefined() -> None:
    """One step to a tenth of the height inverts cells of the prediction; the path goes on with smaller ones."""
    boundary = {"bottom": {"roller": ["z"]}, "top": {"move": [0.0, 0.0, -0.85]}}
    cut: list[float] = []
    given = scene({"name": "neo-hookean", "nu": 0.2}, boundary, mesh={"cells": 4})
    reached = list(follow(made(given), options(given), report=lambda load, newton: cut.append(load)))
    assert [step.load for step in reached] == [1.0]
    assert len(cut) > 1 and cut[0] < 1.0


@pytest.mark.parametrize("assembly", ["ufl", "spectral"])
@pytest.mark.parametrize("name", [name for name, entry in CATALOGUE.items() if not entry.inverts])
def test_mirrored_bodies_have_no_energy(name: str, assembly: str) -> None:
    """Even where the formula has one: of a symmetric energy, the mirrored body's is zero."""
    volume = {} if len(CATALOGUE[name].pair) > 1 else {"volume": "stable-neo-hookean"}
    boundary = {"left": {"fix": True}, "right": {"move": [0.1, 0.0, 0.0]}}
    solve = {"assembly": assembly, "element": "Q1"}
    problem = made(scene({"name": name, **volume}, boundary, solve=solve, mesh={"cells": 1}))
    mirrored = np.zeros((8, 3))
    mirrored[:, 0] = -2 * problem.V.tabulate_dof_coordinates()[:, 0]
    assert np.isnan(problem.assembly.energy(State(mirrored.ravel())))
    assert np.isfinite(problem.assembly.energy(State(0.01 * mirrored.ravel())))


def test_failure_is_told_and_keeps_what_was_reached(
    elastune: Callable[..., Any], solved: Callable[..., Any], tmp_path: Path
) -> None:
    (tmp_path / "crush.toml").write_text(
        """[mesh]
cells = 2
[solve]
steps = 4
smallest_step = 0.5
[material]
name = "neo-hookean"
E = 1.0
nu = 0.3
[boundary.left]
fix = true
[boundary.right]
move = [-1.3, 0.0, 0.0]
"""
    )
    summary = solved("crush.toml")
    assert summary["status"] == "failed"
    assert set(summary["failure"]) >= {"kind", "message", "load"}
    assert 0 < len(summary["steps"]) < 4
    assert summary["failure"]["load"] > summary["steps"][-1]["load"]
    assert elastune("run", "crush.toml", "--set", "output.picture=false").returncode == 3
    boundary = {"left": {"fix": True}, "right": {"move": [-1.3, 0.0, 0.0]}}
    failed = ended(scene({"name": "neo-hookean"}, boundary, solve={"smallest_step": 0.5}))
    assert failed.summary.status == "failed"


def test_linear_solvers_agree(solved: Callable[..., Any]) -> None:
    runs = [
        solved("cube-twist", "mesh.cells=5", f'solve.linear="{linear}"', "solve.tolerance=1e-10")
        for linear in ("direct", "iterative")
    ]
    energies = [run["steps"][-1]["energy"] for run in runs]
    assert energies[0] == pytest.approx(energies[1], rel=1e-9)
    assert runs[1]["steps"][-1]["linear_iterations"] > runs[0]["steps"][-1]["linear_iterations"]
