"""`./run` where FEniCSx is at hand: what goes in and comes out is the command's own."""

import os
import signal
import subprocess
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
RUN = ROOT / "run"


def _run(*words: str, **more: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([RUN, *words], capture_output=True, text=True, check=False, timeout=120, **more)  # type: ignore[call-overload,no-any-return]


def test_status_input_and_folder_pass_through(tmp_path: Path) -> None:
    assert _run("sh", "-c", "exit 7").returncode == 7
    assert _run("cat", input="words").stdout == "words"
    assert _run("pwd", cwd=tmp_path).stdout.strip() == str(tmp_path)
    assert _run("sh", "-c", 'printf "%s" "$1"', "sh", "a  b'c").stdout == "a  b'c"


def test_without_a_command_it_says_how() -> None:
    done = _run()
    assert done.returncode == 2
    assert "./run elastune run cube-pull" in done.stderr


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signals_reach_the_command(number: signal.Signals, tmp_path: Path) -> None:
    script = f"trap 'echo caught; exit 5' {number.name.removeprefix('SIG')}; touch ready; while :; do sleep 0.05; done"
    with subprocess.Popen([RUN, "sh", "-c", script], cwd=tmp_path, stdout=subprocess.PIPE, text=True) as process:
        for _ in range(200):
            if (tmp_path / "ready").exists():
                break
            time.sleep(0.05)
        process.send_signal(number)
        out, _ = process.communicate(timeout=20)
    assert (out, process.returncode) == ("caught\n", 5)


def test_ranks_start_without_a_warning() -> None:
    done = _run("mpirun", "-n", "3", "python3", "-c", "from mpi4py import MPI; print(MPI.COMM_WORLD.size)")
    # Ranks write when they like: their line ends may come late.
    assert (done.stdout.replace("\n", ""), done.stderr) == ("333", "")


def test_a_launcher_within_another_finds_mpirun_itself() -> None:
    words = [str(RUN), "mpirun", "-n", "2", "python3", "-c", "from mpi4py import MPI; print(MPI.COMM_WORLD.size)"]
    done = _run(*words)
    assert (done.stdout.split(), done.stderr) in ((["2", "2"], ""), (["22"], ""))


def test_one_thread_a_rank() -> None:
    environment = {name: value for name, value in os.environ.items() if "NUM_THREADS" not in name}
    assert _run("printenv", "OPENBLAS_NUM_THREADS", env=environment).stdout == "1\n"


def test_package_list_serves_the_image_and_the_launcher() -> None:
    assert "packages.txt" in (ROOT / "Dockerfile").read_text()
    assert "packages.txt" in RUN.read_text()
    packages = [line.split("#")[0].strip() for line in (ROOT / "packages.txt").read_text().splitlines()]
    assert "python3-dolfinx-real" in packages
