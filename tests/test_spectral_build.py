"""Compiling and caching of kernels."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from elastune.forms import materials
from elastune.forms.spectral import SpectralError, build, pointwise

REST = np.zeros((1, 3, 3))
SCRIPT = """
import numpy as np
from elastune.forms import materials
from elastune.forms.spectral import pointwise
print(float(np.linalg.norm(pointwise(materials.make("arap"), np.zeros((1, 3, 3)))[2])))
"""


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of its own for one test."""
    monkeypatch.setattr(build, "_cache_folder", lambda: tmp_path / "cache")
    return tmp_path / "cache"


def test_a_cached_kernel_is_not_generated_again(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor is it when its parameters change; another energy needs a kernel of its own."""
    pointwise(materials.make("arap"), REST)
    assert len(list(empty_cache.iterdir())) == 1

    def refuse(*_: object) -> None:
        raise AssertionError("compiled again")

    monkeypatch.setattr(build, "_compile", refuse)
    pointwise(materials.make("arap", scale=7.0), REST)
    with pytest.raises(AssertionError):
        pointwise(materials.make("symmetric-arap"), REST)


def test_compiler_errors_are_one_line(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No compiler, and one that fails; neither leaves anything behind."""
    build._environment.cache_clear()
    for compiler, message in (
        ("no-such-compiler -x", "expected a C compiler"),
        ("gcc -include missing.h", "missing.h"),
    ):
        monkeypatch.setenv("CC", compiler)
        build._environment.cache_clear()
        with pytest.raises(SpectralError) as refusal:
            pointwise(materials.make("arap"), REST)
        assert message in str(refusal.value) and "\n" not in str(refusal.value)
        assert list(empty_cache.iterdir()) == []
    build._environment.cache_clear()


def test_processes_at_the_same_time(tmp_path: Path) -> None:
    """Four that ask for the same kernel at once all get it, and leave one file."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    command = [sys.executable, "-c", SCRIPT]
    runs = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(4)]
    outputs = [run.communicate(timeout=120)[0] for run in runs]
    assert [run.returncode for run in runs] == [0] * 4
    assert len(set(outputs)) == 1
    assert len(list((tmp_path / "fenics").iterdir())) == 1


RANKS = """
import sys
from pathlib import Path
from mpi4py import MPI
from elastune.forms.spectral import build
comm = MPI.COMM_WORLD

def broken():
    raise ValueError("broken\\nfor good")

build._cache_folder = lambda: Path(sys.argv[1])
try:
    build.load("pointwise.c", "no key", str if sys.argv[1].startswith("/proc") else broken, comm)
except build.SpectralError as error:
    Path(sys.argv[2], str(comm.rank)).write_text(str(error))
"""


@pytest.mark.parametrize(("folder", "said"), [("{}", "broken for good"), ("/proc/none/deep", "cannot be written")])
def test_what_fails_on_one_rank_is_raised_on_all(folder: str, said: str, tmp_path: Path) -> None:
    command = ["mpirun", "-n", "2", sys.executable, "-c", RANKS, folder.format(tmp_path / "cache"), str(tmp_path)]
    subprocess.run(command, timeout=60, check=True)
    told = {name: (tmp_path / name).read_text() for name in ("0", "1")}
    assert told["0"] == told["1"]
    assert said in told["0"] and "\n" not in told["0"]


def test_folder_that_cannot_be_written_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build, "_cache_folder", lambda: Path("/proc/none"))
    with pytest.raises(SpectralError) as refusal:
        pointwise(materials.make("arap"), REST)
    assert "/proc/none: " in str(refusal.value) and "\n" not in str(refusal.value)
