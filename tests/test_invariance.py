"""What a result must not depend on: units of length and stress, ranks, the order of what is said."""

from typing import Any

import numpy as np
import pytest
from bodies import made, nodal, shipped, solved

from elastune.app.body.noise import uniform
from elastune.app.path.blend import Blend
from elastune.app.path.predict import predict
from elastune.app.scene.build import options
from elastune.app.scene.read import load
from elastune.app.scene.schema import Scene
from elastune.app.solvers.globalise.balance import Balance
from elastune.app.solvers.minimizer import Minimizer

SMALL = ["mesh.cells=3", "solve.steps=2", "solve.tolerance=1e-9"]
SCENES: dict[str, list[str]] = {
    "cube-pull": SMALL,
    "cube-twist": SMALL,
    "squeeze": ["mesh.cells=4", "solve.steps=5"],
    "scramble": ["mesh.cells=3"],
    "cantilever": ["mesh.cells=[3,1,1]", "solve.steps=10"],
}
UNITS = [(1e-9, 1.0), (1e-3, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e3), (1.0, 1e12), (1e-6, 1e9)]


def scaled(given: Scene, length: float, modulus: float) -> Scene:
    """The same body in another unit of length, of another material in another unit of stress."""
    data = given.model_dump(exclude_unset=True)
    mesh, material = data.setdefault("mesh", {}), data["material"]
    size = mesh.get("size", 1.0)
    mesh["size"] = [length * x for x in size] if isinstance(size, list) else length * size
    material["E"] = modulus * material["E"]
    for condition in data.get("boundary", {}).values():
        if condition.get("move"):
            condition["move"] = [length * x for x in condition["move"]]
        if condition.get("rotate"):
            condition["rotate"]["center"] = [length * x for x in condition["rotate"]["center"]]
        if condition.get("pull"):
            condition["pull"] = [modulus * x for x in condition["pull"]]
    if "body" in data:
        data["body"]["force"] = [modulus / length * x for x in data["body"]["force"]]
    if "start" in data:
        data["start"]["pins"] = [[length * x for x in pin] for pin in data["start"].get("pins", [])]
    return Scene.model_validate(data | {"name": given.name})


@pytest.mark.parametrize(("length", "modulus"), UNITS)
@pytest.mark.parametrize("name", SCENES)
def test_units_change_nothing(name: str, length: float, modulus: float) -> None:
    """Newton steps are the same, energies are those in the other unit."""
    given = load(name, SCENES[name])
    reference = solved(given).summary.steps
    other = solved(scaled(given, length, modulus)).summary.steps
    scale = modulus * length**3
    assert [r.newton_iterations for r in other] == [r.newton_iterations for r in reference]
    for one, two in zip(reference, other, strict=True):
        assert two.energy / scale == pytest.approx(one.energy, rel=1e-7, abs=1e-12)
        assert two.volume_ratio == pytest.approx(one.volume_ratio, rel=1e-9)


def test_a_trial_that_is_rejected_changes_no_scale() -> None:
    """What is in balance is a matter of the iterates, however wild a trial was."""
    body = made(load("cube-pull", ["mesh.cells=2"]))
    balance, rng = Balance(body), np.random.default_rng(1)
    state = body.placed(0.01 * rng.normal(size=body.size), 0.1)
    balance.accept(state)
    before = balance.error(state)
    for size in (0.3, 1e3, np.inf):
        balance.error(body.placed(size * rng.normal(size=body.size), 0.1))
    assert balance.error(state) == before


TURN = {"rotate": {"axis": [1.0, 0.0, 0.0], "center": [0.5, 0.5, 0.5], "angle": 40.0}}


def turning(**more: Any) -> Scene:
    data: dict[str, Any] = {
        "mesh": {"cells": 4},
        "solve": {"element": "Q1", "steps": 1},
        "material": {"name": "stable-neo-hookean", "E": 1.0, "nu": 0.3},
        "boundary": {"left": {"fix": True}, "right": TURN, **more.pop("boundary", {})},
        **more,
    }
    return Scene.model_validate(data)


@pytest.mark.parametrize(
    "more",
    [
        {"boundary": {"left": {"move": [-0.6, 0.0, 0.0]}}},
        {"body": {"force": [0.0, 0.0, -0.4]}},
        {"boundary": {"top": {"pull": [0.0, 0.0, 0.3]}}},
    ],
    ids=["move", "weight", "pull"],
)
def test_what_moves_beside_a_turning_face_is_predicted(more: dict[str, Any]) -> None:
    """The guess is far nearer to balance than that which turns the face and lets the rest jump."""
    given = turning(**more)
    body = made(given)
    minimizer, blend = Minimizer(body, options(given)), Blend(body)
    found = minimizer.minimize(predict(minimizer, blend, body.state, 1.0))
    rest = body.placed(np.zeros(body.size), 0.0)
    full = predict(minimizer, blend, rest, 1.0)
    jumped = blend.turned(body.placed(np.zeros(body.size), 1.0), 0.0)
    energy, least = body.assembly.energy, body.assembly.energy(found)
    assert energy(full) - least < 0.35 * (energy(jumped) - least)


