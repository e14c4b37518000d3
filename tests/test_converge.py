"""Studies: their files, what becomes of them, and what is read off their results."""

import csv
import subprocess
from collections.abc import Callable
from pathlib import Path

import bodies
import numpy as np
import pytest

from elastune.app.errors import UserError
from elastune.app.results.quantities import Probes, force, moment
from elastune.app.scene.read import SHIPPED
from elastune.app.studies.cases import cases, overkill
from elastune.app.studies.orders import fitted_order, limit, price
from elastune.app.studies.records import Records, key
from elastune.app.studies.schema import load_study, shipped
from elastune.forms.energy import CATALOGUE

Command = Callable[..., subprocess.CompletedProcess[str]]

GOOD = """
title = "A small study"
scene = "cube-pull"
plot = "force"
[quantities.force]
reaction = "right"
along = "x"
[reference]
overkill = { solve.element = "Q2", mesh.cells = 2 }
[set]
solve.steps = 1
boundary.right = { move = [0.1, 0.0, 0.0] }
[[series]]
label = "ours"
vary = { material.nu = [0.2, 0.3], mesh.cells = [1, 2] }
"""

# What is replaced in the good study, by what, and words that the one line must have.
BROKEN = {
    "unknown key": ("title", "titel", ["titel", "unknown"]),
    "no title": ('title = "A small study"\n', "", ["title", "missing"]),
    "unknown scene": ('"cube-pull"', '"cube-push"', ["cube-push", "cube-pull"]),
    "unknown quantity": ('plot = "force"', 'plot = "stress"', ["plot", "stress", "energy, volume_ratio, force"]),
    "unknown default": ("[quantities", 'default = "theirs"\n[quantities', ["default", "theirs", "ours"]),
    "no axis": ('along = "x"\n', "", ["quantities.force", "along", "about"]),
    "axis": ('along = "x"', 'along = "w"', ["quantities.force.along", "'w'"]),
    "free face": ('reaction = "right"', 'reaction = "top"', ["quantities.force.reaction", "left or right"]),
    "two references": ("overkill =", "manufactured = true\noverkill =", ["reference", "exactly one"]),
    "two values to extrapolate": (
        "[set]",
        "extrapolate = { mesh.cells = [1, 2] }\n[set]",
        ["reference", "three values"],
    ),
    "impossible reference": ("mesh.cells = 2 }", 'mesh.cells = 2, mesh.cell = "tetrahedron" }', ["Q2", "tetrahedron"]),
    "number for a list": ("[1, 2] }", "2 }", ["vary.mesh.cells", "list"]),
    "no cells": ("[1, 2] }", "[0, 2] }", ["mesh.cells", "mesh.cells = 0"]),
    "unknown solver": ("label", 'solver = "abacus"\nlabel', ["series.0.solver", "tutorial"]),
    "no ranks": ("label", "ranks = 0\nlabel", ["series.0.ranks", "1"]),
    "unknown material": ("[set]\n", '[set]\nmaterial.name = "steel"\n', ["steel", "material"]),
    "not TOML": ("[set]", "[set", ["not TOML"]),
}


def write(folder: Path, text: str) -> str:
    (folder / "small.toml").write_text(text)
    return str(folder / "small.toml")


# ---------------------------------------------------------------------- files


@pytest.mark.parametrize("name", BROKEN)
def test_bad_studies_are_told_in_a_line(name: str, tmp_path: Path) -> None:
    old, new, words = BROKEN[name]
    assert old in GOOD
    with pytest.raises(UserError) as error:
        cases(load_study(write(tmp_path, GOOD.replace(old, new, 1))))
    assert "\n" not in str(error.value)
    for word in words:
        assert word in str(error.value), str(error.value)


def test_bad_studies_end_with_status_2(elastune: Command, tmp_path: Path) -> None:
    for study in ("no-such-study", write(tmp_path, GOOD.replace("[0.2, 0.3]", "[0.2, 0.6]"))):
        done = elastune("converge", study)
        assert done.returncode == 2
        assert done.stdout == ""
        assert done.stderr.count("\n") == 1 and done.stderr.startswith("elastune: ")
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize("name", shipped())
def test_shipped_studies_are_sound(name: str) -> None:
    study = load_study(name)
    found = cases(study)
    assert len({key(study, case) for case in found}) == len(found)


def test_shipped_studies_are_listed(elastune: Command) -> None:
    listed = elastune("converge").stdout
    assert [line.split()[0] for line in listed.splitlines()] == shipped()
    assert {"cube-pull", "cylinder-twist", "cook", "mms", "materials"} <= set(shipped())


