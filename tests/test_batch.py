"""Many cases: a table that loses and mixes up nothing, and cases whose accidents are their own."""

import multiprocessing
import os
import time
from pathlib import Path

import pytest

from elastune.app.batch.process import CaseFailure, answer
from elastune.app.batch.store import Table
from elastune.app.errors import UserError

COLUMNS = ["status", "message", "force"]

# ---------------------------------------------------------------------- the table


def test_rows_are_kept_by_key(tmp_path: Path) -> None:
    path = tmp_path / "new" / "cases.csv"
    table = Table(path, COLUMNS)
    table.append("a", {"status": "converged", "force": repr(1 / 3)})
    table.append("a", {"status": "converged", "force": repr(2 / 3)})
    table.append("b", {"status": "failed", "message": 'says "no",\nand ends'})
    for again in (table, Table(path, COLUMNS)):
        assert [float(row["force"]) for row in again.of("a")] == [1 / 3, 2 / 3]
        assert [row["message"] for row in again.of("b")] == ['says "no", and ends']
        assert again.of("c") == []
    assert path.read_text().splitlines()[0] == "key,status,message,force"


# Where a crash may cut off a row: in its midst, in a quotation, in the last number, before its end.
@pytest.mark.parametrize("rest", ["b,conv", 'b,failed,"says ""no', "b,converged,,0.1", "b,converged,,0.125"])
def test_a_row_that_a_crash_cut_off_is_run_again(rest: str, tmp_path: Path) -> None:
    path = tmp_path / "cases.csv"
    Table(path, COLUMNS).append("a", {"status": "converged"})
    with path.open("a") as file:
        file.write(rest)
    table = Table(path, COLUMNS)
    assert len(table.of("a")) == 1 and table.of("b") == []
    # Nor does it spoil the rows that follow.
    table.append("b", {"status": "converged", "force": 0.125})
    table.append("c", {"status": "converged"})
    again = Table(path, COLUMNS)
    assert [row["force"] for row in again.of("b")] == ["0.125"]
    assert len(again.of("a")) == len(again.of("c")) == 1
    assert len(path.read_text().splitlines()) == 4


def test_a_row_that_another_process_left_half_is_mended_too(tmp_path: Path) -> None:
    path = tmp_path / "cases.csv"
    table = Table(path, COLUMNS)
    with path.open("a") as file:
        file.write("b,converged,,0.1")
    table.append("c", {"status": "converged"})
    again = Table(path, COLUMNS)
    assert again.of("b") == [] and len(again.of("c")) == 1


@pytest.mark.parametrize(
    "content", [b"key,status,message,torque\n", b"status,message,force\n", b"half a l", b"\xff\x00"]
)
def test_strangers_are_refused_and_left_alone(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "cases.csv"
    path.write_bytes(content)
    with pytest.raises(UserError, match="is another table; remove it, or choose another --out"):
        Table(path, COLUMNS)
    assert path.read_bytes() == content


def test_a_place_where_nobody_can_write_is_told_in_a_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be written"):
        Table(tmp_path / "file" / "cases.csv", COLUMNS)
    table = Table(tmp_path / "here" / "cases.csv", COLUMNS)
    (tmp_path / "here" / "cases.csv").unlink()
    (tmp_path / "here").rmdir()
    (tmp_path / "here").write_text("")
    with pytest.raises(UserError, match="cannot be written"):
        table.append("a", {})


def append(path: Path, worker: int) -> None:
    for number in range(50):
        Table(path, COLUMNS).append(f"{worker}-{number}", {"message": "x" * 2000, "force": number})


def test_processes_take_turns(tmp_path: Path) -> None:
    path = tmp_path / "cases.csv"
    workers = [multiprocessing.get_context("spawn").Process(target=append, args=(path, i)) for i in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(60)
    assert [worker.exitcode for worker in workers] == [0] * 4
    table = Table(path, COLUMNS)
    for i in range(4):
        assert [table.of(f"{i}-{n}")[0]["force"] for n in range(50)] == [str(n) for n in range(50)]
    assert len(path.read_text().splitlines()) == 201


# ---------------------------------------------------------------------- processes


def module(folder: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """A module that `answer` may run."""
    (folder / "its_case.py").write_text(f"import json, os, sys, time\nrequest = json.loads(sys.argv[1])\n{text}")
    monkeypatch.setenv("PYTHONPATH", f"{folder}:{os.environ.get('PYTHONPATH', '')}")
    return "its_case"


def test_the_last_line_is_the_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    case = module(tmp_path, "print('talk')\nprint(json.dumps({'twice': 2 * request['number']}))", monkeypatch)
    assert answer(case, {"number": 21}, 1, 60.0) == {"twice": 42}


ACCIDENTS = {
    "error": ("raise ValueError('out of luck')", "ValueError: out of luck"),
    "signal": ("os.kill(os.getpid(), 11)", "SIGSEGV"),
    "exit": ("sys.exit(7)", "exit status 7"),
    "silence": ("", "without an answer"),
    "nonsense": ("print('done')", "without an answer"),
}


@pytest.mark.parametrize("name", ACCIDENTS)
def test_accidents_of_a_case_are_told_in_a_line(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text, told = ACCIDENTS[name]
    with pytest.raises(CaseFailure) as failure:
        answer(module(tmp_path, text, monkeypatch), {}, 1, 60.0)
    assert failure.value.status == "failed"
    assert told in str(failure.value) and "\n" not in str(failure.value)


def test_an_accident_of_a_rank_is_told_not_what_mpirun_says_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "from mpi4py import MPI\nif MPI.COMM_WORLD.rank: print('out of luck', file=sys.stderr, flush=True)\n"
    text += "os._exit(MPI.COMM_WORLD.rank)"
    with pytest.raises(CaseFailure, match=r"^out of luck$"):
        answer(module(tmp_path, text, monkeypatch), {}, 2, 60.0)


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_case_that_is_given_up_leaves_nothing_behind(
    ranks: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No rank, and no compiler that a rank has started."""
    text = "import subprocess\nfrom mpi4py import MPI\nchild = subprocess.Popen(['sleep', '600'])\n"
    text += f"open(f'{tmp_path}/pids-{{os.getpid()}}', 'w').write(f'{{os.getpid()}} {{child.pid}}')\ntime.sleep(600)"
    began = time.perf_counter()
    with pytest.raises(CaseFailure, match="not done after 5 s") as failure:
        answer(module(tmp_path, text, monkeypatch), {}, ranks, 5.0)
    assert failure.value.status == "timeout"
    assert time.perf_counter() - began < 20
    pids = [int(word) for path in tmp_path.glob("pids-*") for word in path.read_text().split()]
    assert len(pids) == 2 * ranks
    time.sleep(0.5)
    assert [pid for pid in pids if alive(pid)] == []


def alive(pid: int) -> bool:
    """Whether a process runs; one that has ended and that nobody has asked for does not."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return status.rpartition(")")[2].split()[0] != "Z"
