"""The stress tests: complete, resumable, and every outcome explained."""

from pathlib import Path

import pytest
from mpi4py import MPI

from elastune.app.stress.outcomes import LIMIT, OUTCOMES, Row, cases, read, solve, stress
from elastune.app.stress.picture import matrix
from elastune.forms.energy import CATALOGUE

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
    matrix(rows, tmp_path / "stress.png")
    assert (tmp_path / "stress.png").stat().st_size > 10_000
