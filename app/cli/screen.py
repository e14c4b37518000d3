"""How a run goes, on the screen of rank 0: a bar on a terminal, a line a step everywhere."""

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from mpi4py import MPI
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar

from elastune.app.cli.console import console
from elastune.app.results.progress import Progress
from elastune.app.results.record import Record, Summary
from elastune.app.run import Run
from elastune.app.scene.schema import Scene
from elastune.app.solvers.outcome import Event

EVENTS = {
    "buckled": "buckled: the state is no longer one of least energy, and others branch off",
    "snapped": "snapped: the way ended, and the body went to a state far from it",
    "limit": "limit load: the load is stationary along the branch of equilibria",
}


class Screen(Progress):
    """Tells a person how a run goes; other ranks than 0 stay silent."""

    def __init__(self, scene: Scene, comm: MPI.Comm = MPI.COMM_WORLD) -> None:
        """Prepares a bar that is shown on terminals only."""
        self.scene = scene
        self.console = console(wrap=False, quiet=comm.rank != 0)
        self.bar = Bar(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("load {task.completed:.3f}"),
            TimeElapsedColumn(),
            console=self.console,
            transient=True,
        )

    def __enter__(self) -> "Screen":
        self.task = self.bar.add_task(self.scene.name, total=1.0)
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self.console.is_terminal:
            self.bar.stop()

    def start(self, run: Run) -> None:
        """What is about to be solved."""
        body = run.body
        ranks = f", {body.comm.size} ranks" if body.comm.size > 1 else ""
        element = f"{body.element} (auto: {run.reason})" if run.reason else body.element
        materials = " and ".join(dict.fromkeys(given.name for given in self.scene.materials.values()))
        self.console.print(
            f"{self.scene.name}: {materials}, {element}, "
            f"{body.geometry.cells_count:,} cells, {body.size:,} unknowns{ranks}"
        )
        # Even a disabled bar ends with an empty line. Before, a signal would end the process and leave the bar.
        if self.console.is_terminal:
            self.bar.start()
            # Nobody could bring it back if a second signal ended the process.
            self.console.show_cursor()

    def increment(self, load: float, newton: int) -> None:
        """A load increment has converged."""
        self.bar.update(self.task, completed=load)

    def event(self, event: Event) -> None:
        """The body has buckled, or snapped, or met a limit load."""
        self.console.print(f"load {event.load:.4g}: {EVENTS[event.kind]}")

    def step(self, record: Record) -> None:
        """A step has been recorded."""
        self.console.print(
            f"load {record.load:.4g}: energy {record.energy:.8g}, volume {record.volume_ratio:.5f}, "
            f"least J {record.min_J:.4f}, {record.newton_iterations} Newton steps, {record.wall_s:.2f} s"
        )

    def finish(self, summary: Summary, files: Sequence[Path]) -> None:
        """How it ended, and where the results are."""
        if summary.failure is not None:
            self.console.print(
                f"did not converge at load {summary.failure.load:.4g}: {summary.failure.message} "
                f"({summary.failure.kind})"
            )
            self.console.print(_told(summary.failure.diagnosis))
        if summary.locking is not None:
            self.console.print("{message}; {instead}".format(**summary.locking))
        if files:
            self.console.print(f"{summary.wall_s:.1f} s; results in {files[0].parent}: ", end="")
            self.console.print(", ".join(file.name for file in files if file.is_file()))


def _told(diagnosis: dict[str, Any]) -> str:
    """A diagnosis in a few lines."""
    lines = [
        "{inverted_cells} cells inverted, J from {J[0]:.3g} to {J[1]:.3g}, "
        "stretches from {stretches[0]:.3g} to {stretches[1]:.3g}".format(**diagnosis),
        "largest force out of balance {largest_force:.3g} at {at}".format(**diagnosis["residual"]),
    ]
    if diagnosis["ellipticity"] < 0:
        lines.append("the material has lost ellipticity there")
    if diagnosis["unbounded_below"]:
        lines.append("the energy is unbounded below")
    if diagnosis["locking"]:
        lines.append(f"locking is likely: {diagnosis['locking']}")
    lines += [f"try: {advice}" for advice in diagnosis["advice"]]
    return "\n".join(f"  {line}" for line in lines)
