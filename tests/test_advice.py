"""What is told beside the numbers: that a mesh locks, by how much, and advice that the scene can follow."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import made, solved
from mpi4py import MPI

from elastune.app.cli.main import main
from elastune.app.results.advice.advise import ADVICE, Case, advise
from elastune.app.results.advice.locking import locking
from elastune.app.run import start
from elastune.app.scene.build import options
from elastune.app.scene.override import override
from elastune.app.scene.read import parse
from elastune.app.scene.schema import Scene
from elastune.app.solvers import outcome

BEAM = {
    "mesh": {"shape": "box", "size": [10.0, 1.0, 1.0], "cells": [20, 2, 2]},
    "boundary": {"left": {"fix": True}, "right": {"pull": [0.0, 0.0, -2e-5]}},
}
STRIP = {
    "mesh": {"shape": "rectangle", "size": [10.0, 1.0], "cells": [20, 2]},
    "boundary": {"left": {"fix": True}, "right": {"pull": [0.0, -2e-5]}},
}
PULLED = {"mesh": {"cells": 4}, "boundary": {"left": {"fix": True}, "right": {"move": [0.1, 0.0, 0.0]}}}
PAD = {
    "mesh": {"shape": "box", "size": [4.0, 4.0, 1.0], "cells": [4, 4, 2]},
    "boundary": {"bottom": {"fix": True}, "top": {"move": [0.0, 0.0, -0.05]}},
}
SIDES = {face: {"roller": [axis]} for face, axis in zip(("left", "right", "front", "back"), "xxyy", strict=True)}
CONFINED = {"mesh": {"cells": 3}, "boundary": {**SIDES, "bottom": {"roller": ["z"]}, "top": {"pressure": 0.3}}}
UNIFORM = {
    "mesh": {"cells": 3},
    "boundary": {
        "left": {"roller": ["x"]},
        "front": {"roller": ["y"]},
        "bottom": {"roller": ["z"]},
        "top": {"move": {"z": 0.5}},
    },
}
SHAPES = {"beam": BEAM, "strip": STRIP, "pulled": PULLED, "pad": PAD, "confined": CONFINED, "uniform": UNIFORM}


def scene(given: dict[str, Any], element: str, nu: float, **solve: Any) -> Scene:
    material = {"name": "neo-hookean", "E": 1.0, "nu": nu}
    data = {**given, "solve": {"element": element, "steps": 1, **solve}, "material": material}
    return parse(data, Path("case.toml"))


def stiffness(given: dict[str, Any], element: str, nu: float) -> float:
    """Twice the energy over the square of the motion, or the square of the load over it, each to a constant."""
    energy = solved(scene(given, element, nu)).summary.steps[-1].energy
    return energy if energy > 0 else -1 / energy


# ---------------------------------------------------------------- locking


@pytest.mark.parametrize(
    ("shape", "element", "nu", "within"),
    [
        ("beam", "P1", 0.499, 3.0),
        ("beam", "Q1", 0.499, 1.3),
        ("beam", "P1", 0.4999, 8.0),
        ("strip", "Q1", 0.49, 1.3),
        ("strip", "P1", 0.4999999, 12.0),
        ("pulled", "P1", 0.49, 1.3),
        ("pulled", "Q1", 0.49, 1.4),
        ("pulled", "Q1", 0.499, 3.0),
        ("pad", "P1", 0.49, 2.0),
        ("pad", "Q1", 0.49, 1.6),
    ],
)
def test_locking_is_told_by_about_how_much(shape: str, element: str, nu: float, within: float) -> None:
    """Against a mixed element on the same mesh; what to write instead is that element."""
    given, flat = SHAPES[shape], shape == "strip"
    run = solved(scene(given, element, nu))
    told = run.summary.locking
    mixed = "P2-P1" if element == "P1" else "Q2-P1d"
    assert told is not None and told["instead"] == f'set solve.element = "{mixed}"'
    assert 0 <= told["share"] < 1 and run.body.dimension == (2 if flat else 3)
    truth = stiffness(given, element, nu) / stiffness(given, mixed, nu)
    assert 1 / within < told["factor"] / truth < within, (told["factor"], truth)


@pytest.mark.parametrize(
    ("shape", "element", "nu"),
    [
        *(("beam", element, 0.499) for element in ("P2", "Q2", "P2-P1", "Q2-P1d", "Q1-P0", "P1-bubble")),
        *(("beam", element, 0.3) for element in ("P1", "Q1")),
        *(("strip", element, 0.4999999) for element in ("P2", "Q2")),
        *((shape, element, 0.499) for shape in ("confined", "uniform") for element in ("P1", "Q1", "Q2")),
    ],
)
def test_what_does_not_lock_is_not_told(shape: str, element: str, nu: float) -> None:
    assert solved(scene(SHAPES[shape], element, nu)).summary.locking is None


def test_the_part_that_locks_is_named() -> None:
    """A stiff, compressible half beside one that is soft and nearly incompressible; no jump between them counts."""
    soft = {"name": "neo-hookean", "E": 1.0, "nu": 0.499}
    half = {"box": [[0.0, 0.0, 0.0], [0.5, 1.0, 1.0]]}
    given = {
        **PULLED,
        "mesh": {"cells": 4, "regions": {"soft": half}},
        "region": {"soft": {"material": soft}},
        "material": {"name": "neo-hookean", "E": 5.0, "nu": 0.3},
        "solve": {"element": "Q1", "steps": 1},
    }
    told = solved(parse(given, Path("case.toml"))).summary.locking
    assert told is not None and (told["region"], round(told["nu"], 9)) == ("soft", 0.499)
    assert "region soft" in told["message"]
    series = {**CONFINED, "mesh": {"cells": 4, "regions": {"soft": half}}}
    assert solved(parse({**given, **series}, Path("case.toml"))).summary.locking is None


@pytest.mark.parallel
def test_locking_is_the_same_on_all_ranks() -> None:
    given = scene(BEAM, "Q1", 0.499)
    together, alone = (start(given, comm).finish().summary.locking for comm in (MPI.COMM_WORLD, MPI.COMM_SELF))
    assert together is not None and alone is not None
    assert together["factor"] == pytest.approx(alone["factor"], rel=1e-6)


def test_locking_is_on_the_screen_and_in_the_summary(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    settings = ("mesh.cells=3", "solve.steps=1", "material.nu=0.499", "output.picture=false", "output.fields=[]")
    assert main(["run", "cube-pull", *(word for setting in settings for word in ("--set", setting))]) == 0
    (line,) = (line for line in capsys.readouterr().out.splitlines() if "locks" in line)
    assert re.fullmatch(r'Q1 at nu = 0\.499 locks: .* times too stiff; set solve\.element = "Q2-P1d"', line)
    assert '"instead": "set solve.element = \\"Q2-P1d\\""' in Path("results/cube-pull/summary.json").read_text()


# ---------------------------------------------------------------- advice

KINDS = sorted({kind.kind for kind in vars(outcome).values() if isinstance(getattr(kind, "kind", None), str)})
FOUND = {"unbounded_below": True, "ellipticity": -1.0, "locking": "it locks"}
# Scenes that differ in what they can do.
CAN: dict[str, dict[str, Any]] = {
    "P1": {"solve": {"element": "P1"}},
    "Q1": {},
    "Q2": {"solve": {"element": "Q2"}},
    "mixed": {"solve": {"element": "Q2-P1d"}},
    "incompressible": {"material": {"name": "neo-hookean", "E": 1.0, "nu": 0.5}, "solve": {"element": "P2-P1"}},
    "by UFL": {"solve": {"assembly": "ufl"}},
    "by UFL, mixed": {"solve": {"assembly": "ufl", "element": "Q2-P1d"}},
    "with a trust region": {"solve": {"method": "trust-region"}},
    "with a filter": {"solve": {"filter": "clamp"}},
    "without a part for volume": {"material": {"name": "arap", "E": 1.0, "nu": 0.0}},
    "of small strain": {"material": {"name": "linear-elasticity", "E": 1.0, "nu": 0.45}},
    "of small strain by UFL": {
        "material": {"name": "linear-elasticity", "E": 1.0, "nu": 0.45},
        "solve": {"assembly": "ufl"},
    },
    "continued": {"material": {"name": "neo-hookean", "E": 1.0, "nu": 0.45, "extension": 0.3}},
    "from elsewhere": {"start": {"shape": "plane"}, "material": {"name": "stable-neo-hookean", "E": 1.0, "nu": 0.45}},
    "under a pressure": {"boundary": {"left": {"fix": True}, "right": {"pressure": 0.1}}},
    "in two stages": {"stage": [{}, {}]},
    "by another solver": {"solve": {"linear": "iterative"}},
    "along an arc": {"solve": {"follow": "arc"}},
    "free": {"boundary": {f: {"pressure": 0.1} for f in ("left", "right")}, "solve": {"free": True}},
    "in a plane": {
        "mesh": {"shape": "square", "cells": 1},
        "boundary": {"left": {"fix": True}, "right": {"pull": [0, 1]}},
    },
    "of two parts": {
        "mesh": {"cells": 2, "regions": {"half": {"box": [[0, 0, 0], [0.5, 1, 1]]}}},
        "region": {"half": {"material": {"name": "fung", "E": 1.0, "nu": 0.45}}},
    },
}  # fmt: skip


@pytest.mark.parametrize("name", CAN)
def test_advice_can_be_followed(name: str) -> None:
    """Every key that is named may be set to what is said: the scene is accepted, and not the same as before."""
    base: dict[str, Any] = {
        "mesh": {"cells": 1},
        "solve": {"time_limit": 9.0},
        "material": {"name": "neo-hookean", "E": 1.0, "nu": 0.45},
        "boundary": {"left": {"fix": True}, "right": {"move": [0.1, 0.0, 0.0]}},
    }
    data = base | CAN[name]
    data["solve"] = {**base["solve"], **CAN[name].get("solve", {})}
    given = parse(data, Path("case.toml"))
    body = made(given)
    lines = {
        line for kind in KINDS for line in advise(Case(body, options(given), given.start is not None, kind, FOUND))
    }
    for line in lines:
        for key, value in re.findall(r"(?:set|raise|lower) ([\w.]+)(?: = (\"[^\"]*\"|[\d.]+))?", line):
            changed = {**data, **{table: dict(own) for table, own in data.items() if isinstance(own, dict)}}
            # What is to be raised or lowered is a number of [solve].
            override(changed, f"{key}={value or 2 * getattr(given.solve, key.removeprefix('solve.'))}")
            other = parse(changed, Path("case.toml"))
            assert other != given, line
            assert made(other).size > 0
    assert lines
    assert given.start is None or not any("solve.steps" in line for line in lines)


def test_each_advice_is_given_somewhere() -> None:
    """And none without its condition."""
    given = parse({"mesh": {"cells": 1}, "solve": {"time_limit": 1.0, "assembly": "ufl"}, **_rest()}, Path("case.toml"))
    body, filtered = (
        made(given),
        made(given.model_copy(update={"solve": given.solve.model_copy(update={"assembly": "auto"})})),
    )
    seen: set[str] = set()
    for kind in KINDS:
        for one in (body, filtered):
            seen |= {line.split()[1] for line in advise(Case(one, options(given), False, kind, FOUND))}
    calm = {"unbounded_below": False, "ellipticity": 1.0, "locking": None}
    assert advise(Case(filtered, options(given), True, "crawling", calm)) == [
        "take a finer mesh around the worst cells"
    ]
    assert len(seen) >= len(ADVICE) - 1


def _rest() -> dict[str, Any]:
    return {
        "material": {"name": "neo-hookean", "E": 1.0, "nu": 0.45},
        "boundary": {"left": {"fix": True}, "right": {"move": [0.1, 0.0, 0.0]}},
    }


def test_no_volume_change_no_locking() -> None:
    body = made(scene(PULLED, "Q1", 0.499))
    assert locking(body) is None
    values = np.zeros_like(body.state.values)
    values[:] = np.nan
    body.take(type(body.state)(values))
    assert locking(body) is None
