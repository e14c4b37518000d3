"""What happens to a body: by place and component, several at once, stage by stage, in balance."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import gmsh
import numpy as np
import pytest
from bodies import made, nodal, shipped, solved
from mpi4py import MPI

from elastune.app.errors import UserError
from elastune.app.results.measures import Measures
from elastune.app.run import start
from elastune.app.scene.read import parse
from elastune.app.scene.schema import Scene
from elastune.forms.expressions import Expression, ExpressionError

NEO_HOOKEAN = {"name": "neo-hookean", "E": 1.0, "nu": 0.3}
CORNER = {"left": {"roller": ["x"]}, "front": {"roller": ["y"]}, "bottom": {"roller": ["z"]}}


def scene(boundary: dict[str, Any], **tables: Any) -> Scene:
    data = {"mesh": {"cells": 2}, "solve": {"steps": 1}, "material": NEO_HOOKEAN, "boundary": boundary} | tables
    return parse(data, Path("case.toml"))


def layer(path: Path, joined: bool = True) -> str:
    """Two unit cubes, one on the other, with the faces foot, middle and head."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    occ = gmsh.model.occ
    boxes = [(3, occ.addBox(0, 0, z, 1, 1, 1)) for z in (0, 1)]
    if joined:
        occ.fragment(boxes[:1], boxes[1:])
    occ.synchronize()
    for _, tag in gmsh.model.getEntities(2):
        x, y, z = occ.getCenterOfMass(2, tag)
        if abs(x - 0.5) < 1e-6 and abs(y - 0.5) < 1e-6 and (joined or round(z) != 1):
            gmsh.model.addPhysicalGroup(2, [tag], name=["foot", "middle", "head"][round(z)])
    gmsh.model.addPhysicalGroup(3, [1, 2], name="body")
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.4)
    gmsh.model.mesh.generate(3)
    gmsh.write(str(path))
    gmsh.finalize()
    return str(path)


# ---------------------------------------------------------------- right values


def test_component_alone() -> None:
    """A bar at ν = 0.5 pulled to twice its length by u_x alone: P = μ (λ - λ⁻²), 1/√2 across."""
    material = {"name": "neo-hookean", "E": 3.0, "nu": 0.5}
    run = solved(scene({**CORNER, "right": {"move": {"x": 1.0}}}, material=material))
    assert run.summary.steps[-1].reaction["right"] == pytest.approx([1.75, 0.0, 0.0], abs=1e-8)
    assert nodal(run.body).min() == pytest.approx(2**-0.5 - 1, abs=1e-8)


def test_load_on_an_inner_face(tmp_path: Path) -> None:
    """Statics: nothing is lost; the volume is that of an independent script with both sides' mean."""
    mesh = {"shape": "file", "path": layer(tmp_path / "layer.msh")}
    run = solved(scene({"foot": {"fix": True}, "middle": {"pull": [0, 0, 0.2]}}, mesh=mesh))
    (record,) = run.summary.steps
    assert record.reaction["foot"] == pytest.approx([0.0, 0.0, -0.2], abs=1e-9)
    assert record.volume_ratio == pytest.approx(1.04795, abs=2e-4)
    for load, word in ({"pressure": 0.2}, "pressure"), ({"pull": {"normal": 0.2}}, "pull.normal"):
        with pytest.raises(UserError, match=f"middle.{word}.*both sides"):
            made(scene({"foot": {"fix": True}, "middle": load}, mesh=mesh))


def test_reaction_of_a_roller() -> None:
    """The clamp's share is that of an independent script."""
    boundary = {"left": {"fix": True}, "bottom": {"roller": ["z"]}, "right": {"pull": [0.2, 0, 0]}}
    reaction = solved(scene(boundary, mesh={"cells": 4}, solve={"steps": 1})).summary.steps[-1].reaction
    assert reaction["bottom"][:2] == [0.0, 0.0]
    assert reaction["left"][2] == pytest.approx(0.0253433, abs=1e-6)
    assert np.add(reaction["left"], reaction["bottom"]) == pytest.approx([-0.2, 0.0, 0.0], abs=1e-10)


