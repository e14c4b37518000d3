"""Scenes: shipped ones are sound, and every way to get one wrong is told in a line."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from elastune.app.errors import SceneError, UserError
from elastune.app.scene.read import SHIPPED, load, shipped

GOOD = """
[mesh]
shape = "cube"
cells = 2
[solve]
steps = 1
[material]
name = "neo-hookean"
E = 1.0
nu = 0.3
[boundary.left]
fix = true
[boundary.right]
move = [0.1, 0.0, 0.0]
"""

# What is replaced in the good scene, by what, and words that the one line must have.
BROKEN = {
    "unknown table": ("[mesh]", "[msh]", ["msh", "did you mean mesh"]),
    "unknown table for a missing one": ("[material]", "[materail]", ["materail: unknown key", "did you mean material"]),
    "face of any name": ("boundary.right", 'boundary."the right: 1.5"', ["boundary.the right: 1.5: unknown face"]),
    "unknown condition on it": (
        "[boundary.right]\nmove",
        '[boundary."right-hand"]\nmoves',
        ["boundary.right-hand.moves", "did you mean move"],
    ),
    "unknown key of a rotation": (
        "move = [0.1, 0.0, 0.0]",
        "rotate = { axis = [1, 0, 0], centre = [0, 0, 0], angle = 9 }",
        ["boundary.right.rotate.centre: unknown key", "did you mean center"],
    ),
    "unknown key that is near to none": ("steps = 1", "zzz = 1", ["solve.zzz", "expected one of element, steps"]),
    "unknown mesh key": ("cells = 2", "cels = 2", ["mesh.cels", "did you mean cells"]),
    "unknown solve key": ("steps = 1", "stepz = 1", ["solve.stepz", "steps"]),
    "unknown material key": ("nu = 0.3", "nuu = 0.3", ["material.nuu", "nu"]),
    "unknown condition": ("fix = true", "fixed = true", ["boundary.left.fixed", "fix"]),
    "text for a number": ("E = 1.0", 'E = "stiff"', ["material.E", "number"]),
    "number for text": ('name = "neo-hookean"', "name = 3", ["material.name", "string"]),
    "fraction of a cell": ("cells = 2", "cells = 2.5", ["mesh.cells", "integer"]),
    "list for a table": ("[mesh]\nshape", "mesh = []\n[other]\nshape", ["mesh", "table"]),
    "no cells": ("cells = 2", "cells = 0", ["mesh.cells", "1"]),
    "negative size": ("cells = 2", "cells = 2\nsize = -1.0", ["mesh.size", "greater than 0"]),
    "infinite size": ("cells = 2", "cells = 2\nsize = inf", ["mesh.size", "finite"]),
    "size of another shape": ("cells = 2", "cells = 2\nsize = [1.0, 2.0, 3.0]", ["mesh", "size"]),
    "unknown shape": ('shape = "cube"', 'shape = "sphere"', ["mesh.shape", "cylinder"]),
    "unknown cell": ("cells = 2", 'cells = 2\ncell = "pyramid"', ["mesh.cell", "hexahedron"]),
    "graded unknown face": ("cells = 2", "cells = 2\ngrade = { leftt = 0.5 }", ["mesh", "leftt"]),
    "order of cells": ("cells = 2", "cells = 2\norder = 3", ["mesh.order", "1 or 2"]),
    "element on wrong cells": (
        "cells = 2\n[solve]",
        'cells = 2\ncell = "hexahedron"\n[solve]\nelement = "P2"',
        ["solve.element", "P2", "hexahedron"],
    ),
    "unknown element": ("steps = 1", 'steps = 1\nelement = "Q9"', ["solve.element", "Q2"]),
    "no steps": ("steps = 1", "steps = 0", ["solve.steps"]),
    "negative tolerance": ("steps = 1", "steps = 1\ntolerance = -1e-8", ["solve.tolerance"]),
    "unknown filter": ("steps = 1", 'steps = 1\nfilter = "soft"', ["solve.filter", "clamp"]),
    "nu of one half": (
        'steps = 1\n[material]\nname = "neo-hookean"\nE = 1.0\nnu = 0.3',
        'steps = 1\nelement = "Q2"\n[material]\nname = "neo-hookean"\nE = 1.0\nnu = 0.5',
        ["nu", "below 0.5 for a displacement formulation"],
    ),
    "nu of minus one": ("nu = 0.3", "nu = -1.0", ["nu", "above -1"]),
    "negative E": ("E = 1.0", "E = -1.0", ["E", "positive"]),
    "E without nu": ("nu = 0.3", "", ["nu: missing"]),
    "unknown material": ("neo-hookean", "neo-hokean", ["neo-hokean", "did you mean neo-hookean"]),
    "unknown parameter": ("nu = 0.3", "nu = 0.3\nparameters = { muu = 1.0 }", ["muu", "lam"]),
    "no lambda part": ('"neo-hookean"', '"arap"', ["arap", 'volume = "neo-hookean-ogden"']),
    "unknown volume": ("nu = 0.3", 'nu = 0.3\nvolume = "log"', ["unknown material 'log'"]),
    "negative alpha": ("nu = 0.3", "nu = 0.3\nalpha = -1.0", ["alpha", "positive"]),
    "alpha twice": ("nu = 0.3", "nu = 0.3\nalpha = 1.5\nalpha_mu = 2.0", ["alpha", "either"]),
    "extension of one": ("nu = 0.3", "nu = 0.3\nextension = 1.0", ["material.extension", "0.9"]),
    "extension with UFL": (
        "steps = 1\n[material]",
        'steps = 1\nassembly = "ufl"\n[material]\nextension = 0.25',
        ["material.extension", "spectral"],
    ),
    "stressed at rest": ('"neo-hookean"', '"ogden"\nparameters = { variant = "printed" }', ["stressed at rest"]),
    "unknown face": ("boundary.right", "boundary.rihgt", ["boundary.rihgt", "right"]),
    "two conditions on one face": ("fix = true", "fix = true\npressure = 1.0", ["boundary.left", "pressure", "fix"]),
    "no condition on a face": ("fix = true", "", ["boundary.left", "got nothing"]),
    "one face twice": ("[boundary.right]", "[boundary.left]", ["not TOML", "left"]),
    "empty load": ("move = [0.1, 0.0, 0.0]", "move = []", ["boundary.right.move"]),
    "zero load": ("move = [0.1, 0.0, 0.0]", "move = [0.0, 0.0, 0.0]", ["nothing loads the body"]),
    "two components": ("move = [0.1, 0.0, 0.0]", "move = [0.1, 0.0]", ["boundary.right.move", "3 components"]),
    "nothing holds": ("fix = true", "pull = [1.0, 0.0, 0.0]\n[boundary.bottom]\nroller=['w']", ["roller"]),
    "free body": ("fix = true\n[boundary.right]\nmove", "pull", ["nothing holds the body"]),
    "fix false": ("fix = true", "fix = false", ["boundary.left.fix"]),
    "axis of zero": (
        "move = [0.1, 0.0, 0.0]",
        "rotate = { axis = [0, 0, 0], center = [0, 0, 0], angle = 9 }",
        ["axis"],
    ),
    "rotation without center": (
        "move = [0.1, 0.0, 0.0]",
        "rotate = { axis = [1, 0, 0], angle = 9 }",
        ["boundary.right.rotate.center: missing; every rotate needs it"],
    ),
    "no material": (
        '[material]\nname = "neo-hookean"\nE = 1.0\nnu = 0.3',
        "",
        ["material: missing; every scene needs"],
    ),
    "missing mesh file": ('shape = "cube"', 'shape = "file"\npath = "none.msh"', ["none.msh", "no such file"]),
    "no mesh file": ('shape = "cube"', 'shape = "file"', ["mesh.path"]),
    "unreadable mesh": ('shape = "cube"', 'shape = "file"\npath = "broken.msh"', ["broken.msh"]),
    "unknown field": ("[solve]", '[output]\nfields = ["temperature"]\n[solve]', ["output.fields", "von_mises"]),
    "not TOML": ("[mesh]", "[mesh", ["not TOML"]),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_scene_gives_one_line_and_leaves_nothing(
    name: str, tmp_path: Path, elastune: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
    old, new, words = BROKEN[name]
    assert old in GOOD
    (tmp_path / "broken.msh").write_text("this is no mesh\n")
    (tmp_path / "scene.toml").write_text(GOOD.replace(old, new, 1))
    before = sorted(tmp_path.iterdir())
    done = elastune("run", "scene.toml", "--out", "out")
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert "scene.toml" in done.stderr
    for word in words:
        assert word in done.stderr, done.stderr
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("out", ["scene.toml/deeper", "/proc/elastune"])
def test_folder_that_cannot_be_written(
    out: str, tmp_path: Path, elastune: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
    (tmp_path / "scene.toml").write_text(GOOD)
    done = elastune("run", "scene.toml", "--out", out)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert out in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scene.toml"]


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("material.alpha", "key.key=value"),
        ("material.name.x=1", "not a table"),
        ("materail.E=2", "did you mean material"),
    ],
)
def test_bad_override(override: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        load("cube-pull", [override])


def test_unknown_scene_names_the_nearest() -> None:
    with pytest.raises(UserError, match="did you mean cube-pull"):
        load("cube-pul")


@pytest.mark.parametrize("name", shipped())
def test_shipped_scene_is_sound(name: str) -> None:
    scene = load(name)
    assert scene.name == name
    assert scene.title
    text = (SHIPPED / f"{name}.toml").read_text()
    assert text.startswith("# "), "a scene begins with what it shows and where it is from"


def test_override_of_every_type() -> None:
    scene = load("cube-pull", ["material.alpha=0.5", "material.name=hencky", "mesh.grade={left = 0.5}", "title=A b"])
    assert (scene.material.alpha, scene.material.name, scene.mesh.grade, scene.title) == (
        0.5,
        "hencky",
        {"left": 0.5},
        "A b",
    )
