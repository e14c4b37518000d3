"""A run leaves the scene that repeats it, and a scene has a key of what it computes."""

import json
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI

from elastune.app.run import run
from elastune.app.scene import write
from elastune.app.scene.read import load, parse, shipped
from elastune.app.scene.schema import Scene
from elastune.app.scene.write import digest, text
from elastune.app.studies import schema as studies

COOK = Path(studies.__file__).parent / "shipped" / "cook.msh"
COARSE = ["mesh.cells=4", "solve.steps=2", "output.picture=false"]

Tables = dict[str, Any]


def cook(path: Path, **mesh: Any) -> Tables:
    """Cook's membrane on a mesh file."""
    return {
        "title": 'Cook\'s "membrane", ν = 0.45',
        "mesh": {"shape": "file", "path": str(path), **mesh},
        "solve": {"steps": 2},
        "material": {"name": "neo-hookean", "E": 240.565, "nu": 0.45},
        "boundary": {"left": {"fix": True}, "right": {"pull": [0.0, 6.25]}},
        "output": {"picture": False},
    }


def again(scene: Scene, element: str | None = None) -> Scene:
    """The scene as `elastune run` reads what a run has left."""
    return parse(tomllib.loads(text(scene, element)), Path("results/x/scene.toml"))


def numbers(folder: Path) -> tuple[Any, ...]:
    """What is computed, without what is measured by the clock."""
    summary = json.loads((folder / "summary.json").read_text())
    steps = [{name: value for name, value in step.items() if name != "wall_s"} for step in summary["steps"]]
    return summary["scene"], summary["status"], summary["material"], summary["element"], steps


@pytest.mark.parametrize("name", shipped())
def test_shipped_scene_is_written_and_read_again(name: str) -> None:
    scene = load(name)
    found = again(scene, scene.element)
    assert (found.name, found.title) == (name, scene.title)
    assert found.solve.element == scene.element != "auto"
    assert found.mesh.cell == scene.cell
    assert (found.boundary, found.material, found.start, found.output) == (
        scene.boundary, scene.material, scene.start, scene.output,
    )  # fmt: skip
    assert text(found) == text(scene, scene.element)
    # Every key is there but those that have no default.
    tables = tomllib.loads(text(scene))
    for section in ("mesh", "solve", "output", "material"):
        given = getattr(scene, section)
        wanted = {key for key in type(given).model_fields if getattr(given, key) is not None}
        assert set(tables[section]) >= wanted
    assert all(condition.kinds for condition in found.boundary.values())


def test_mesh_file_is_found_from_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "deep").mkdir()
    shutil.copy(COOK, tmp_path / "cook.msh")
    monkeypatch.chdir(tmp_path)
    scene = parse(cook(Path("../cook.msh"), cell="triangle"), Path("deep/cook.toml"))
    mesh = tomllib.loads(text(scene))["mesh"]
    assert mesh["path"] == str(tmp_path / "cook.msh")
    assert "cell" not in mesh


@pytest.mark.parametrize("same", [True, False])
@pytest.mark.parametrize("mesh", ["cube", "file"])
def test_run_is_repeated_to_the_last_bit(
    mesh: str, same: bool, tmp_path: Path, elastune: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
    folder = tmp_path / "first"
    if mesh == "cube":
        scene = load("cube-twist", [*COARSE, "material.alpha=0.7", "title=A twist"])
    else:
        shutil.copy(COOK, tmp_path / "cook.msh")
        scene = parse(cook(Path("cook.msh"), refine=1), tmp_path / "cook.toml")
    run(scene, folder, MPI.COMM_SELF)
    before, kept = numbers(folder), (folder / "scene.toml").read_text()
    assert before[1] == "converged"
    out = folder if same else tmp_path / "second"
    done = elastune("run", folder / "scene.toml", "--out", out)
    assert (done.returncode, done.stderr) == (0, "")
    assert numbers(out) == before
    assert (out / "scene.toml").read_text() == kept
    assert tomllib.loads(kept)["title"] == scene.title


def test_settings_of_the_command_line_are_in_the_scene(
    tmp_path: Path, elastune: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
    settings = [word for setting in (*COARSE, "material.nu=0.499", "solve.element=auto") for word in ("--set", setting)]
    assert elastune("run", "cube-pull", *settings).returncode == 0
    tables = tomllib.loads((tmp_path / "results/cube-pull/scene.toml").read_text())
    assert tables["name"] == "cube-pull"
    assert (tables["material"]["nu"], tables["mesh"]["cells"]) == (0.499, 4)
    assert tables["solve"]["element"] == "Q2-P1d"
    before = numbers(tmp_path / "results/cube-pull")
    # Without --out, in the folder that the scene's name says: its own.
    assert elastune("run", "results/cube-pull/scene.toml").returncode == 0
    assert numbers(tmp_path / "results/cube-pull") == before


def test_scene_of_a_person_is_not_lost(
    tmp_path: Path, elastune: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
    own = "# Mine.\n" + text(load("cube-pull", COARSE))
    (tmp_path / "scene.toml").write_text(own)
    done = elastune("run", "scene.toml", "--out", ".")
    assert done.returncode == 2
    assert "scene.toml" in done.stderr and len(done.stderr.splitlines()) == 1
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"scene.toml": own}


# ---------------------------------------------------------------- the key


def test_key_changes_with_what_is_computed_only() -> None:
    base = load("cube-pull")
    same = [
        load("cube-pull", ["title=Another", "output.picture=false", 'output.fields=["J"]']),
        load("cube-pull", ["mesh.cell=hexahedron", "solve.tolerance=1e-8", "name=other"]),
        again(base),
    ]
    assert {digest(scene) for scene in same} == {digest(base)}
    others = ["mesh.cells=7", "solve.tolerance=1e-9", "material.nu=0.31", "solve.element=Q2", "material.alpha=1.0001"]
    keys = {digest(load("cube-pull", [setting])) for setting in others}
    assert len({digest(base), *keys}) == 1 + len(others)


def test_key_knows_the_mesh_by_its_content(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    for path in (tmp_path / "a.msh", tmp_path / "elsewhere" / "b.msh"):
        shutil.copy(COOK, path)
    scenes = [parse(cook(path), Path("x.toml")) for path in (tmp_path / "a.msh", tmp_path / "elsewhere" / "b.msh")]
    first, second = map(digest, scenes)
    assert first == second
    (tmp_path / "a.msh").write_text(COOK.read_text() + "\n")
    assert digest(scenes[0]) != second


def test_key_is_the_same_in_any_order_and_process(monkeypatch: pytest.MonkeyPatch) -> None:
    tables = cook(COOK)
    turned = {key: dict(reversed(value.items())) if isinstance(value, dict) else value for key, value in tables.items()}
    turned = dict(reversed(turned.items()))
    key = digest(parse(tables, Path("x.toml")))
    assert digest(parse(turned, Path("x.toml"))) == key
    script = "import json, sys; from pathlib import Path; from elastune.app.scene.read import parse;"
    script += (
        "from elastune.app.scene.write import digest; print(digest(parse(json.loads(sys.argv[1]), Path('y.toml'))))"
    )
    for seed in ("1", "2"):
        monkeypatch.setenv("PYTHONHASHSEED", seed)
        command = [sys.executable, "-c", script, json.dumps(turned)]
        assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip() == key
    monkeypatch.setattr(write, "__version__", "0.0.0")
    assert digest(parse(tables, Path("x.toml"))) != key