# Conditions that hold, loads of each kind, and elements and shapes to try them on.
HOLDING: list[dict[str, Any]] = [
    {"left": {"fix": True}, "bottom": {"roller": ["z"]}},
    {"left": {"roller": ["x"]}, "bottom": {"fix": True}, "front": {"move": {"y": 0.0}}},
    {
        "left": {"fix": True},
        "right": {"spring": {"stiffness": 0.3}},
        "bottom": {"spring": {"stiffness": [0.1, 0, 0.2]}},
    },
    {"left": {"move": [0.0, 0.02, 0.0]}, "back": {"roller": ["x", "z"]}, "bottom": {"roller": ["z"]}},
]
LOADS: list[dict[str, Any]] = [
    {"boundary": {"top": {"pull": [0.02, "0.03*sin(pi*x)", "0.01*y^2"]}}},
    {"boundary": {"top": {"pull": {"normal": "0.02 + 0.01*x"}}}},
    {"boundary": {"top": {"moment": {"axis": [0, 1, 1], "center": [0.4, 0.5, 1], "value": 0.01}}}},
    {"boundary": {"top": {"force": [0.01, 0.0, 0.02]}}, "point": {"tip": {"at": [1, 1, 1], "force": [0.0, 0.01, 0.0]}}},
    {"boundary": {"top": {"pressure": 0.03}}, "body": {"force": ["0.01*z", 0.0, -0.02]}},
]


@pytest.mark.parametrize("element", ["Q1", "P2", "Q2-P1d"])
@pytest.mark.parametrize("load", range(len(LOADS)))
@pytest.mark.parametrize("holding", range(len(HOLDING)))
def test_reactions_balance_the_loads(holding: int, load: int, element: str) -> None:
    """Forces, and moments about the origin as the body lies."""
    given = LOADS[load]
    boundary = {**HOLDING[holding], **given["boundary"]}
    more = {key: table for key, table in given.items() if key != "boundary"}
    solve = {"steps": 1, "element": element, "tolerance": 1e-13}
    run = solved(scene(boundary, solve=solve, **more))
    body = run.body
    loads = [term for term in body.terms if term.factor is not None]
    forces = -sum(body.assembly.forces(body.state)[1:]) + sum(  # the springs are no loads
        body.layout.nodal(body.assembly.of(term, body.state)).ravel() for _, term in body.foundations
    )
    assert loads
    places = body.points + np.pad(nodal(body), ((0, 0), (0, 0)))
    acting = body.layout.nodal(forces)
    record = run.summary.steps[-1]
    size = np.abs(acting).sum()
    assert np.sum(list(record.reaction.values()), axis=0) == pytest.approx(
        -acting.sum(axis=0), abs=1e-10 * size + 1e-13
    )
    turning = np.cross(places, acting).sum(axis=0)
    centroids = Measures(body)._centroids
    reacting = sum(
        np.array(record.moment[name]) + np.cross(centroids[name], force) for name, force in record.reaction.items()
    )
    assert reacting == pytest.approx(-turning, abs=1e-9 * size)


def test_moment_turns_with_its_torque() -> None:
    boundary = {
        "left": {"fix": True},
        "right": {"moment": {"axis": [2, 0, 0], "center": [0, 0.3, 0.5], "value": 0.003}},
    }
    record = solved(scene(boundary)).summary.steps[-1]
    assert record.reaction["left"] == pytest.approx([0, 0, 0], abs=1e-12)
    assert record.moment["left"][0] == pytest.approx(-0.003, rel=1e-2)


def test_point_and_spring() -> None:
    """A stiff block on a foundation rises by the force over its stiffness."""
    boundary = {"left": {"roller": ["x"]}, "front": {"roller": ["y"]}, "bottom": {"spring": {"stiffness": 2.0}}}
    stiff = {"name": "neo-hookean", "E": 1e6, "nu": 0.0}
    record = solved(scene({**boundary, "top": {"force": [0, 0, 0.5]}}, material=stiff)).summary.steps[-1]
    assert record.max_displacement == pytest.approx(0.25, rel=1e-5)
    assert record.reaction["bottom"] == pytest.approx([0, 0, -0.5], abs=1e-9)


def test_points_hold() -> None:
    """Three corners, statically determinate, under a pressure all round: nothing is left for them to carry."""
    point = {
        "a": {"at": [0, 0, 0], "fix": True},
        "b": {"at": [1, 0, 0], "roller": ["y", "z"]},
        "c": {"at": [0, 1, 0], "roller": ["z"]},
    }
    faces = {face: {"pressure": 0.1} for face in ("left", "right", "front", "back", "bottom", "top")}
    held = solved(scene(faces, point=point)).summary.steps[-1]
    assert np.abs(list(held.reaction.values())).max() < 1e-10
    free = solved(scene(faces, solve={"steps": 1, "free": True})).summary.steps[-1]
    assert (free.energy, free.volume_ratio) == pytest.approx((held.energy, held.volume_ratio), rel=1e-10)
    assert free.reaction == {}


