"""Commands that prove: studies, every material in every scene, timings."""

import os
from pathlib import Path
from typing import Any

from elastune.app import interrupts
from elastune.app.cli import needs
from elastune.app.cli.endings import OK, ranks
from elastune.app.errors import UserError


def converge(options: Any, petsc: list[str]) -> int:
    """Studies of errors against run time."""
    from elastune.app.studies.schema import load_study, shipped

    if options.study is None:
        for name in shipped():
            print(f"{name:20} {load_study(name).title}")
        return OK
    study = load_study(options.study)
    needs.present()

    from elastune.app.studies.converge import converge as measure

    files = measure(study, options.out or Path("results/converge") / study.name, lambda line: print(line, flush=True))
    print("results: " + ", ".join(str(file) for file in files))
    return OK


def stress(options: Any, petsc: list[str]) -> int:
    """Every material through the scenes that break solvers."""
    if not 0 < options.limit < float("inf"):
        raise UserError(f"--limit {options.limit:g}: expected a number of seconds greater than 0")
    needs.configure_petsc()
    needs.usable()
    _make(options.out)
    from mpi4py import MPI

    from elastune.app.stress.cases import Row
    from elastune.app.stress.outcomes import stress as solve
    from elastune.app.stress.picture import matrix
    from elastune.forms.energy import MaterialError
    from elastune.forms.materials import get

    try:
        materials = [get(name).name for name in options.material or []]
    except MaterialError as error:
        raise UserError(str(error)) from None

    def tell(row: Row) -> None:
        print(f"{row.material:28} {row.scene:10} nu {row.nu:<6g} {row.cell} {row.status:10} {row.reason}", flush=True)

    wanted = (lambda row: row.material in materials) if materials else None
    rows = solve(options.out, MPI.COMM_WORLD, options.limit, tell, wanted)
    if MPI.COMM_WORLD.rank == 0:
        with interrupts.held():
            matrix(rows, options.out / "stress.png")
        print(f"results: {options.out / 'stress.csv'}, {options.out / 'stress.png'}")
    return OK


def bench(options: Any, petsc: list[str]) -> int:
    """Timings."""
    if (options.quick or options.everything) and options.name != "kernels":
        raise UserError(f"elastune bench {options.name}: takes no {'--quick' if options.quick else '--all'}")
    if ranks() > 1:
        raise UserError("elastune bench: expected one process")
    needs.usable()
    _make(options.out)
    BENCHES[options.name](options)
    return OK


def _bench_kernels(options: Any) -> None:
    from elastune.app.bench.compilation import compilations
    from elastune.app.bench.kernel_tables import summary, write
    from elastune.app.bench.kernels import measure, plan

    what = plan(options.quick, options.everything)
    rows = list(measure(what, lambda line: print(line, flush=True)))
    compiled = compilations(list(what.elements), what.materials)
    print("\n".join(summary(rows, compiled)))
    with interrupts.held():
        print("results: " + ", ".join(map(str, write(rows, compiled, options.out))))


def _bench_twist(options: Any) -> None:
    from elastune.app.bench.twist import twist

    result = twist()
    ours, theirs = result.energies
    print(f"elastune, one step:  {result.ours:6.2f} s, {result.ours_newton} Newton steps, energy {ours:.10g}")
    print(f"tutorial, ten steps: {result.theirs:6.2f} s, {result.theirs_newton} Newton steps, energy {theirs:.10g}")
    print(f"time against the tutorial's: {result.ours / result.theirs:.3f}")


def _bench_stretch(options: Any) -> None:
    from elastune.app.bench.stretch import stretch, write

    tables = stretch()
    with interrupts.held():
        print("results: " + ", ".join(map(str, write(tables, options.out))))


def _make(folder: Path) -> None:
    """A folder for results."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--out {folder}: cannot be written: {error.strerror}") from None
    if not os.access(folder, os.W_OK):
        raise UserError(f"--out {folder}: cannot be written: Permission denied")


BENCHES = {"kernels": _bench_kernels, "twist": _bench_twist, "stretch": _bench_stretch}
