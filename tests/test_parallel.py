"""All tests that need several ranks, in one session of two: `mpirun -n 2 pytest -m parallel`."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from elastune.app.batch.share import share
from elastune.app.run import Run, start
from elastune.app.scene.read import load
from elastune.app.solvers.linear.fieldsplit import FieldSplit
from elastune.app.solvers.linear.multigrid import Multigrid
from elastune.app.solvers.minimizer import Minimizer
from elastune.app.solvers.options import Options

COMM = MPI.COMM_WORLD
SMALL = ["mesh.cells=4", "solve.steps=2", "solve.tolerance=1e-10", "output.picture=false"]
COLUMN = [
    "mesh.shape=box", "mesh.size=[1.0, 0.8, 8.0]", "mesh.cells=[2, 2, 8]", "solve.steps=10", "material.nu=0.3",
    "boundary.top={move=[0.0, 0.0, -1.2]}", "output.picture=false",
]  # fmt: skip

# Scenes on every linear solver and kind of element.
RUNS: dict[str, tuple[str, list[str]]] = {
    "direct": ("cube-twist", SMALL),
    "multigrid": ("cube-twist", [*SMALL, "solve.linear=iterative"]),
    "multigrid, second order": ("cube-twist", [*SMALL, "solve.element=Q2", "solve.linear=iterative", "mesh.cells=3"]),
    "multigrid, tetrahedra": (
        "cube-pull",
        [*SMALL, "mesh.cell=tetrahedron", "solve.element=P2", "solve.linear=iterative"],
    ),
    "fieldsplit": ("cube-pull", [*SMALL, "material.nu=0.5", "solve.element=Q2-P1d", "solve.linear=iterative"]),
    "mixed, direct": ("cube-pull", [*SMALL, "material.nu=0.5", "solve.element=Q2-P1d"]),
    "column, multigrid": ("squeeze", [*COLUMN, "solve.element=Q2", "solve.linear=iterative"]),
    "column, fieldsplit": ("squeeze", [*COLUMN, "solve.element=Q2-P1d", "solve.linear=iterative"]),
    "scramble": (
        "scramble",
        ["mesh.cells=4", "boundary.left={fix=true}", "boundary.right={move=[-0.2,0.0,0.0]}", "start.pins=[]"],
    ),
    "pressure": ("cube-pull", [*SMALL, "boundary.right={pressure=0.3}"]),
    "one cell": ("cube-pull", ["mesh.cells=1", "solve.steps=1", "solve.element=Q1"]),
}


def test_session_of_two_ranks() -> None:
    command = [
        "mpirun",
        "-n",
        "2",
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-x",
        "-m",
        "parallel",
        "-p",
        "no:cacheprovider",
    ]
    done = subprocess.run(
        [*command, str(Path(__file__).parent)], capture_output=True, text=True, timeout=900, check=False
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    assert done.stdout.count(" passed") == 2


def solved(name: str, overrides: list[str], comm: MPI.Comm) -> Run:
    run = start(load(name, overrides), comm).finish()
    assert run.summary.failure is None, run.summary.failure
    return run


@pytest.mark.parallel
@pytest.mark.parametrize("case", RUNS)
def test_ranks_agree(case: str) -> None:
    """Energies, reactions and volumes of all ranks together and of each alone, at every step."""
    together, alone = (solved(*RUNS[case], comm=comm) for comm in (COMM, MPI.COMM_SELF))
    assert together.summary.ranks == COMM.size
    for one, two in zip(together.summary.steps, alone.summary.steps, strict=True):
        assert one.energy == pytest.approx(two.energy, rel=1e-8, abs=1e-12)
        assert one.volume_ratio == pytest.approx(two.volume_ratio, rel=1e-8)
        assert one.min_J == pytest.approx(two.min_J, rel=1e-5)
        for face, force in one.reaction.items():
            assert force == pytest.approx(two.reaction[face], rel=1e-6, abs=1e-7)


@pytest.mark.parallel
def test_solvers_are_those_that_were_meant() -> None:
    for case, kind in (("multigrid", Multigrid), ("fieldsplit", FieldSplit)):
        run = start(load(*RUNS[case]), COMM)
        assert isinstance(Minimizer(run.body, run.options).linear, kind)


@pytest.mark.parallel
def test_columns_buckle() -> None:
    """Seen by no linear solver of these: the least eigenvalue tells."""
    for case in ("column, multigrid", "column, fieldsplit"):
        body = solved(*RUNS[case], comm=COMM).body
        sideways = np.abs(body.layout.nodal(body.state.values)[:, :2]).max(initial=0.0)
        assert COMM.allreduce(float(sideways), op=MPI.MAX) > 1


@pytest.mark.parallel
def test_every_case_goes_to_one_rank_and_nobody_waits() -> None:
    """Costs that differ a hundredfold: who is done takes the next."""
    import time

    costs = [0.5, *[0.005] * 60]
    taken, began = [], time.perf_counter()
    for number, cost in share(list(enumerate(costs)), COMM):
        time.sleep(cost)
        taken.append(number)
    busy = time.perf_counter() - began
    everything = sorted(n for part in COMM.allgather(taken) for n in part)
    assert everything == list(range(len(costs)))
    # The rank with the long case has hardly any other; both are done at about the same time.
    assert min(map(len, COMM.allgather(taken))) < 15
    assert busy < 1.2


@pytest.mark.parallel
def test_bodies_live_on_any_communicator() -> None:
    """Ranks that solve other things at the same time do not wait for each other."""
    own = COMM.Split(COMM.rank)
    cells = 2 + COMM.rank
    run = start(load("cube-pull", [f"mesh.cells={cells}", "solve.steps=1"]), own)
    assert len(list(run)) == 1
    assert run.options == Options(steps=1)
    own.Free()
