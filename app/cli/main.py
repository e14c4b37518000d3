"""The command line. What a command does not use it does not import: --help must not load dolfinx."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from elastune.app import interrupts
from elastune.app.cli import needs
from elastune.app.cli.endings import NOT_CONVERGED, OK, failed, interrupted, ranks
from elastune.app.cli.words import parser
from elastune.app.errors import UserError, meant


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command; its exit status.

    Args:
        arguments: The words after `elastune`; those of the process by default, whose signals are then listened to.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    words, petsc = (words[: words.index("--")], words[words.index("--") + 1 :]) if "--" in words else (words, [])
    command = ""
    try:
        if arguments is None:
            interrupts.listen(lambda: interrupted(command))
        options = parser(_BENCHES).parse_args(words)
        command = options.command
        if petsc and command != "run":
            raise UserError(f"elastune {command}: takes no PETSc options, got {' '.join(petsc)}")
        status = _COMMANDS[command](options, petsc)
        if interrupts.came():
            interrupted(command)
        interrupts.ignore()
        return status
    except Exception as error:
        return failed(error, command)


def _run(options: Any, petsc: list[str]) -> int:
    from elastune.app.scene.read import load

    scene = load(options.scene, options.overrides)
    folder = options.out or Path("results") / scene.name

    _configure_petsc(petsc)
    needs.usable()
    from elastune.app.cli.screen import Screen
    from elastune.app.run import run

    with Screen(scene) as screen:
        summary, files = run(scene, folder, progress=screen)
        if summary.status != "interrupted":
            interrupts.ignore()
            screen.finish(summary, files)
    if summary.status == "interrupted" and summary.failure is not None:
        reached = summary.steps[-1].load if summary.steps else 0.0
        interrupted("run", f" at load {summary.failure.load:.4g}; results up to load {reached:.4g} in {folder}")
    return OK if summary.status == "converged" else NOT_CONVERGED


def _scenes(options: Any, petsc: list[str]) -> int:
    from elastune.app.scene.read import load, shipped

    for name in shipped():
        scene = load(name)
        print(f"{name:20} {scene.title}")
    return OK


def _materials(options: Any, petsc: list[str]) -> int:
    from elastune.app.cli.catalogue import show, table
    from elastune.app.cli.console import console
    from elastune.forms.energy import MaterialError

    try:
        if options.name is None:
            table(options.E, options.nu, console())
        else:
            show(options.name, options.E, options.nu, options.out, _material_table(options.overrides), console())
    except MaterialError as error:
        raise UserError(str(error)) from None
    except OSError as error:
        raise UserError(f"--out {options.out}: cannot be written: {error.strerror}") from None
    return OK


def _converge(options: Any, petsc: list[str]) -> int:
    from elastune.app.studies.schema import load_study, shipped

    if options.study is None:
        for name in shipped():
            print(f"{name:20} {load_study(name).title}")
        return OK
    study = load_study(options.study)
    needs.present()

    from elastune.app.studies.converge import converge

    files = converge(study, options.out or Path("results/converge") / study.name, lambda line: print(line, flush=True))
    print("results: " + ", ".join(str(file) for file in files))
    return OK


def _make(folder: Path) -> None:
    """A folder for results."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--out {folder}: cannot be written: {error.strerror}") from None
    if not os.access(folder, os.W_OK):
        raise UserError(f"--out {folder}: cannot be written: Permission denied")


def _configure_petsc(options: Sequence[str] = ()) -> None:
    """Before PETSc starts, which reads some of its options only then, such as -log_view.

    A closed pipe or an interrupt is Python's to handle, not a crash for PETSc to report.
    """
    os.environ["PETSC_OPTIONS"] = " ".join([os.environ.get("PETSC_OPTIONS", ""), "-no_signal_handler", *options])


def _stress(options: Any, petsc: list[str]) -> int:
    if not 0 < options.limit < float("inf"):
        raise UserError(f"--limit {options.limit:g}: expected a number of seconds greater than 0")
    _configure_petsc()
    needs.usable()
    _make(options.out)
    from mpi4py import MPI

    from elastune.app.stress.cases import Row
    from elastune.app.stress.outcomes import stress
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
    rows = stress(options.out, MPI.COMM_WORLD, options.limit, tell, wanted)
    if MPI.COMM_WORLD.rank == 0:
        with interrupts.held():
            matrix(rows, options.out / "stress.png")
        print(f"results: {options.out / 'stress.csv'}, {options.out / 'stress.png'}")
    return OK


def _bench(options: Any, petsc: list[str]) -> int:
    if (options.quick or options.everything) and options.name != "kernels":
        raise UserError(f"elastune bench {options.name}: takes no {'--quick' if options.quick else '--all'}")
    if ranks() > 1:
        raise UserError("elastune bench: expected one process")
    needs.usable()
    _make(options.out)
    _BENCHES[options.name](options)
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


def _material_table(overrides: Sequence[str]) -> dict[str, Any]:
    """The keys of a scene's material table that `tuned_energy` takes beside name, E and nu."""
    if not overrides:
        return {}
    from elastune.app.scene.override import override
    from elastune.app.scene.schema import Material

    table: dict[str, Any] = {}
    for assignment in overrides:
        override(table, assignment)
    known = set(Material.model_fields) - {"name", "E", "nu", "extension"}
    for key in table:
        if key not in known:
            raise UserError(f"--set {key}: {meant(key, sorted(known))}")
    return table


_BENCHES = {"kernels": _bench_kernels, "twist": _bench_twist, "stretch": _bench_stretch}

_COMMANDS = {
    "run": _run,
    "scenes": _scenes,
    "materials": _materials,
    "converge": _converge,
    "stress": _stress,
    "bench": _bench,
}
