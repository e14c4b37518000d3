"""Branches of equilibria: states that lose their stability, limit loads, and what is on the way."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import ended, nodal, solved
from mpi4py import MPI
from scipy.integrate import quad
from scipy.optimize import brentq, fsolve, minimize_scalar

from elastune.app.errors import UserError
from elastune.app.run import Run, start
from elastune.app.scene.read import parse

MU, LAM = 0.38461538461538464, 0.8333333333333334
PRESSED: dict[str, Any] = {
    "mesh": {"shape": "box", "size": [2.0, 1.0, 1.0], "cells": [2, 1, 1]},
    "material": {"name": "neo-hookean-ogden", "parameters": {"mu": MU, "lam": LAM}},
    "boundary": {
        "left": {"roller": ["x"]},
        "front": {"roller": ["y"]},
        "bottom": {"roller": ["z"]},
        "right": {"pull": [-5.0, 0.0, 0.0]},
    },
}
# An eighth of an incompressible ball with a hole, under pressure from within.
BALL: dict[str, Any] = {
    "material": {"name": "neo-hookean", "E": 3.0, "nu": 0.5},
    "boundary": {"x0": {"roller": ["x"]}, "y0": {"roller": ["y"]}, "z0": {"roller": ["z"]}, "inner": {"pressure": 1.0}},
    "output": {"points": {"a": [1.0, 0.0, 0.0]}},
}


def scene(tables: dict[str, Any], **solve: Any) -> Any:
    return parse({**tables, "solve": {**tables.get("solve", {}), **solve}}, Path("branch.toml"))


def kinds(run: Run) -> list[str]:
    return [event.kind for event in run.summary.events]


# ---------------------------------------------------------------------- a block that is pressed flat


def homogeneous(traction: float) -> np.ndarray:
    """Stretches along and across, on the branch that begins at rest."""

    def out_of_balance(s: np.ndarray, t: float) -> list[float]:
        a, b = s
        across = MU * (b - 1 / b) + LAM * a * b * (a * b**2 - 1)
        return [across, MU * (a - 1 / a) + LAM * b**2 * (a * b**2 - 1) - t]

    stretches = np.ones(2)
    for t in np.linspace(0, traction, 200):
        stretches = fsolve(out_of_balance, stretches, (t,))
    return stretches


@pytest.mark.parametrize("follow", ["path", "arc"])
def test_the_branch_from_rest_is_kept(follow: str) -> None:
    a, b = homogeneous(-5.0)
    assert (a, b) == pytest.approx((0.0929915, 1.1034206), abs=1e-6)
    run = solved(scene(PRESSED, follow=follow))
    assert nodal(run.body).min(axis=0)[0] == pytest.approx(2 * (a - 1), rel=1e-7)
    assert nodal(run.body).max(axis=0)[1:] == pytest.approx([b - 1] * 2, rel=1e-6)
    assert kinds(run) == ["buckled"] and 0.06 < run.summary.events[0].load < 0.12
    stable = [record.stable for record in run.summary.steps]
    assert stable[-1] is False and stable == sorted(stable, reverse=True)


def test_a_body_that_leaves_it_is_told() -> None:
    run = solved(scene(PRESSED, steps=20))
    assert nodal(run.body).min() < -3
    assert kinds(run)[0] in ("buckled", "snapped") and 0.07 < run.summary.events[0].load < 0.08
    assert all(record.stable for record in run.summary.steps)
    quiet = solved(scene(PRESSED | {"boundary": PRESSED["boundary"] | {"right": {"pull": [-0.3, 0, 0]}}}))
    assert quiet.summary.events == [] and all(record.stable for record in quiet.summary.steps)


@pytest.mark.parametrize("solve", [{"assembly": "ufl"}, {"linear": "iterative"}], ids=["ufl", "multigrid"])
def test_it_is_told_by_any_assembly_and_solver(solve: dict[str, Any]) -> None:
    """Where nobody knows a way off, the state is not called one of least energy."""
    run = solved(scene(PRESSED, steps=20, **solve))
    assert "buckled" in kinds(run) and run.summary.events[0].load <= 0.1
    left = nodal(run.body).min() < -3
    assert left or not any(record.stable for record in run.summary.steps[1:])


# ---------------------------------------------------------------------- columns


def column(size: list[float], cells: list[int], load: float) -> dict[str, Any]:
    return {
        "mesh": {"shape": "box", "size": size, "cells": cells},
        "material": {"name": "st-venant-kirchhoff", "E": 1.0, "nu": 0.0},
        "boundary": {"bottom": {"fix": True}, "top": {"pull": [0, 0, -load]}},
        "output": {"points": {"tip": [size[0] / 2, size[1] / 2, size[2]]}},
    }


def test_square_columns_buckle_as_others_do() -> None:
    """1.518 of Euler's load: the elastica's tip is 0.7915 of the length aside, and 0.3493 high."""
    square = column([1.0, 1.0, 20.0], [1, 1, 12], 7.803e-4)
    run, other = solved(scene(square)), solved(scene(column([2.0, 1.0, 20.0], [2, 1, 12], 7.803e-4)))
    for each, axis in ((run, 0), (other, 1)):
        tip = np.abs(each.history["displacement_tip"][-1]) / 20
        assert tip[axis] == pytest.approx(0.7915, abs=0.005) and 1 - tip[2] == pytest.approx(0.3493, abs=0.02)
        assert tip[1 - axis] < 1e-3
        euler = math.pi**2 / 12 / (4 * 20**2) / 7.803e-4
        assert kinds(each) == ["buckled"] and each.summary.events[0].load == pytest.approx(euler, rel=0.01)
    spent, usual = (sum(record.newton_iterations for record in each.summary.steps) for each in (run, other))
    assert spent <= 5 * usual
    assert run.history["displacement_tip"][-1, 0] > 0


@pytest.mark.parallel
def test_columns_buckle_to_the_same_side_on_all_ranks() -> None:
    given = scene(column([1.0, 1.0, 20.0], [1, 1, 8], 6.5e-4), steps=2)
    alone, together = (start(given, comm).finish() for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert kinds(together) == kinds(alone) == ["buckled"]
    assert together.summary.steps[-1].energy == pytest.approx(alone.summary.steps[-1].energy, rel=1e-6)

    def aside(run: Run) -> float:
        return run.body.comm.allreduce(float(nodal(run.body)[:, 0].max(initial=0.0)), op=MPI.MAX)

    assert aside(alone) > 1 and aside(together) == pytest.approx(aside(alone), rel=1e-3)


# ---------------------------------------------------------------------- a thick ball under pressure


def ball(path: Path, h: float) -> str:
    """An eighth of a ball of radius 2 with a hole of radius 1, in curved tetrahedra."""
    import gmsh

    quarter = {"angle1": 0, "angle2": math.pi / 2, "angle3": math.pi / 2}
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    outer, inner = (gmsh.model.occ.addSphere(0, 0, 0, radius, **quarter) for radius in (2, 1))
    gmsh.model.occ.cut([(3, outer)], [(3, inner)])
    gmsh.model.occ.synchronize()
    for _, tag in gmsh.model.getEntities(2):
        centre = np.array(gmsh.model.occ.getCenterOfMass(2, tag))
        plane = [f"{axis}0" for axis, at in zip("xyz", centre, strict=True) if abs(at) < 1e-6]
        gmsh.model.addPhysicalGroup(
            2, [tag], name=plane[0] if plane else "inner" if np.linalg.norm(centre) < 1.2 else "outer"
        )
    gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)], name="ball")
    gmsh.option.setNumber("Mesh.MeshSizeMax", h)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(2)
    gmsh.write(str(path))
    gmsh.finalize()
    return str(path)


def inflation(stretch: float) -> float:
    """The pressure at which the hole is so much larger: an incompressible neo-Hookean ball of μ = 1 (Green & Zerna)."""
    outer = (1 + (stretch**3 - 1) / 8) ** (1 / 3)
    return quad(lambda s: 2 * (s - s**-5) / (s**3 - 1), outer, stretch, epsabs=1e-13)[0]


LARGEST = -minimize_scalar(lambda s: -inflation(s), bounds=(1.1, 4), method="bounded", options={"xatol": 1e-10}).fun


@pytest.fixture(scope="module")
def inflated(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return BALL | {"mesh": {"shape": "file", "path": ball(tmp_path_factory.mktemp("ball") / "ball.msh", 0.5)}}


def test_a_ball_has_a_limit_load(inflated: dict[str, Any]) -> None:
    run = ended(scene(inflated, element="P2-P1", steps=5))
    failure = run.summary.failure
    assert failure is not None and failure.kind == "limit" and failure.message.startswith("limit load 0.81")
    assert failure.load == pytest.approx(LARGEST, rel=2e-3) and failure.diagnosis["advice"][0].startswith(
        "set solve.follow"
    )
    assert run.summary.events[-1].kind == "limit" and run.summary.steps[-1].load == failure.load
    assert sum(record.newton_iterations for record in run.summary.steps) <= 150


def test_a_limit_is_told_once(inflated: dict[str, Any]) -> None:
    run = ended(scene(inflated, element="P2-P1", steps=5, follow="path"))
    assert run.summary.failure is not None and run.summary.failure.kind == "limit" and kinds(run) == ["limit"]


def test_a_ball_beyond_its_limit_load(inflated: dict[str, Any]) -> None:
    run = solved(scene(inflated, element="P2-P1", steps=5, follow="arc", arc_steps=16))
    loads, moved = run.history["load"], run.history["displacement_a"][:, 0]
    assert moved[-1] > 1.5 and loads.argmax() < len(loads) - 2
    for load, u in zip(loads, moved, strict=True):
        assert load == pytest.approx(inflation(1 + u), rel=1e-3 if 0.4 < u < 2 else 5e-3)
    (limit,) = run.summary.events
    assert limit.kind == "limit" and limit.load == pytest.approx(LARGEST, rel=1e-3)
    assert brentq(lambda s: inflation(s) - loads[-1], 2, 5) == pytest.approx(1 + moved[-1], rel=5e-3)


# ---------------------------------------------------------------------- what cannot be


@pytest.mark.parametrize(
    ("solve", "tables", "said"),
    [
        ({"follow": "arc", "linear": "iterative"}, {}, 'expected solve.linear = "auto" or "direct"'),
        ({"follow": "path"}, {"start": {"shape": "point"}}, "expected no start"),
        (
            {"follow": "arc"},
            {"stage": [{}, {"boundary": {"right": {"pull": [0, 0, 0.1]}}}]},
            "expected one stage, got 2",
        ),
    ],
)
def test_what_no_branch_can_be_followed_of(solve: dict[str, Any], tables: dict[str, Any], said: str) -> None:
    given = {**PRESSED, "material": {"name": "stable-neo-hookean", "E": 1.0, "nu": 0.3}, **tables}
    with pytest.raises(UserError, match=said):
        start(scene(given, **solve), MPI.COMM_SELF)


# ---------------------------------------------------------------------- Lee's frame


def frame(path: Path) -> str:
    """Two legs of length 120 and height 2 at a right angle, in quadrilaterals with nodes on their middle lines."""
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    parts = [(-1, 0, 2, 119), (-1, 119, 2, 2), (1, 119, 23, 2), (24, 119, 96, 2)]
    first, *others = [(2, gmsh.model.occ.addRectangle(x, y, 0, w, h)) for x, y, w, h in parts]
    gmsh.model.occ.fragment([first], others)
    gmsh.model.occ.synchronize()
    for _, curve in gmsh.model.getEntities(1):
        cells = max(2, round(gmsh.model.occ.getMass(1, curve) / 6))
        gmsh.model.mesh.setTransfiniteCurve(curve, cells + 1)
    for _, surface in gmsh.model.getEntities(2):
        gmsh.model.mesh.setTransfiniteSurface(surface)
        gmsh.model.mesh.setRecombine(2, surface)
    gmsh.model.addPhysicalGroup(2, [tag for _, tag in gmsh.model.getEntities(2)], name="frame")
    gmsh.model.mesh.generate(2)
    gmsh.write(str(path))
    gmsh.finalize()
    return str(path)


def test_a_frame_snaps_through_and_back(tmp_path: Path) -> None:
    """Lee, Manuel & Rossow 1968: with E = 720 and a width of 3, limit loads of about 1.85 and -0.945."""
    tables = {
        "mesh": {"shape": "file", "path": frame(tmp_path / "frame.msh")},
        "material": {"name": "st-venant-kirchhoff", "E": 720.0, "nu": 0.0},
        "point": {
            "foot": {"at": [0.0, 0.0], "fix": True},
            "end": {"at": [120.0, 120.0], "fix": True},
            "middle": {"at": [24.0, 120.0], "force": [0.0, -1.0]},
        },
        "output": {"points": {"tip": [24.0, 120.0]}},
    }
    run = solved(scene(tables, element="Q2", follow="arc", arc_steps=80))
    first, second = [event.load for event in run.summary.events if event.kind == "limit"]
    assert 3 * first == pytest.approx(1.85, rel=0.02) and 3 * second == pytest.approx(-0.945, rel=0.02)
    sunk = -run.history["displacement_tip"][:, 1]
    # Back on the way, which neither load nor displacement alone could be made to follow.
    assert np.any(np.diff(sunk) < 0) and sunk.max() > 50
    stable = [record.stable for record in run.summary.steps]
    assert stable[0] and not stable[30]