def test_stages() -> None:
    """Loads go from value to value, and what is released is at rest; names and numbers count on."""
    stages = [
        {"name": "preload"},
        {"name": "shear", "steps": 3, "boundary": {"right": {"pull": ["0.1*y", 0.1, 0]}}},
        {"name": "release", "boundary": {"right": {"pull": [0, 0, 0]}, "top": {"pressure": 0.0}}},
    ]
    boundary = {"left": {"fix": True}, "right": {"pull": [0.1, 0, 0]}, "top": {"pressure": 0.05}}
    run = solved(scene(boundary, stage=stages, solve={"steps": 2}))
    steps = run.summary.steps
    assert [(s.name, round(s.load, 6)) for s in steps[:3]] == [("preload", 0.5), ("preload", 1.0), ("shear", 1.333333)]
    assert [s.load for s in steps[-2:]] == [2.5, 3.0] and len(steps) == 7
    single = solved(scene(boundary, solve={"steps": 2})).summary.steps[-1]
    assert steps[1].energy == pytest.approx(single.energy, rel=1e-9)
    sheared = {**boundary, "right": {"pull": ["0.1*y", 0.1, 0]}}
    assert steps[4].energy == pytest.approx(
        solved(scene(sheared, solve={"steps": 2})).summary.steps[-1].energy, rel=1e-7
    )
    assert steps[-1].max_displacement < 1e-10


# ---------------------------------------------------------------- refused


