"""Whole commands as a person gives them: shipped scenes, the README, second runs, several ranks."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from elastune.app.scene.read import load, shipped
from elastune.forms.energy import CATALOGUE

ROOT = Path(__file__).parents[1]
Run = Callable[..., subprocess.CompletedProcess[str]]

# Keys of the contract: scripts rely on them.
SUMMARY = {
    "scene", "status", "failure", "material", "element", "cells", "dofs", "ranks", "steps", "wall_s",
    "peak_memory_mb", "versions",
}  # fmt: skip
STEP = {
    "load", "energy", "reaction", "volume_ratio", "min_J", "newton_iterations", "linear_iterations", "wall_s",
}  # fmt: skip
MATERIAL = {"name", "parameters", "E", "nu", "alpha"}
FILES = {"scene.toml", "summary.json", "history.csv", "fields.xdmf", "fields", "curve.png", "deformed.png"}

# Settings that make a shipped scene small enough for a test.
COARSE = {"cylinder-stretch": ["mesh.cells=4", "solve.steps=4"], "cantilever": ["mesh.cells=[3,1,1]", "solve.steps=2"]}


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", shipped())
def test_shipped_scene_runs(name: str, ranks: int, solved: Callable[..., Any]) -> None:
    summary = solved(name, *COARSE.get(name, ["mesh.cells=4", "solve.steps=2"]), ranks=ranks)
    assert summary["status"] == "converged", summary["failure"]
    assert set(summary) >= SUMMARY
    assert set(summary["material"]) >= MATERIAL
    assert all(set(step) >= STEP for step in summary["steps"])
    assert summary["ranks"] == ranks
    assert summary["steps"][-1]["load"] == len(load(name).ends)


def _blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)


def test_first_command_of_the_readme(elastune: Run, tmp_path: Path) -> None:
    command, test = _blocks("sh")[0].splitlines()
    assert (command, test) == ("./run elastune run cube-pull", "./run pytest")
    assert "./run pytest" in (ROOT / ".ci/run").read_text().splitlines()
    done = elastune(*command.split()[2:])
    assert (done.returncode, done.stderr) == (0, "")
    folder = tmp_path / "results/cube-pull"
    assert {path.name for path in folder.iterdir()} == FILES
    for line in done.stdout.splitlines():
        assert len(line) < 120
    for name in ("curve.png", "deformed.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")


def test_scene_of_the_readme(elastune: Run, tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(_blocks("toml")[0])
    command = re.search(r"`\./run elastune (run scene\.toml [^`]*)`", (ROOT / "README.md").read_text())
    assert command is not None
    done = elastune(*command[1].split(), "--set", "mesh.cells=3", "--set", "output.picture=false")
    assert (done.returncode, done.stderr) == (0, "")
    summary = json.loads((tmp_path / "folder/summary.json").read_text())
    assert summary["material"]["alpha"] == 0.5


def test_materials_of_the_readme() -> None:
    rows = re.findall(r"^\| ([a-z-]+) \| ψ = ", (ROOT / "README.md").read_text(), re.MULTILINE)
    assert rows == list(CATALOGUE)


def test_every_other_command_of_the_readme(elastune: Run) -> None:
    commands = set(re.findall(r"`\./run elastune ((?:scenes|materials)[^`]*)`", (ROOT / "README.md").read_text()))
    assert commands
    for command in commands:
        done = elastune(*command.replace("NAME", "stable-neo-hookean").split())
        assert (done.returncode, done.stderr) == (0, ""), command


def test_a_second_run_compiles_nothing(elastune: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    words = ["run", "cube-pull", "--set", "mesh.cells=2", "--set", "output.picture=false", "--out", tmp_path / "out"]

    def compiled() -> set[str]:
        return {path.name for path in (tmp_path / "cache").rglob("*.so")}

    elastune(*words, "--set", "material.alpha=1.5")
    first = compiled()
    assert first
    for override in ("material.alpha=0.7", "material.E=7.0", "material.nu=0.4", "mesh.cells=3"):
        alpha = [] if "alpha" in override else ["--set", "material.alpha=1.5"]
        assert elastune(*words, *alpha, "--set", override).returncode == 0
        assert compiled() == first, override


def test_petsc_options_reach_snes(elastune: Run, tmp_path: Path) -> None:
    words = ["run", "cube-pull", "--set", "mesh.cells=2", "--set", "output.picture=false", "--out", tmp_path / "out"]
    done = elastune(*words, "--", "-snes_monitor")
    assert done.returncode == 0
    assert "SNES Function norm" in done.stdout
    other = elastune(*words, "--", "-snes_type", "newtonls", "-snes_rtol", "1e-9")
    assert other.returncode == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["rnu"], "did you mean run?"),
        (["run"], "scene"),
        (["run", "cube-pull", "--sett", "a=1"], "--sett"),
        (["run", "none.toml"], "none.toml"),
        (["materials", "neohookean"], "neo-hookean"),
        (["materials", "--nu", "0.5"], "0.5"),
        (["materials", "--E", "soft"], "soft"),
        (["scenes", "--", "-snes_monitor"], "PETSc"),
        (["bench"], "name"),
        (["bench", "twist", "--quick"], "--quick"),
        (["bench", "stretch", "--out", "/proc/none"], "/proc/none"),
        (["stress", "--material", "steel"], "steel"),
        (["stress", "--limit", "-1"], "-1"),
        (["stress", "--limit", "long"], "long"),
        (["stress", "--out", "/proc/none"], "/proc/none"),
        (["converge", "cube-pull", "--out", "/proc/none"], "/proc/none"),
    ],
)
def test_bad_command_line(words: list[str], said: str, elastune: Run) -> None:
    done = elastune(*words)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert said in done.stderr


def test_bad_scene_on_two_ranks_is_told_once(elastune: Run, tmp_path: Path) -> None:
    done = elastune("run", "cube-pul", ranks=2)
    assert done.returncode == 2
    assert done.stderr.count("did you mean cube-pull?") == 1


def test_help_imports_nothing_heavy() -> None:
    script = "from elastune.app.cli.main import main\nimport sys\ntry: main(['--help'])\nexcept SystemExit: pass\n"
    script += (
        "assert not {'dolfinx', 'ufl', 'numpy', 'pydantic', 'rich', 'mpi4py'} & set(sys.modules), sys.modules.keys()"
    )
    subprocess.run(["python3", "-c", script], check=True, capture_output=True, env={**os.environ})


def test_python_of_the_readme(tmp_path: Path) -> None:
    """As a script, in an empty folder."""
    (tmp_path / "script.py").write_text(_blocks("python")[0])
    done = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert len(done.stdout.splitlines()) == 10
    assert (tmp_path / "curve.png").read_bytes().startswith(b"\x89PNG")


def test_a_run_is_repeated_from_its_folder(elastune: Run, tmp_path: Path) -> None:
    """To the last bit, also into the folder itself."""
    settings = ["mesh.cells=3", "solve.steps=2", "material.alpha=1.3", "output.picture=false"]
    elastune("run", "cube-pull", *[word for setting in settings for word in ("--set", setting)], "--out", "one")
    one = json.loads((tmp_path / "one/summary.json").read_text())
    for out in ("two", "one"):
        assert elastune("run", "one/scene.toml", "--out", out).returncode == 0
        again = json.loads((tmp_path / out / "summary.json").read_text())
        assert again["scene"] == "cube-pull"
        for a, b in zip(one["steps"], again["steps"], strict=True):
            assert {k: v for k, v in a.items() if k != "wall_s"} == {k: v for k, v in b.items() if k != "wall_s"}


def test_petsc_options_are_there_before_petsc_starts(elastune: Run, tmp_path: Path) -> None:
    """PETSc reads some only then, and complains at its end of those that came later."""
    words = ["run", "cube-pull", "--set", "mesh.cells=2", "--set", "output.picture=false", "--out", tmp_path / "out"]
    done = elastune(*words, "--", "-log_view")
    assert (done.returncode, done.stderr) == (0, "")
    assert "MatMult" in done.stdout or "KSPSolve" in done.stdout
    plain = elastune(*words, "--", "-snes_type", "newtonls")
    assert (plain.returncode, plain.stderr) == (0, "")
