"""The stress tests: complete, resumable, and every outcome explained."""

import subprocess
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest
from mpi4py import MPI

from elastune.app.scene.schema import Scene
from elastune.app.stress.cases import OUTCOMES, SCENES, Row, cases, keyed, read, worse
from elastune.app.stress.outcomes import LIMIT, solve, stress
from elastune.app.stress.picture import matrix
from elastune.forms.energy import CATALOGUE

Command = Callable[..., subprocess.CompletedProcess[str]]

ROOT = Path(__file__).parents[1]
SLOW = 20.0


def test_every_material_scene_ratio_and_cell_is_a_case() -> None:
    assert len(cases()) == len(CATALOGUE) * 8 * 4 * 2
    assert len({row.key for row in cases()}) == len(cases())


@pytest.mark.parametrize("scene", ["twist", "squeeze", "scramble", "line", "inside-out"])
@pytest.mark.parametrize("cell", ["hex", "tet"])
@pytest.mark.parametrize("nu", [0.3, 0.499])
def test_stable_neo_hookean_survives(scene: str, cell: str, nu: float) -> None:
    row = Row("stable-neo-hookean", scene, nu, cell)
    solve(row, SLOW)
    assert row.status == "converged", row.reason
    assert row.residual is not None
    assert row.residual <= LIMIT


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_case_of_every_material_is_explained(name: str) -> None:
    for scene in ("plane", "twist"):
        row = Row(name, scene, 0.45, "tet")
        solve(row, SLOW)
        assert row.status in OUTCOMES
        assert row.status != "crashed", row.reason
        assert bool(row.reason) == (row.status != "converged")
        if not CATALOGUE[name].inverts and scene == "plane":
            assert row.status == "refused"
            assert "J <= 0" in row.reason


def test_table_resumes(tmp_path: Path) -> None:
    told: list[Row] = []

    def wanted(row: Row) -> bool:
        return row.material in ("neo-hookean", "stable-neo-hookean") and row.scene == "plane" and row.nu == 0.49

    rows = stress(tmp_path, MPI.COMM_SELF, SLOW, told.append, wanted)
    assert len(rows) == len(told) == 4
    assert {row.status for row in rows} == {"refused", "converged"}
    again = stress(tmp_path, MPI.COMM_SELF, SLOW, told.append, wanted)
    assert len(told) == 4
    assert again == rows == read(tmp_path / "stress.csv")
    # Another limit, or another version of what is solved, is another case; the old rows stay, and count for nothing.
    other = stress(tmp_path, MPI.COMM_SELF, SLOW + 1, told.append, wanted)
    assert len(told) == 8 and len(other) == 4
    assert len(read(tmp_path / "stress.csv")) == 8
    matrix(rows, tmp_path / "stress.png")
    assert (tmp_path / "stress.png").stat().st_size > 10_000


def test_a_table_has_all_materials_whichever_are_wanted(tmp_path: Path) -> None:
    def of(material: str) -> Callable[[Row], bool]:
        return lambda row: row.key == (material, "plane", 0.49, "tet")

    def tell(row: Row) -> None:
        told.append(row)

    told: list[Row] = []
    names = ["neo-hookean", "stable-neo-hookean"]
    for name in names:
        rows = stress(tmp_path, MPI.COMM_SELF, SLOW, tell, of(name))
    assert [row.material for row in rows] == [row.material for row in told] == names


def test_an_accident_in_a_case_does_not_end_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def start(given: Scene, comm: MPI.Intracomm) -> None:
        raise ZeroDivisionError(f"{given.material.nu}\nis a bad number")

    monkeypatch.setattr("elastune.app.stress.outcomes.start", start)
    rows = stress(tmp_path, MPI.COMM_SELF, SLOW, lambda row: None, lambda row: row.key[:2] == ("hencky", "twist"))
    assert len(rows) == 8
    assert {row.status for row in rows} == {"crashed"}
    assert rows[0].reason == "ZeroDivisionError: 0.3 is a bad number"


def test_keys_tell_cases_limits_scenes_and_versions_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    before = keyed(SLOW)
    assert len(before) == len(cases())
    assert not set(before) & set(keyed(SLOW + 1))
    assert set(before) == set(keyed(SLOW))
    with monkeypatch.context() as patch:
        patch.setitem(SCENES, "twist", ("cube-twist", ["mesh.cells=5"]))
        assert len(set(before) - set(keyed(SLOW))) == len(before) / len(SCENES)
    monkeypatch.setattr("elastune.app.scene.write.__version__", "99")
    assert not set(before) & set(keyed(SLOW))


def test_ranks_share_a_table_and_resume(elastune: Command, tmp_path: Path) -> None:
    words = ["stress", "--material", "linear-elasticity", "--out", "here"]
    first = elastune(*words, ranks=2)
    assert first.returncode == 0, first.stderr
    assert len(first.stdout.splitlines()) == 8 * 4 * 2 + 1
    rows = read(tmp_path / "here" / "stress.csv")
    assert len(rows) == len({row.key for row in rows}) == 8 * 4 * 2
    again = elastune(*words, ranks=2)
    assert again.returncode == 0, again.stderr
    assert again.stdout.splitlines() == first.stdout.splitlines()[-1:]


def test_a_strange_table_ends_all_ranks(elastune: Command, tmp_path: Path) -> None:
    (tmp_path / "stress.csv").write_text("a,b\n1,2\n")
    done = elastune("stress", "--material", "arap", "--out", tmp_path, ranks=2)
    assert done.returncode == 2
    assert done.stderr.startswith("elastune: ") and "stress.csv: is another table" in done.stderr


def test_outcomes_that_got_worse_are_told() -> None:
    # The first is the best; of two in one place neither is worse than the other.
    order = [{"converged"}, {"elsewhere"}, {"failed", "refused"}, {"crashed"}]
    place = {status: i for i, statuses in enumerate(order) for status in statuses}
    assert set(place) == set(OUTCOMES)
    for old, new in product(OUTCOMES, OUTCOMES):
        rows = [[Row("arap", "twist", 0.3, "hex", status)] for status in (old, new)]
        assert worse(*rows) == ([(rows[0][0], rows[1][0])] if place[new] > place[old] else [])
    # Cases of one table only tell nothing.
    assert worse([Row("arap", "twist", 0.3, "hex", "converged")], [Row("arap", "twist", 0.45, "hex", "crashed")]) == []


def test_the_published_table_can_be_compared_and_drawn(tmp_path: Path) -> None:
    """It has no keys: it was written by an earlier version."""
    rows = read(ROOT / "results" / "published" / "stress" / "stress.csv")
    assert {row.key for row in rows} == {row.key for row in cases()}
    spoilt = [replace(row, status="crashed") if row.material == "arap" else row for row in rows]
    assert len(worse(rows, spoilt)) == 8 * 4 * 2
    assert worse(spoilt, rows) == []
    matrix(rows, tmp_path / "stress.png")
    assert (tmp_path / "stress.png").stat().st_size > 10_000
