"""Scenes that say more than a cube that is pulled, each wrong in one way: a line, status 2, nothing written."""

from pathlib import Path

import pytest

from elastune.app.cli.main import main

GOOD = """
[mesh]
cells = 2
[mesh.faces]
foot = { plane = "z", at = 0.0 }
grip = { box = [[0.0, 0.0, 1.0], [0.5, 1.0, 1.0]] }
[mesh.regions]
core = { sphere = { center = [0.25, 0.25, 0.25], radius = 0.4 } }
[solve]
steps = 1
[material]
name = "neo-hookean"
E = 1.0
nu = 0.3
[region.core]
material = { name = "stable-neo-hookean", E = 5.0, nu = 0.4 }
[boundary.foot]
fix = true
[boundary.grip]
pull = ["0.1*x", 0.0, 0.0]
[boundary.back]
roller = ["y"]
pressure = 0.01
[boundary.right]
spring = { stiffness = 0.1 }
[boundary.left]
moment = { axis = [0, 0, 1], center = [0, 0.5, 0.5], value = 0.001 }
[point.tip]
at = [1.0, 0.0, 1.0]
force = [0.0, 0.0, 0.001]
[body]
force = [0.0, 0.0, "-0.01*z"]
[[stage]]
name = "load"
[[stage]]
name = "shear"
steps = 2
boundary.grip.pull = [0.1, 0.0, 0.0]
[output]
picture = false
average = true
fields = ["pk1", "log_strain", "max_principal"]
[output.points]
corner = [1.0, 1.0, 1.0]
"""

SPHERE = "sphere = { center = [0.25, 0.25, 0.25], radius = 0.4 }"
PLANE = '{ plane = "z", at = 0.0 }'
GRIP = '["0.1*x", 0.0, 0.0]'
SPRING = "{ stiffness = 0.1 }"
TIP = "at = [1.0, 0.0, 1.0]"