def test_two_turning_faces_that_share_an_edge_end_where_they_should() -> None:
    # About one axis by one angle, so that their edges know where to go: the body turns as a whole.
    body = solved(turning(boundary={"left": TURN, "top": TURN})).body
    assert abs(body.assembly.energy(body.state)) < 1e-14
    expected = body.layout.joined(body.prescribed(1.0))
    assert np.abs(body.state.values - expected)[body.held].max() < 1e-14


def test_noise_depends_on_places_alone() -> None:
    """Not on which rank sees them, in which order; and it has no order of its own."""
    points = np.random.default_rng(2).uniform(0, 3, (2000, 3))
    low, extent = points.min(axis=0), 3.0
    numbers = uniform(points, low, extent, 5)
    order = np.random.default_rng(3).permutation(len(points))
    np.testing.assert_array_equal(uniform(points[order][:700], low, extent, 5), numbers[order][:700])
    assert (numbers != uniform(points, low, extent, 6)).all()
    assert numbers.min() >= 0 and numbers.max() < 1
    assert np.abs(numbers.mean(axis=0) - 0.5).max() < 4 / np.sqrt(12 * len(points))
    assert np.abs(np.corrcoef(np.column_stack([numbers, points]).T) - np.eye(6)).max() < 0.1
    # Rounding of a place, which differs from rank to rank, is none of another place.
    np.testing.assert_array_equal(uniform(points * (1 + 1e-15), low, extent, 5), numbers)


# ---------------------------------------------------------------------- what a solve costs

# Newton steps and iterations of the linear solver of the last recorded step; a factorisation counts as one.
COUNTS: dict[tuple[str, ...], tuple[int, int]] = {
    ("cube-pull",): (2, 3),
    ("cube-twist", "solve.tolerance=1e-10"): (8, 9),
    ("cube-twist", "solve.tolerance=1e-10", "solve.linear=iterative"): (8, 170),
    ("cube-pull", "material.nu=0.499", "mesh.cells=4", "solve.steps=2", "solve.element=Q2-P1d"): (3, 4),
    ("squeeze", "mesh.cells=4", "solve.steps=10"): (26, 42),
    ("scramble",): (47, 51),
    ("cylinder-stretch",): (3, 5),
}


@pytest.mark.parametrize("case", COUNTS, ids=" ".join)
def test_counts(case: tuple[str, ...]) -> None:
    """Within a tenth, or one: what costs more is a loss, what costs less belongs into the table."""
    last = shipped(*case).summary.steps[-1]
    for found, expected in zip((last.newton_iterations, last.linear_iterations), COUNTS[case], strict=True):
        assert found == pytest.approx(expected, rel=0.1, abs=1), (last.newton_iterations, last.linear_iterations)


def test_ellipticity_in_plane_strain_is_that_of_the_plane() -> None:
    """St. Venant-Kirchhoff compressed along x: out of the plane it would fold first, which it cannot."""
    from elastune.app.body.unknowns import State
    from elastune.app.results.diagnose import diagnose
    from elastune.app.solvers.options import Options

    data = {
        "mesh": {"shape": "square", "cells": 2},
        "material": {"name": "st-venant-kirchhoff", "E": 1.0, "nu": 0.3},
        "boundary": {"left": {"fix": True}, "right": {"move": [-0.1, 0.0]}},
    }
    body = made(Scene.model_validate(data))
    values = np.zeros_like(nodal(body))
    found = {}
    for scale in (0.15, 0.5):
        values[:, 0] = -scale * body.points[:, 0]
        found[scale] = diagnose(body, Options(), State(values.ravel().copy()), "stalled")["ellipticity"]
    lam, mu = 0.3 / (1.3 * 0.4), 1 / 2.6
    for scale, value in found.items():
        assert value == pytest.approx(_least_acoustic(1 - scale, lam, mu), rel=2e-2, abs=1e-3)


def _least_acoustic(s: float, lam: float, mu: float) -> float:
    """Of F = diag(s, 1) over directions of the plane, relative to μ, from P = F S by hand."""
    F = np.diag([s, 1.0])
    E = (F.T @ F - np.eye(2)) / 2
    S = lam * np.trace(E) * np.eye(2) + 2 * mu * E
    least = np.inf
    for angle in np.linspace(0, np.pi, 2001):
        n = np.array([np.cos(angle), np.sin(angle)])
        m = F @ n
        Q = (n @ S @ n) * np.eye(2) + (lam + mu) * np.outer(m, m) + mu * (F @ F.T) * (n @ n)
        least = min(least, float(np.linalg.eigvalsh(Q)[0]))
    return least / mu
