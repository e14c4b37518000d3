"""Signals at any moment of a command, on one rank and on two: one line, a status that tells, whole files."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as xml
from pathlib import Path

import h5py
import pytest
from conftest import own_lines

STATUS = {signal.SIGINT: 130, signal.SIGTERM: 143}
SCENE = ["run", "cube-twist", "--set", "mesh.cells=8", "--set", "solve.steps=10"]
# Ten moments of a run on each number of ranks, of its share of the time without a signal.
MOMENTS = [0.04, 0.12, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.82, 0.93]
MIXED = [*SCENE, "--set", "solve.element=Q2-P1d", "--set", "material.nu=0.5"]
HUGE = ["run", "cube-twist", "--set", "mesh.cells=26", "--set", "solve.linear=direct", "--set", "output.picture=false"]


class Command:
    """A command that is running."""

    def __init__(self, folder: Path, *words: str, ranks: int = 1, **environment: str) -> None:
        launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        self.process = subprocess.Popen(
            [*launcher, sys.executable, "-m", "elastune", *words],
            cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, **environment},
        )  # fmt: skip

    def ended(self) -> tuple[int, float, list[str]]:
        """Its status, the seconds that it took from here on, and its own lines on standard error."""
        began = time.monotonic()
        _, errors = self.process.communicate(timeout=120)
        return self.process.returncode, time.monotonic() - began, own_lines(errors)


def check_whole(folder: Path) -> dict[str, object]:
    """The files of a run are whole and agree; its summary."""
    summary = json.loads((folder / "summary.json").read_text())
    rows = list(csv.DictReader((folder / "history.csv").open()))
    assert [float(row["load"]) for row in rows] == [step["load"] for step in summary["steps"]]
    grids = list(xml.parse(folder / "fields.xdmf").iter("Time"))
    assert len(grids) == 1 + len(rows)
    for path in (folder / "fields").iterdir():
        with h5py.File(path) as file:
            assert all(data[()].size for data in file.values())
    for picture in folder.glob("*.png"):
        assert picture.read_bytes()[-8:-4] == b"IEND"
    assert not list(folder.glob(".*.part"))
    return summary


@pytest.mark.parametrize(("ranks", "number"), [(1, signal.SIGINT), (2, signal.SIGTERM)])
def test_a_run_at_any_moment(ranks: int, number: signal.Signals, tmp_path: Path) -> None:
    began = time.monotonic()
    assert Command(tmp_path, *SCENE, ranks=ranks).ended()[0] == 0
    whole = time.monotonic() - began
    seen = set()
    for moment in MOMENTS:
        out = f"out-{moment}"
        command = Command(tmp_path, *SCENE, "--out", out, ranks=ranks)
        time.sleep(moment * whole)
        command.process.send_signal(number)
        status, seconds, lines = command.ended()
        # Two seconds on a machine that does nothing else; drawing is most of them.
        assert seconds < max(10, 2 * whole)
        if status == 0:
            assert check_whole(tmp_path / out)["status"] == "converged"
            continue
        if not lines:
            # Of the interpreter, before the command has begun to listen.
            assert moment < 0.1 and status in (-number, STATUS[number])
            continue
        assert status == STATUS[number], lines
        assert lines[0].startswith("elastune: interrupted") and set(lines) == {lines[0]}
        if not (tmp_path / out).exists():
            assert lines[0] == "elastune: interrupted: nothing was written"
            seen.add("before")
            continue
        summary = check_whole(tmp_path / out)
        assert summary["status"] == "interrupted"
        reached = summary["steps"][-1]["load"] if summary["steps"] else 0
        load = summary["failure"]["load"]
        assert lines[0] == f"elastune: interrupted at load {load:.4g}; results up to load {reached:.4g} in {out}"
        seen.add("solving" if reached < 1 else "drawing")
        if reached < 1:
            assert {"curve.png", "deformed.png"} <= {path.name for path in (tmp_path / out).iterdir()}
    assert {"before", "solving"} <= seen


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_second_signal_ends_at_once(ranks: int, tmp_path: Path) -> None:
    """Also in the middle of a factorisation; two at the same time are one, as `timeout` sends them."""
    command = Command(tmp_path, *HUGE, ranks=ranks)
    for _ in range(600):
        time.sleep(0.1)
        if (tmp_path / "results/cube-twist/fields.xdmf").exists():
            break
    time.sleep(1)
    command.process.send_signal(signal.SIGINT)
    command.process.send_signal(signal.SIGINT)
    time.sleep(0.5)
    assert command.process.poll() in (None, 130)
    command.process.send_signal(signal.SIGINT)
    status, seconds, _ = command.ended()
    assert status in (130, -signal.SIGKILL) and seconds < 2


@pytest.mark.parametrize(
    ("words", "ranks"),
    [(MIXED, 1), (MIXED, 2), (["converge", "mms"], 1), (["stress"], 2)],
    ids=["run", "2", "study", "stress"],
)
def test_a_compilation_leaves_no_lock(words: list[str], ranks: int, tmp_path: Path) -> None:
    """A lock that stays makes the next run wait, and fail."""
    kernels = tmp_path / "cache/fenics"
    command = Command(tmp_path, *words, ranks=ranks, XDG_CACHE_HOME=str(tmp_path / "cache"))
    for _ in range(3000):
        time.sleep(0.02)
        if any(not Path(f"{path}.cached").exists() for path in kernels.glob("*.c")):
            break
    command.process.send_signal(signal.SIGTERM)
    status, seconds, lines = command.ended()
    assert status == 143 and seconds < 10
    assert len(set(lines)) == 1 and lines[0].startswith("elastune: interrupted: "), lines
    assert [path for path in kernels.glob("*.c") if not Path(f"{path}.cached").exists()] == []
    assert not list(kernels.glob(".elastune-*"))


@pytest.mark.parametrize(
    ("words", "ranks", "moments"),
    [
        (["converge", "mms"], 1, [3]),
        (["stress"], 2, [3]),
        (["bench", "twist"], 1, [3]),
        # It may be over within half a second, or not have begun to listen.
        (["materials", "fung"], 2, [0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.2]),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else str(value),
)
def test_every_command(words: list[str], ranks: int, moments: list[float], tmp_path: Path) -> None:
    statuses = []
    for moment in moments:
        command = Command(tmp_path, *words, ranks=ranks)
        time.sleep(moment)
        command.process.send_signal(signal.SIGINT)
        status, seconds, lines = command.ended()
        assert seconds < 10
        if lines:
            statuses.append(status)
            assert len(set(lines)) == 1 and lines[0].startswith("elastune: interrupted"), lines
    assert statuses and set(statuses) == {130}
    for table in tmp_path.rglob("*.csv"):
        assert table.read_bytes().endswith(b"\n")


NOTEBOOK = """
import elastune, os, signal, threading
run = elastune.solve(elastune.scene("cube-twist", {"mesh.cells": 10, "solve.steps": 40}))
threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    for record in run:
        pass
except KeyboardInterrupt:
    print("stopped", len(run.summary.steps) < 40)
"""


def test_in_python_it_is_a_keyboard_interrupt() -> None:
    """Not one of PETSc's errors: a notebook's button does the same."""
    done = subprocess.run([sys.executable, "-c", NOTEBOOK], capture_output=True, text=True, timeout=120, check=False)
    assert (done.stdout, done.stderr) == ("stopped True\n", "")