def test_the_study_of_materials_has_them_all() -> None:
    assert {case.scene.material.name for case in cases(load_study("materials"))} == set(CATALOGUE)


def test_cases_and_their_names(tmp_path: Path) -> None:
    study = load_study(write(tmp_path, GOOD))
    found = cases(study)
    assert [case.curve for case in found] == ["ours, ν = 0.2"] * 2 + ["ours, ν = 0.3"] * 2
    assert [case.scene.mesh.cells for case in found] == [1, 2, 1, 2]
    assert "material.nu=0.2 mesh.cells=1" in found[0].line
    (reference,) = overkill(study, found[2])
    assert reference["solve.element"] == "Q2" and reference["material.nu"] == 0.3
    with_panels = load_study(write(tmp_path, GOOD.replace("[quan", 'panels = "material.nu"\n[quan', 1)))
    assert {(case.curve, case.panel) for case in cases(with_panels)} == {("ours", "ν = 0.2"), ("ours", "ν = 0.3")}


# ---------------------------------------------------------------------- what errors say


def test_orders() -> None:
    h = np.array([1, 1 / 2, 1 / 4, 1 / 8])
    assert fitted_order(list(h), list(3 * h**2.5)) == pytest.approx(2.5)
    # Only the finest three count, in whatever order they come.
    assert fitted_order([0.25, 1, 0.125, 0.5], [0.0625, 100.0, 0.015625, 0.25]) == pytest.approx(2)
    assert np.isnan(fitted_order([1.0], [1.0]))


def test_limit() -> None:
    assert limit([5 + 3 * q for q in (1, 0.3, 0.09)]) == pytest.approx(5)
    assert limit([2.0, 1.0, 1.0]) == 1.0
    with pytest.raises(ValueError, match="shrink"):
        limit([1.0, 2.0, 3.0])


def test_price_takes_no_credit_for_luck() -> None:
    points = [(1.0, 0.1), (2.0, 0.001), (4.0, 0.02), (8.0, 0.005), (16.0, 0.001)]
    assert price(points, 0.01) == 8.0
    assert price(points, 0.03) == 2.0
    assert price(points, 1e-4) == float("inf")


def test_forces_and_moments_of_all_faces_balance() -> None:
    """Of a twisted cube that nothing else holds; and a point at a node tells how far that has moved."""
    run = bodies.shipped("cube-twist", "mesh.cells=3", "solve.steps=2", "solve.tolerance=1e-11", "output.picture=false")
    body = run.body
    forces = body.layout.nodal(body.assembly.residual(body.state))
    faces = body.constraints.faces.values()
    for total in (force, moment):
        each = [total(body.u, forces, nodes) for nodes in faces]
        assert np.linalg.norm(each[0]) > 1e-3
        assert sum(each) == pytest.approx(np.zeros(3), abs=1e-9)
    X = body.V.tabulate_dof_coordinates()
    moved = body.u.x.array.reshape(-1, 3)
    for node in (0, 17, len(X) - 1):
        found = Probes(body.u, {"node": X[node].tolist()}).displacements()["node"]
        assert found == pytest.approx(moved[node], abs=1e-14)


# ---------------------------------------------------------------------- records


