"""Scenes on files: names by number and selector, loads on what overlaps, refusals in one line; any number of ranks."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from meshes import COMM, KINDS, area, file_of, write

from elastune.geometry import GeometryError, build

# Pulled along x, two unit cubes of ν = 0: the head moves by 2 σ/E where the material is linear.
BAR = """
solve = {{ steps = 1 }}
material = {{ name = "linear-elasticity", E = 2.0, nu = 0.0 }}
output = {{ fields = ["displacement"], picture = false }}
[mesh]
path = "{path}"
{more}
[boundary]
{foot} = {{ fix = true }}
{head} = {{ pull = [0.1, 0.0, 0.0] }}
"""


def bar(folder: Path, kind: str, foot: str, head: str, more: str = "") -> Path:
    """A scene on a file of a kind, with names of its ends."""
    KINDS[kind].make(folder / KINDS[kind].name)
    scene = folder / "bar.toml"
    scene.write_text(BAR.format(path=KINDS[kind].name, foot=foot, head=head, more=more))
    return scene


SELECTED = 'faces = { foot = { plane = "x", at = 0.0 }, head = { box = [[2, 0, 0], [2, 1, 1]] } }'


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    ("kind", "foot", "head", "more"),
    [
        ("overlapping groups, 4.1", "foot", "head", ""),
        ("groups without names", "30", "7", ""),
        ("no groups, selected", "foot", "head", SELECTED),
        ("inp", "foot", "end", ""),
    ],
)
def test_bar(
    solved: Callable[..., dict[str, Any]], tmp_path: Path, kind: str, foot: str, head: str, more: str, ranks: int
) -> None:
    """Reaction and energy are those of a bar, whoever names its ends."""
    summary = solved(bar(tmp_path, kind, foot, head, more), ranks=ranks)
    (step,) = summary["steps"]
    assert step["reaction"][foot] == pytest.approx([-0.1, 0, 0], abs=1e-9)
    assert step["energy"] == pytest.approx(-(0.1**2) / 2, rel=1e-8)


def test_scene_repeats(solved: Callable[..., dict[str, Any]], tmp_path: Path) -> None:
    """The scene beside the results has the selectors, and gives the same."""
    first = solved(bar(tmp_path, "no groups, selected", "foot", "head", SELECTED))
    (written,) = tmp_path.glob("run-*/scene.toml")
    assert "plane" in written.read_text()
    assert solved(written)["steps"][0]["energy"] == first["steps"][0]["energy"]


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    ("kind", "mesh", "message"),
    [
        ("no groups", "", "boundary.foot: unknown face; the mesh has 1, 2, 3"),
        ("no groups", 'faces = { foot = { plane = "x", at = 9.0 } }', r"mesh\.faces\.foot = .*: no facet lies there"),
        ("no groups", "faces = { foot = { tag = 99 } }", "mesh.faces.foot = {tag = 99}: no group of surfaces"),
        ("no groups", 'faces = { foot = { plane = "x" } }', "mesh.faces.foot.at: missing; expected the plane's place"),
        (
            "no groups",
            "faces = { foot = { all = true, tag = 1 } }",
            "faces.foot: expected one of .*, got tag and all",
        ),
        (
            "no groups",
            "faces = { foot = { sphere = { center = [0, 0, 0] } } }",
            "foot.sphere.radius: missing",
        ),
        ("no groups", "faces = { foot = { ball = 1 } }", "mesh.faces.foot.ball: unknown key"),
        ("no groups", "regions = { foot = { all = false } }", "mesh.regions.foot.all = False: "),
        ("step", "", "part.step: expected h, the size of the cells"),
    ],
)
def test_refused(
    elastune: Callable[..., subprocess.CompletedProcess[str]],
    tmp_path: Path,
    kind: str,
    mesh: str,
    message: str,
    ranks: int,
) -> None:
    """One line, exit status 2, nothing written."""
    done = elastune("run", bar(tmp_path, kind, "foot", "1", mesh), "--out", tmp_path / "out", ranks=ranks)
    assert done.returncode == 2
    (line,) = [line for line in done.stderr.splitlines() if "bar.toml" in line]
    assert re.search(message, line), line
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def mixed(gmsh: Any) -> None:
    """A cube of hexahedra on one of tetrahedra, with pyramids between."""
    occ, model, mesh = gmsh.model.occ, gmsh.model, gmsh.model.mesh
    made = occ.extrude([(2, occ.addRectangle(0, 0, 0, 1, 1))], 0, 0, 1, numElements=[2], recombine=True)
    occ.fragment([(3, occ.addBox(0, 0, -1, 1, 1, 1))], [each for each in made if each[0] == 3])
    occ.synchronize()
    for _, curve in model.getEntities(1):
        mesh.setTransfiniteCurve(curve, 3)
    for _, surface in model.getEntitiesInBoundingBox(-0.1, -0.1, -0.1, 1.1, 1.1, 0.1, 2):
        mesh.setTransfiniteSurface(surface)
        mesh.setRecombine(2, surface)
    mesh.generate(3)


def prisms(gmsh: Any) -> None:
    """A box of prisms."""
    gmsh.model.occ.extrude([(2, gmsh.model.occ.addRectangle(0, 0, 0, 2, 1))], 0, 0, 1, numElements=[2], recombine=True)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(3)


def triangles_and_quadrilaterals(gmsh: Any) -> None:
    """A rectangle of both."""
    occ, mesh = gmsh.model.occ, gmsh.model.mesh
    occ.fragment([(2, occ.addRectangle(0, 0, 0, 1, 1))], [(2, occ.addRectangle(1, 0, 0, 1, 1))])
    occ.synchronize()
    mesh.setRecombine(2, 1)
    mesh.generate(2)


@pytest.mark.parametrize("draw", [mixed, prisms, triangles_and_quadrilaterals])
def test_what_splits_cells(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, draw: Callable[[Any], None]) -> None:
    """Cells of several types are refused with a command, which makes a mesh that conforms: its skin is closed."""
    path = write(tmp_path, draw, SaveAll=1)
    with pytest.raises(GeometryError, match="this splits them: ") as raised:
        build(COMM, "file", path=path)
    command = shlex.split(str(raised.value).partition("this splits them: ")[2])
    subprocess.run([sys.executable, *command[1:]], cwd=tmp_path, check=True, capture_output=True, timeout=300)
    g = build(COMM, "file", path=tmp_path / "split.vtk", faces={"skin": {"all": True}})
    assert g.volume() == pytest.approx(2)
    assert len(g.regions) < 4
    assert area(g, "skin") == pytest.approx(10 if draw is not triangles_and_quadrilaterals else 6)


def test_reduced_cells_are_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = file_of("hexahedron 64", tmp_path)
    build(COMM, "file", path=path)
    (record,) = caplog.records
    assert record.getMessage() == f"{path}: cells Hexahedron 64 become those of second order"
