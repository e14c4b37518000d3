"""What a newcomer meets first: the start page, mistakes, pipes, an environment without FEniCSx, doctor and clean."""

import os
import pty
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import own_lines

from elastune.app.cli import needs
from elastune.app.errors import UserError
from elastune.app.results.fields import CELL_FIELDS
from elastune.app.results.record import Failure, Record, Summary
from elastune.app.scene.read import SHIPPED

ROOT = Path(__file__).parents[1]
Run = Callable[..., subprocess.CompletedProcess[str]]
SMALL = ["--set", "mesh.cells=2", "--set", "solve.steps=1", "--set", "output.picture=false"]
ESCAPE = "\x1b"


def one_line(done: subprocess.CompletedProcess[str]) -> str:
    """The only line of a command that refused."""
    own = own_lines(done.stderr)
    assert done.returncode == 2 and len(own) == 1 and own[0].startswith("elastune: "), done.stderr
    return own[0].removeprefix("elastune: ")


# ---------------------------------------------------------------- names
FILES: dict[str, tuple[str, bytes | None, str]] = {
    "empty": ("empty.toml", b"", "is empty; expected a scene"),
    "blank": ("blank.toml", b" \n\n", "is empty; expected a scene"),
    "folder": ("folder", None, "is a folder; did you mean folder/scene.toml?"),
    "binary": ("image", b"\x89PNG\r\n\x00\x01", "is a binary file"),
    "latin": ("latin.toml", "title = 'Würfel'".encode("latin-1"), "is no text in UTF-8"),
    "mesh by its end": ("part.stl", b"solid x", "part.stl is a mesh: name it in [mesh] path"),
    "mesh by its beginning": ("part.toml", b"$MeshFormat\n4.1 0 8\n", "is a mesh: name it in [mesh] path"),
    "drawing": ("part.step", b"ISO-10303-21;", "is a drawing: mesh it (gmsh -3 part.step)"),
    "no TOML": ("prose.toml", b"Dear Elastune", "not TOML"),
    "not there": ("cube-pul.toml", None, "did you mean cube-pull.toml?"),
}


@pytest.mark.parametrize("name", FILES)
def test_files_that_are_no_scenes(name: str, elastune: Run, tmp_path: Path) -> None:
    file, content, said = FILES[name]
    (tmp_path / "cube-pull.toml").touch()
    if name == "folder":
        (tmp_path / file).mkdir()
        (tmp_path / file / "scene.toml").touch()
    elif content is not None:
        (tmp_path / file).write_bytes(content)
    assert said in one_line(elastune("run", file, ranks=2 if name == "empty" else 1)).replace(f"{file}: ", f"{file} ")
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize("name", ["-h.toml", "two  words.toml", "κύβος.toml"])
def test_scenes_of_any_name(name: str, elastune: Run, tmp_path: Path) -> None:
    shutil.copy(SHIPPED / "cube-pull.toml", tmp_path / name)
    done = elastune("run", name, *SMALL)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "results" / Path(name).stem / "summary.json").is_file()


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["rnu", "cube-pull"], "run"),
        (["run", "cube-twits"], "cube-twist"),
        (["materials", "neo-hokean"], "neo-hookean"),
        (["bench", "twst"], "twist"),
        (["run", "cube-pull", "--set", "solve.stps=3"], "steps"),
        (["run", "cube-pull", "--set", "boundary.rigth={fix=true}"], "right"),
        (["run", "cube-pull", "--set", "output.fields=['von_mieses']"], "von_mises"),
        (["run", "cube-pull", "--set", "solve.element=Q2-P1"], "Q2-P1d"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_did_you_mean(words: list[str], meant: str, ranks: int, elastune: Run) -> None:
    if ranks > 1 and words[0] == "run" and "--set" in words[:-2]:
        pytest.skip("told in the same way")
    assert f"did you mean {meant}" in one_line(elastune(*words, ranks=ranks))


# ---------------------------------------------------------------- the first page, and what is where
@pytest.mark.parametrize("ranks", [1, 2])
def test_start_page(ranks: int, elastune: Run) -> None:
    done = elastune(ranks=ranks)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count("elastune run cube-pull") == 1
    assert "results/SCENE" in done.stdout and str(ROOT.resolve() / "README.md") in done.stdout
    for command in re.findall(r"^  elastune (\w+ ?[\w-]*)  ", done.stdout, re.MULTILINE):
        small = SMALL if command.startswith("run") else []
        assert ranks > 1 or elastune(*command.split(), *small).returncode == 0


def test_every_key_column_and_field_is_documented() -> None:
    text = (ROOT / "results/README.md").read_text()
    assert "(results/README.md)" in (ROOT / "README.md").read_text()
    first = re.findall(r"^\| (`[^|]*) \|", text, re.MULTILINE)
    rows = {name for cell in first for name in re.findall(r"`(\w+)`", cell)}
    assert rows >= {*Summary.__dataclass_fields__, *Failure.__dataclass_fields__, "displacement", *CELL_FIELDS}
    assert rows >= {name for name in Record.__dataclass_fields__ if name not in ("reaction", "moment")} | {
        "reaction_FACE_x",
        "moment_FACE_x",
    }


# ---------------------------------------------------------------- pipes, colours, narrow terminals
def on_terminal(words: list[str], folder: Path, **environment: str) -> str:
    """What a command writes on a terminal of 40 columns."""
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "elastune", *words]
    env = {**os.environ, "COLUMNS": "40", "TERM": "xterm", **environment}
    with subprocess.Popen(command, cwd=folder, env=env, stdout=slave, stderr=slave):
        os.close(slave)
        text = b""
        while True:
            try:
                text += (part := os.read(master, 1 << 16))
            except OSError:
                break
            if not part:
                break
    os.close(master)
    return text.decode()