def test_old_results_are_not_taken_for_new(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of another scene under the same settings, and of another version."""
    study = load_study(write(tmp_path, GOOD))
    records = Records(study, tmp_path)
    case = cases(study)[0]
    entries = dict.fromkeys(("curve", "settings", "element", "cells", "dofs", "newton"), "1")
    records.append(case, entries | {"status": "converged", "seconds": 1.0, "memory_mb": 1.0}, {"force": 0.5})
    assert [record.values for record in Records(study, tmp_path).of(case)] == [{"force": 0.5}]
    edited = load_study(write(tmp_path, GOOD.replace("0.1, 0.0, 0.0", "0.2, 0.0, 0.0")))
    assert cases(edited)[0].curve == case.curve
    assert Records(edited, tmp_path).of(cases(edited)[0]) == []
    monkeypatch.setattr("elastune.app.scene.write.__version__", "99")
    assert Records(study, tmp_path).of(case) == []


# ---------------------------------------------------------------------- from end to end


def runs_in(path: Path, name: str) -> list[dict[str, str]]:
    """Rows of a study's table that have a value."""
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert all(row[name] for row in rows)
    return rows


def test_a_study_is_run_once(elastune: Command, tmp_path: Path) -> None:
    tutorial = '[[series]]\nlabel = "tutorial"\nsolver = "tutorial"\nset = { material.nu = 0.3 }\n'
    tutorial += "vary = { mesh.cells = [1, 2] }\n"
    text = GOOD.replace("[set]", "[set]\nsolve.quadrature = 4\nsolve.tolerance = 1e-11") + tutorial
    # The second of these nobody reaches.
    text = text.replace("[quantities", "tolerances = [0.5, 1e-14]\n[quantities", 1)
    study = write(tmp_path, text)
    first = elastune("converge", study, "--out", "here")
    assert first.returncode == 0, first.stderr
    # Three curves of two cases, and a reference for each Poisson's ratio.
    *runs, last = first.stdout.splitlines()
    assert len(runs) == 8 and last.startswith("results: ")
    written = {path.name: path for path in (tmp_path / "here").iterdir()}
    assert set(written) == {
        "cases.csv", "errors.csv", "table.md", "error-time.png", "error-memory.png", "error-size.png",
    }  # fmt: skip
    for name, path in written.items():
        assert 0 < path.stat().st_size < 200_000, name
    records = runs_in(written["cases.csv"], "force")
    # Two solvers, one discretisation.
    ours, theirs = (
        [float(r["force"]) for r in records if r["curve"] == curve] for curve in ("ours, ν = 0.3", "tutorial")
    )
    assert len(ours) == 2
    assert ours == pytest.approx(theirs, rel=1e-7)
    assert all(float(r["memory_mb"]) > 50 and float(r["seconds"]) > 0 for r in records)

    again = elastune("converge", study, "--out", "here")
    assert again.returncode == 0
    assert again.stdout.splitlines() == [last]


def test_a_study_that_changed_is_run_again(elastune: Command, tmp_path: Path) -> None:
    """The base scene under the same settings: old rows stay in the raw table and reach no other."""
    stated = "stated = [{ values = { force = 0.5 } }]"
    text = GOOD.replace('overkill = { solve.element = "Q2", mesh.cells = 2 }', stated).replace("[0.2, 0.3]", "[0.2]")
    here = tmp_path / "here"
    base = (SHIPPED / "cube-pull.toml").read_text()
    (tmp_path / "base.toml").write_text(base)
    study = write(tmp_path, text.replace('"cube-pull"', '"base.toml"'))
    forces, tables = [], []
    for modulus in (1.0, 2.0):
        (tmp_path / "base.toml").write_text(base.replace("E = 1.0", f"E = {modulus}"))
        done = elastune("converge", study, "--out", "here")
        assert done.returncode == 0, done.stderr
        assert len(done.stdout.splitlines()) == 3
        forces.append([float(row["force"]) for row in runs_in(here / "cases.csv", "force")][-2:])
        tables.append([float(row["error_force"]) for row in runs_in(here / "errors.csv", "error_force")])
    assert len(runs_in(here / "cases.csv", "force")) == 4
    assert forces[1] == pytest.approx([2 * value for value in forces[0]], rel=1e-6)
    for found, table in zip(forces, tables, strict=True):
        assert table == pytest.approx([abs(value / 0.5 - 1) for value in found])


def test_what_takes_too_long_is_given_up(elastune: Command, tmp_path: Path) -> None:
    text = GOOD.replace("[quantities", "timeout = 0.2\n[quantities", 1)
    overkill = 'overkill = { solve.element = "Q2", mesh.cells = 2 }'
    text = text.replace(overkill, "stated = [{ values = { force = 1.0 } }]")
    done = elastune("converge", write(tmp_path, text), "--out", "here")
    assert done.returncode == 0, done.stderr
    # Finer meshes than one that was given up are not tried.
    assert done.stdout.count("timeout") == 2
    assert "timeout" in (tmp_path / "here" / "table.md").read_text()


def test_ranks_agree_on_errors(elastune: Command, tmp_path: Path) -> None:
    study = """
title = "Ranks"
scene = "cube-pull"
plot = "l2"
reference = { manufactured = true }
set = { solve.steps = 1, solve.tolerance = 1e-11 }
vary = { mesh.cells = [2] }
[[series]]
label = "one"
[[series]]
label = "two"
ranks = 2
"""
    done = elastune("converge", write(tmp_path, study), "--out", "here")
    assert done.returncode == 0, done.stderr
    one, two = runs_in(tmp_path / "here" / "cases.csv", "l2")
    for name in ("energy", "volume_ratio", "l2", "h1", "stress"):
        assert float(one[name]) == pytest.approx(float(two[name]), rel=1e-8)
    refused = elastune("converge", write(tmp_path, study), ranks=2)
    assert refused.returncode == 2
    assert "ranks" in refused.stderr
