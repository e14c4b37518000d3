"""What a scene may say, as people and editors are told."""

import json
import tomllib

import jsonschema
import pytest

from elastune.app.cli.main import main
from elastune.app.scene.keys import keys, schema
from elastune.app.scene.read import SHIPPED, load, shipped

KEYS = {key.path: key for key in keys()}


@pytest.mark.parametrize("path", KEYS)
def test_every_key_says_what_it_means(path: str) -> None:
    key = KEYS[path]
    assert len(key.meaning) > 5
    assert key.unit or "number" not in key.kind


def test_the_list_is_what_scenes_are_read_by() -> None:
    """All keys of shipped scenes, and their defaults, are in it."""
    assert KEYS["solve.tolerance"].default == f"{load('cube-pull').solve.tolerance:g}"
    assert KEYS["material.name"].default == "needed"
    assert {"mesh.faces.NAME.sphere.radius", "boundary.NAME.pull.normal", "stage[].steps", "output.points"} <= set(KEYS)
    for name in shipped():
        for table, entries in tomllib.loads((SHIPPED / f"{name}.toml").read_text()).items():
            assert table in KEYS
            if table not in ("boundary", "point", "curve", "region", "stage", "title"):
                assert {f"{table}.{key}" for key in entries} <= set(KEYS)


def test_they_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes", "--keys"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(" = ")[0] for line in lines[::2]] == list(KEYS)
    assert 'solve.method = "line-search"' in lines and "    Young's modulus at rest [stress]: number" in lines
    assert main(["scenes", "--keys", "--schema"]) == 2


def test_editors_know_scenes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes", "--schema"]) == 0
    given = json.loads(capsys.readouterr().out)
    assert given == schema()
    validator = jsonschema.Draft202012Validator(given)
    validator.check_schema(given)
    for name in shipped():
        scene = tomllib.loads((SHIPPED / f"{name}.toml").read_text())
        assert not list(validator.iter_errors(scene))
        assert list(validator.iter_errors(scene | {"solver": {}}))
        assert list(validator.iter_errors(scene | {"boundary": {"left": {"fix": False}}}))
        assert list(validator.iter_errors(scene | {"mesh": {"cells": 0}}))
