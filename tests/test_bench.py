"""The benchmark of the kernels: what it writes and what it refuses, not how fast anything is."""

import csv
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from elastune.app.bench.compilation import compilations
from elastune.app.bench.kernel_tables import summary, write
from elastune.app.bench.kernels import ELEMENTS, FORMS, MEASURES, METHODS, measure, plan

ELEMENT = "P1 triangle"


def test_tables(tmp_path: Path) -> None:
    """Two materials on a few triangles: every form by every measure, with times, ratios and a picture."""
    quick = replace(plan(quick=True), elements={ELEMENT: replace(ELEMENTS[ELEMENT], edge=2)}, repeats=3)
    said: list[str] = []
    rows = list(measure(quick, said.append))
    compiled = compilations(list(quick.elements), quick.materials)
    table, seconds, picture = write(rows, compiled, tmp_path)
    with table.open() as file:
        entries = list(csv.DictReader(file))
    assert len(entries) == len(rows) == len(quick.materials) * len(MEASURES) * len(FORMS)
    assert {entry["form"] for entry in entries} == set(FORMS)
    for entry in entries:
        stretch_based = entry["material"] == "linear-corotational"
        missing = "invariants" if stretch_based else "eigenvalues"
        for method in METHODS:
            times = [entry[f"{method}_{what}"] for what in ("low_us", "us", "high_us")]
            if method == missing:
                assert not any(times)
                continue
            low, middle, high = map(float, times)
            assert 0 < low <= middle <= high
            assert method == "spectral" or float(entry[f"ratio_{method}"]) > 0
        assert entry["cells"] == "8"
    with seconds.open() as file:
        assert all(float(c["empty_cache_s"]) > float(c["warm_cache_s"]) > 0 for c in csv.DictReader(file))
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert len(said) == len(quick.materials)
    assert [line.partition(":")[0] for line in summary(rows, compiled)][-1] == "compilation"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["kernel"], "'kernel': did you mean kernels?"),
        (["kernels", "--quick", "--all"], "not allowed with"),
        (["twist", "--quick"], "takes no --quick"),
        (["kernels", "--out", "file/below"], "--out file/below: cannot be written"),
    ],
)
def test_refused(
    words: list[str], message: str, elastune: Callable[..., subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    """Bad input is one line and exit status 2, before anything is measured."""
    (tmp_path / "file").touch()
    done = elastune("bench", *words)
    assert done.returncode == 2
    assert message in done.stderr and done.stderr.count("\n") == 1
    assert done.stdout == ""
