"""Tables that are wrong, of studies too: one line with the key, and what was expected."""

from pathlib import Path
from typing import Any

import pytest

from elastune.app.errors import SceneError, UserError
from elastune.app.scene.override import assign, override
from elastune.app.studies import cases as study_cases
from elastune.app.studies.schema import StudyError, load_study

STUDY = """
title = "t"
scene = "cube-pull"
plot = "energy"
[reference]
overkill = { mesh.cells = 8 }
[quantities.tip]
at = [1.0, 1.0, 1.0]
along = "x"
[[series]]
label = "a"
[vary]
mesh.cells = [1, 2]
"""

# What is replaced in the good study, by what, and what the line says.
BROKEN = {
    "unknown key": ('label = "a"', 'lable = "a"', "series.0.lable: unknown key; did you mean label?"),
    "unknown table": ("[vary]", "[varied]", "varied: unknown key; did you mean vary?"),
    "unknown for missing": ('plot = "energy"', 'plots = "energy"', "plots: unknown key; did you mean plot?"),
    "missing": ('plot = "energy"\n', "", "plot: missing; every study needs it"),
    "missing in a table": (
        "overkill = { mesh.cells = 8 }",
        "stated = [{ where = {} }]",
        "reference.stated.0.values: missing; every stated needs it",
    ),
    "of a table of tables": ('along = "x"', 'alonk = "x"', "quantities.tip.alonk: unknown key; did you mean along?"),
    "value": ('along = "x"', 'along = "w"', "quantities.tip.along = 'w': expected one of x, y, z"),
    "rule": ('along = "x"', "", "quantities.tip: expected one of along and about"),
    "of a union": ('scene = "cube-pull"', "scene = 3", "scene = 3: input should be a valid string"),
    "no table": ('plot = "energy"', 'plot = "energy"\nset = 1', "set = 1: expected a table of keys"),
    "too short": ("at = [1.0, 1.0, 1.0]", "at = [1.0]", "quantities.tip.at = [1.0]: list should have at least 2"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_study_gives_one_line(name: str, tmp_path: Path) -> None:
    old, new, said = BROKEN[name]
    assert old in STUDY
    path = tmp_path / "study.toml"
    path.write_text(STUDY)
    assert load_study(str(path)).title == "t"
    path.write_text(STUDY.replace(old, new, 1))
    with pytest.raises(StudyError) as caught:
        load_study(str(path))
    assert str(caught.value).startswith(f"study.toml: {said}")
    assert "\n" not in str(caught.value)


def test_case_that_sets_a_key_within_a_value(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(STUDY.replace("mesh.cells = [1, 2]", "material.name.first = [1, 2]"))
    with pytest.raises(UserError, match=r"material.name.first: name is not a table \(case material.name.first = 1"):
        study_cases.cases(load_study(str(path)))


def test_assign_makes_tables_on_the_way() -> None:
    data: dict[str, Any] = {"mesh": {"cells": 2}}
    assign(data, "mesh.grade.left", 0.5)
    assign(data, "solve.steps", 3)
    assign(data, "title", "t")
    override(data, " mesh . cells = [1, 2]")
    assert data == {"mesh": {"cells": [1, 2], "grade": {"left": 0.5}}, "solve": {"steps": 3}, "title": "t"}
    with pytest.raises(
        SceneError, match=r"--set title.x.y=1: title is not a table|--set title.x.y: title is not a table"
    ):
        override(data, "title.x.y=1")