# What is replaced in the good scene, by what, and words of the line.
BROKEN: dict[str, tuple[str, str, list[str]]] = {
    # -------------------------------------------------------------- selectors
    "selector without a kind": (PLANE, "{ at = 0.0 }", ["mesh.faces.foot", "expected one of tag, plane, box"]),
    "selector of two kinds": (PLANE, '{ plane = "z", at = 0.0, all = true }', ["mesh.faces.foot", "all and plane"]),
    "selector of an unknown kind": (PLANE, "{ plain = 0.0 }", ["mesh.faces.foot.plain", "did you mean plane"]),
    "plane of an unknown axis": (PLANE, '{ plane = "w", at = 0.0 }', ["mesh.faces.foot.plane = 'w'"]),
    "plane without a place": (PLANE, '{ plane = "z" }', ["mesh.faces.foot.at: missing", "place along z"]),
    "plane without a direction": (
        PLANE,
        "{ plane = { normal = [0, 0, 0], point = [0, 0, 0] } }",
        ["mesh.faces.foot.plane.normal", "other than zero"],
    ),
    "plane without a point": (PLANE, "{ plane = { normal = [0, 0, 1] } }", ["foot.plane.point: missing"]),
    "place of no plane": (PLANE, "{ all = true, at = 0.0 }", ["mesh.faces.foot.at", "with all"]),
    "plane of cells": (SPHERE, 'plane = "z", at = 0.0', ["mesh.regions.core.plane"]),
    "corners the wrong way": (
        "[[0.0, 0.0, 1.0], [0.5, 1.0, 1.0]]",
        "[[0.5, 1.0, 1.0], [0.0, 0.0, 1.0]]",
        ["mesh.faces.grip.box", "lower corner"],
    ),
    "one corner": ("[[0.0, 0.0, 1.0], [0.5, 1.0, 1.0]]", "[[0.0, 0.0, 1.0]]", ["mesh.faces.grip.box", "2 items"]),
    "corners in a plane": (
        "[[0.0, 0.0, 1.0], [0.5, 1.0, 1.0]]",
        "[[0.0, 0.0], [0.5, 1.0]]",
        ["mesh.faces.grip.box", "expected 3 numbers"],
    ),
    "negative radius": ("radius = 0.4", "radius = -0.4", ["mesh.regions.core.sphere.radius = -0.4", "greater than 0"]),
    "radius of a sphere": ("radius = 0.4", "radii = 0.4", ["mesh.regions.core.sphere.radii", "did you mean radius"]),
    "cylinder along nothing": (
        SPHERE,
        "cylinder = { axis = [0, 0, 0], center = [0, 0, 0], radius = 1.0 }",
        ["mesh.regions.core.cylinder.axis", "other than zero"],
    ),
    "tag of zero": (PLANE, "{ tag = 0 }", ["mesh.faces.foot.tag = 0", "1"]),
    "tag of nothing": (PLANE, "{ tag = 77 }", ["mesh.faces.foot = {tag = 77}", "no group", "1, 2, 3, 4, 5, 6"]),
    "selector that finds nothing": ("at = 0.0 }", "at = 0.3 }", ["mesh.faces.foot", "at = 0.3", "no facet lies there"]),
    "region that holds nothing": (
        "[0.25, 0.25, 0.25]", "[0.25, 0.25, 9.0]",
        ["mesh.regions.core", "no cell lies there"],
    ),
    "tolerance of a body": (
        PLANE, '{ plane = "z", at = 0.0, tolerance = 2.0 }',
        ["foot.tolerance = 2.0", "less than 1"],
    ),
    "name of a face of the shape": (
        "foot = {", "left = { all = true }\nfoot = {",
        ["mesh.faces.left", "another 'left'"],
    ),
    # -------------------------------------------------------------- regions and materials
    "unknown region": ("[region.core]", "[region.cores]", ["region.cores", "core"]),
    "unknown key of a region": (
        "[region.core]\nmaterial", "[region.core]\nmaterail",
        ["region.core.materail", "material"],
    ),
    "unknown material of a region": (
        '"stable-neo-hookean"', '"stable-neo-hokean"',
        ["region.core.material", "mean stable"],
    ),
    "ν of a region": ("nu = 0.4 }", "nu = 0.7 }", ["region.core.material: nu: must be below 0.5, got 0.7"]),
    "E without ν of a region": ("E = 5.0, nu = 0.4", "E = 5.0", ["region.core.material: nu: missing"]),
    "moduli without a unit": (
        'name = "stable-neo-hookean", E = 5.0, nu = 0.4',
        'name = "mooney-rivlin", parameters = { C1 = 4e5, C2 = 1e5 }',
        ["region.core.material", "mooney-rivlin.K", "missing"],
    ),
    "volume without a unit": (
        'name = "stable-neo-hookean", E = 5.0, nu = 0.4',
        'name = "ogden", volume = "neo-hookean-ogden", parameters = { mu = [0.6, 0.1, -0.1], alpha = [1.3, 5, -2] }',
        ["region.core.material", "volume", "E and nu"],
    ),
    "moduli twice": (
        'name = "neo-hookean"\nE = 1.0\nnu = 0.3',
        'name = "mooney-rivlin"\nE = 1.0\nnu = 0.5\nparameters = { C1 = 0.1 }',
        ["material", "C1: follows from E and nu"],
    ),
    # -------------------------------------------------------------- conditions by component
    "unknown component": (GRIP, "{ normals = 0.1 }", ["boundary.grip.pull.normals", "did you mean normal"]),
    "move along nothing": ("fix = true", "move = {}", ["boundary.foot.move", "expected x, y or z"]),
    "move along an unknown axis": ("fix = true", "move = { u = 1.0 }", ["boundary.foot.move.u", "x, y, z"]),
    "component held twice": (
        "fix = true", 'move = { x = 0.0 }\nroller = ["x"]',
        ["boundary.foot: x", "move", "roller"],
    ),
    "component held and loaded": (
        'roller = ["y"]', 'roller = ["y"]\npull = [0, 1, 0]',
        ["boundary.back: y is held by"],
    ),
    "loaded though held whole": ("fix = true", "fix = true\nforce = [1, 0, 0]", ["boundary.foot", "fix", "force"]),
    "roller along nothing": ('roller = ["y"]', "roller = []", ["boundary.back.roller = []"]),
    "roller along an unknown axis": ('roller = ["y"]', 'roller = ["n"]', ["boundary.back.roller", "x, y, z"]),
    "edge that goes two ways": (
        'roller = ["y"]',
        "move = { y = 0.3 }",
        ["boundary.foot and boundary.back", "along y"],
    ),
    "no value": (GRIP, "true", ["boundary.grip.pull = True"]),
    "unknown face": ("[boundary.back]", "[boundary.bakc]", ["boundary.bakc: unknown face", "back"]),
    # -------------------------------------------------------------- loads
    "pull of two components": (GRIP, "[0.1, 0.0]", ["boundary.grip.pull", "3 components"]),
    "pull without end": (GRIP, "[inf, 0.0, 0.0]", ["boundary.grip.pull", "finite"]),
    "pressure as text": ("pressure = 0.01", 'pressure = "high"', ["boundary.back.pressure = 'high'", "number"]),
    "spring of zero": (SPRING, "{ stiffness = 0.0 }", ["boundary.right.spring.stiffness = 0.0", "greater than 0"]),
    "spring that pushes": (SPRING, "{ stiffness = [0.1, -0.1, 0] }", ["right.spring.stiffness.1 = -0.1"]),
    "spring of four axes": (
        SPRING, "{ stiffness = [1, 1, 1, 1] }",
        ["boundary.right.spring.stiffness", "3 components"],
    ),
    "spring without stiffness": (SPRING, "{}", ["boundary.right.spring.stiffness: missing"]),
    "moment without a center": ("center = [0, 0.5, 0.5], ", "", ["boundary.left.moment.center: missing"]),
    "moment about nothing": ("axis = [0, 0, 1]", "axis = [0, 0, 0]", ["boundary.left.moment.axis", "other than zero"]),
    "force on the body of one number": ('force = [0.0, 0.0, "-0.01*z"]', "force = 1.0", ["body.force", "list"]),
    "unknown load on the body": ('force = [0.0, 0.0, "-0.01*z"]', "forces = [0, 0, 1]", ["body.forces", "mean force"]),
    # -------------------------------------------------------------- expressions
    "expression that does not end": ('"0.1*x"', '"0.1*"', ["boundary.grip.pull", "'0.1*' is no expression"]),
    "expression of an unknown name": ('"0.1*x"', '"0.1*t"', ["boundary.grip.pull", "unknown name 't'"]),
    "expression of an unknown function": ('"0.1*x"', '"sine(x)"', ["boundary.grip.pull", "unknown function 'sine'"]),
    "expression that is a program": ('"0.1*x"', '"().__class__"', ["boundary.grip.pull", "no expression"]),
    "expression of no number": ('"0.1*x"', '"sqrt(x - 2)"', ["boundary.grip.pull", "no number"]),
    "expression of too many arguments": ('"-0.01*z"', '"sin(x, y)"', ["body.force", "takes 1 argument, got 2"]),
    # -------------------------------------------------------------- points
    "point where no node is": (TIP, "at = [0.7, 0.0, 1.0]", ["point.tip", "no node", "nearest"]),
    "point in the plane": (TIP, "at = [1.0, 0.0]", ["point.tip.at", "3 components"]),
    "point without a place": (TIP + "\n", "", ["point.tip"]),
    "pull at a point": (TIP, TIP + "\npull = [1, 0, 0]", ["point.tip.pull: unknown key"]),
    "point without a condition": (TIP + "\nforce = [0.0, 0.0, 0.001]", TIP, ["point.tip", "got nothing"]),
    "curve of no file": ("[point.tip]", "[curve.rim]\nfix = true\n[point.tip]", ["curve.rim"]),
    # -------------------------------------------------------------- stages
    "stage with an unknown key": ("steps = 2", "stepz = 2", ["stage.1.stepz", "did you mean steps"]),
    "stage of no steps": ("steps = 2", "steps = 0", ["stage.1.steps = 0", "1"]),
    "stage that holds more": (
        "boundary.grip.pull = [0.1, 0.0, 0.0]", "boundary.right.move = { x = 0.1 }",
        ["stage shear: boundary.right", "first stage"],
    ),
    "stage that changes a spring": (
        "boundary.grip.pull = [0.1, 0.0, 0.0]",
        "boundary.right.spring = { stiffness = 1.0 }",
        ["stage shear: boundary.right.spring", "same in all stages"],
    ),
    "stage that turns a pull": (
        "boundary.grip.pull = [0.1, 0.0, 0.0]",
        "boundary.grip.pull = { normal = 1.0 }",
        ["stage shear: boundary.grip.pull", "form of the stage before"],
    ),
    "stage that is a table": ('[[stage]]\nname = "load"\n[[stage]]', "[stage]", ["stage", "list"]),
    "stage on an unknown face": ("boundary.grip.pull", "boundary.grap.pull", ["boundary.grap: unknown face", "grip"]),
    # -------------------------------------------------------------- what is written
    "output of an unknown field": ('"pk1"', '"pk2"', ["output.fields.0 = 'pk2'", "pk1"]),
    "output of a point outside": (
        "corner = [1.0, 1.0, 1.0]", "corner = [1.0, 1.0, 3.0]",
        ["output.points.corner", "outside"],
    ),
    "output of a point in the plane": (
        "corner = [1.0, 1.0, 1.0]", "corner = [1.0, 1.0]",
        ["output.points.corner", "3 coord"],
    ),
    "output of a point without place": ("corner = [1.0, 1.0, 1.0]", "corner = {}", ["output.points.corner", "list"]),
    "average of a word": ("average = true", 'average = "nodes"', ["output.average = 'nodes'", "boolean"]),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_a_line_and_nothing_written(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    old, new, words = BROKEN[name]
    assert old in GOOD
    monkeypatch.chdir(tmp_path)
    Path("scene.toml").write_text(GOOD.replace(old, new, 1))
    assert main(["run", "scene.toml", "--out", "out"]) == 2
    said = capfd.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert line.startswith("elastune: scene.toml: ")
    for word in words:
        assert word in line, line
    # What was given is told once.
    assert not any(line.count(text) > 1 for text in new.split('"') if len(text) > 5 and text in line), line
    assert [path.name for path in tmp_path.iterdir()] == ["scene.toml"]


def test_the_scene_is_sound_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("scene.toml").write_text(GOOD)
    assert main(["run", "scene.toml", "--out", "out"]) == 0
    assert len(Path("out/history.csv").read_text().splitlines()) == 1 + 1 + 2