REFUSED: dict[str, tuple[dict[str, Any], list[str]]] = {
    "drifts": (
        {"boundary": {"left": {"roller": ["x"]}, "right": {"pull": [0.2, 0, 0]}}},
        ["slide along y and z and to turn about x", "3 rigid motions"],
    ),
    "turns": (
        {"boundary": {**CORNER, "bottom": {"spring": {"stiffness": [0, 1, 0]}}, "top": {"pressure": 1.0}}},
        ["z"],
    ),
    "pushed though free": (
        {"boundary": {"left": {"roller": ["x"]}, "top": {"pull": [0, 1.0, 0]}}, "solve": {"free": True}},
        ["solve.free", "slide along y"],
    ),
    "held twice": ({"boundary": {"left": {"fix": True, "roller": ["x"]}}}, ["boundary.left", "fix", "roller"]),
    "held and loaded": ({"boundary": {"left": {"roller": ["x"], "pull": [1, 0, 0]}}}, ["x is held by roller"]),
    "clash on an edge": (
        {"boundary": {"bottom": {"fix": True}, "right": {"move": [0.5, 0, 0]}}},
        ["boundary.bottom and boundary.right", "along x"],
    ),
    "no expression": ({"boundary": {"left": {"fix": True}, "right": {"pull": ["x +", 0, 0]}}}, ["right.pull", "x +"]),
    "a program": (
        {"boundary": {"left": {"fix": True}, "right": {"pull": ["__import__('os')", 0, 0]}}},
        ["right.pull", "__import__"],
    ),
    "no number": ({"boundary": {"left": {"fix": True}, "right": {"move": ["log(x-2)", 0, 0]}}}, ["right", "no number"]),
    "no node": (
        {"boundary": {"left": {"fix": True}}, "point": {"tip": {"at": [0.3, 0, 0], "force": [1, 0, 0]}}},
        ["point.tip", "no node", "nearest"],
    ),
    "axis without a direction": (
        {
            "boundary": {
                "left": {"fix": True},
                "right": {"moment": {"axis": [0, 0, 0], "center": [0, 0, 0], "value": 1}},
            }
        },
        ["moment.axis"],
    ),
    "stage holds more": (
        {
            "boundary": {"left": {"fix": True}, "right": {"pull": [0.1, 0, 0]}},
            "stage": [{}, {"boundary": {"top": {"move": [0, 0, 0.1]}}}],
        },
        ["stage 2", "boundary.top", "first stage"],
    ),
    "name twice": (
        {
            "boundary": {"left": {"fix": True}, "top": {"pressure": 1}},
            "point": {"left": {"at": [1, 1, 1], "fix": True}},
        },
        ["point.left", "boundary.left"],
    ),
    "unknown key of a point": ({"point": {"tip": {"at": [0, 0, 0], "pull": [1, 0, 0]}}}, ["point.tip.pull"]),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_told_in_a_line(case: str) -> None:
    tables, words = REFUSED[case]
    boundary = {"left": {"fix": True}, "right": {"pull": [0.1, 0, 0]}}
    with pytest.raises(UserError) as caught:
        made(scene(**{"boundary": boundary} | tables))
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


def test_pieces_are_told(tmp_path: Path) -> None:
    mesh = {"shape": "file", "path": layer(tmp_path / "loose.msh", joined=False)}
    for load in ({"pull": [0, 0, 0.2]}, {"pressure": -0.2}):
        with pytest.raises(
            UserError, match=r"2 pieces, and the one around \(0.49\d+, 0.49\d+, 1.50\d+\) is held by nothing"
        ):
            made(scene({"foot": {"fix": True}, "head": load}, mesh=mesh))


@pytest.mark.parametrize(
    "text", ["x.real", "x[0]", "lambda: 1", "1/0", "10**10**10", "a", "sin(x, y)", "x if y else z", "", "'x'"]
)
def test_expressions_refuse(text: str) -> None:
    with pytest.raises(ExpressionError):
        Expression(text)


def test_expressions_are_the_same_in_numpy_and_ufl() -> None:
    text = "2*sin(pi*x) + y^2/3 - abs(z) + min(x, y)*atan2(y, 1 + z) + log(1 + x^2) + e"
    X = np.array([[0.3, -0.2, 0.7]])
    x, y, z = X[0]
    expected = 2 * np.sin(np.pi * x) + y**2 / 3 - abs(z) + min(x, y) * np.arctan2(y, 1 + z) + np.log(1 + x**2) + np.e
    assert Expression(text).at(X)[0] == pytest.approx(expected, rel=1e-14)
    assert Expression(text).ufl(X[0])(()) == pytest.approx(expected, rel=1e-14)


def test_a_scene_that_goes_back_to_rest() -> None:
    """The shipped one of three stages: what is released is as it was."""
    run = shipped("inclusion", "mesh.cells=4", "solve.element=Q1")
    rows = run.summary.steps
    assert [(row.load, row.name) for row in rows] == [
        (0.5, "press"), (1.0, "press"), (1.5, "shear"), (2.0, "shear"), (2.5, "release"), (3.0, "release"),
    ]  # fmt: skip
    assert rows[3].energy > 1e-3 and abs(rows[5].energy) < 1e-20
    assert max(map(abs, rows[3].displacement["ball"])) > 0.1 and max(map(abs, rows[5].displacement["ball"])) < 1e-10
    assert run.summary.materials["ball"]["E"] == pytest.approx(100.0)


@pytest.mark.parallel
def test_places_on_all_ranks() -> None:
    """Points, springs, stages and supports are the same on any number of ranks."""
    faces = {face: {"pressure": 0.1} for face in ("left", "right", "front", "back", "bottom", "top")}
    point = {"tip": {"at": [1, 1, 1], "force": [0.0, 0.0, 0.01]}}
    stage = [{}, {"boundary": {"right": {"pull": ["0.2*y", 0, 0]}}}]
    loaded = {"left": {"fix": True}, "bottom": {"spring": {"stiffness": 0.1}}, "right": {"pull": [0.1, 0, 0]}}
    for given in (scene(faces, solve={"steps": 1, "free": True}), scene(loaded, point=point, stage=stage)):
        together, alone = (start(given, comm).finish().summary.steps[-1] for comm in (MPI.COMM_WORLD, MPI.COMM_SELF))
        assert together.energy == pytest.approx(alone.energy, rel=1e-9)
        for name, force in alone.reaction.items():
            assert together.reaction[name] == pytest.approx(force, abs=1e-9)
            assert together.moment[name] == pytest.approx(alone.moment[name], abs=1e-9)


def test_history_has_moments(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "elastune", "run", "cube-pull", "--out", str(tmp_path), "--set", "mesh.cells=2"]
    subprocess.run([*command, "--set", "output.picture=false"], check=True, capture_output=True)
    head = (tmp_path / "history.csv").read_text().splitlines()[0].split(",")
    assert {"moment_left_x", "moment_right_z"} <= set(head)
    (*_, last) = json.loads((tmp_path / "summary.json").read_text())["steps"]
    assert len(last["moment"]["left"]) == 3