@pytest.mark.parametrize("words", [["run", "cube-pull", *SMALL], ["materials"], ["materials", "fung"], ["--help"]])
def test_plain_where_it_has_to_be(
    words: list[str], elastune: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a pipe, under a launcher, whose pipe looks like a terminal, and without colours; unbroken in any pipe."""
    done = elastune(*words)
    launched = subprocess.run(
        ["mpirun", "-n", "1", sys.executable, "-m", "elastune", *words], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.stderr == launched.stderr == ""
    texts = [done.stdout, launched.stdout]
    texts += [on_terminal(words, tmp_path, **{key: value}) for key, value in (("NO_COLOR", "1"), ("TERM", "dumb"))]
    assert not any(ESCAPE in text for text in texts)
    if words[0] != "--help":
        numbers = re.compile(r"\d\.\d\d s|\d+\.\d+ s;")
        assert numbers.sub("", done.stdout) == numbers.sub("", launched.stdout)
    if words[0] == "materials":
        assert ESCAPE in on_terminal(words, tmp_path)
        assert max(len(line.rstrip()) for line in texts[2].splitlines()) <= 40
        monkeypatch.setenv("COLUMNS", "40")
        assert elastune(*words).stdout == done.stdout


# ---------------------------------------------------------------- without FEniCSx
HIDE = """
import os, sys
class Hide:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in os.environ["HIDDEN"].split(","):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Hide())
"""
ALL = "dolfinx,slepc4py,petsc4py,mpi4py,ffcx,basix,gmsh,pyvista"


@pytest.mark.parametrize(
    ("hidden", "words", "said"),
    [
        (ALL, ["scenes"], ""),
        (ALL, ["materials"], ""),
        (ALL, ["--help"], ""),
        (ALL, [], ""),
        (ALL, ["converge"], ""),
        (ALL, ["run", "cube-pull"], "expected dolfinx >= 0.9"),
        (ALL, ["stress"], "conda-forge"),
        (ALL, ["converge", "mms"], "./run elastune"),
        (ALL, ["bench", "stretch"], "conda-forge"),
        ("slepc4py", ["run", "cube-pull"], "slepc4py"),
        ("gmsh", ["run", "cube-pull"], "gmsh is missing"),
        ("pydantic", ["scenes"], "pydantic is missing: pip install pydantic"),
        ("rich", ["materials"], "rich is missing: pip install rich"),
    ],
)
def test_without(hidden: str, words: list[str], said: str, elastune: Run, tmp_path: Path) -> None:
    (tmp_path / "site").mkdir()
    (tmp_path / "site/sitecustomize.py").write_text(HIDE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", f"{tmp_path / 'site'}:{os.environ.get('PYTHONPATH', '')}")
        patch.setenv("HIDDEN", hidden)
        done = elastune(*words)
        if said:
            assert said in one_line(done)
            assert not (tmp_path / "results").exists()
        else:
            assert (done.returncode, done.stderr) == (0, "")
    if hidden == "slepc4py":
        # On two ranks, where mpirun needs the others.
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("PYTHONPATH", f"{tmp_path / 'site'}:{os.environ.get('PYTHONPATH', '')}")
            patch.setenv("HIDDEN", hidden)
            assert said in one_line(elastune(*words, ranks=2))


def test_dolfinx_too_old_and_petsc_complex(monkeypatch: pytest.MonkeyPatch) -> None:
    import dolfinx
    from petsc4py import PETSc

    needs.usable()
    with monkeypatch.context() as patch:
        patch.setattr(dolfinx, "__version__", "0.8.0")
        with pytest.raises(UserError, match=r"found dolfinx 0\.8\.0; expected dolfinx >= 0\.9"):
            needs.usable()
    monkeypatch.setattr(PETSc, "ScalarType", np.complex128)
    with pytest.raises(UserError, match="complex numbers; expected dolfinx"):
        needs.usable()


# ---------------------------------------------------------------- doctor and clean
@pytest.mark.parametrize("ranks", [1, 2])
def test_doctor(ranks: int, elastune: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    done = elastune("doctor", ranks=ranks)
    assert (done.returncode, done.stderr) == (0, "")
    found = dict(re.findall(r"^(\S+) +(\S.*)$", done.stdout, re.MULTILINE))
    assert {"dolfinx", "PETSc", "SLEPc", "MPI", "cores", "bandwidth", "compiler", "kernels"} <= set(found)
    assert found["MPI"].endswith(f"; {ranks} here") and "with MUMPS" in found["PETSc"]
    assert 0.5 < float(found["bandwidth"].split()[0]) < 5000
    if "openblas" in found.get("BLAS", "") and os.cpu_count() != 1:
        assert "export OPENBLAS_NUM_THREADS=1" in done.stdout


def test_clean(elastune: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels, and roots that no checkout uses; a root of this checkout, made as `run` does, stays."""
    cache, kernels = tmp_path / "roots", tmp_path / "cache/fenics"
    monkeypatch.setenv("ELASTUNE_CACHE", str(cache))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    kernels.mkdir(parents=True)
    for name in ("libffcx_forms_1.c", "libelastune_element_1.so", "somebody_else.so"):
        (kernels / name).write_bytes(b"1" * 10)
    (cache / "path/1").mkdir(parents=True)
    (cache / "path/1/elastune").symlink_to(ROOT)
    script = (ROOT / "run").read_text()
    lines = re.findall(r"^(?:packages|key)=.*$", script, re.MULTILINE)
    key = subprocess.run(
        ["bash", "-c", "\n".join([f"here={ROOT}; release=trixie", *lines, "echo $key"])], capture_output=True, text=True
    ).stdout.strip()
    ours, old = cache / f"trixie-{key}", cache / "trixie-0123456789ab"
    for root in (ours, old):
        (root / "usr").mkdir(parents=True)
    assert "1 kernels whose compilation was killed" in elastune("doctor").stdout
    for pretend in (True, False):
        done = elastune("clean", *(["--dry-run"] if pretend else []))
        assert (done.returncode, done.stderr) == (0, "")
        assert str(kernels) in done.stdout and old.name in done.stdout and ours.name not in done.stdout
        assert old.exists() == (kernels / "libffcx_forms_1.c").exists() == pretend
    assert "expected one process" in one_line(elastune("clean", ranks=2))
    assert ours.exists() and [path.name for path in kernels.iterdir()] == ["somebody_else.so"]


def test_a_lock_that_was_left_is_told(elastune: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a compilation that was killed: with the way to mend it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert elastune("run", "cube-pull", *SMALL).returncode == 0
    for path in (tmp_path / "cache/fenics").glob("*.c.cached"):
        path.unlink()
    assert "elastune clean" in one_line(elastune("run", "cube-pull", *SMALL))
