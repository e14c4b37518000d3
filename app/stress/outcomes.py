"""Every material through the scenes that break solvers: one row a case, and a picture of the outcomes."""

import csv
import fcntl
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from elastune.app.body.body import Array, Problem
from elastune.app.errors import SceneError, UserError
from elastune.app.path.follow import LoadFailure, follow
from elastune.app.results.diagnose import diagnose
from elastune.app.results.measures import Measures
from elastune.app.scene.read import load
from elastune.app.scene.schema import Scene
from elastune.app.verify.independent import out_of_balance
from elastune.forms.energy import CATALOGUE

# A shipped scene each, coarse, in as few steps as it can be expected to take.
SCENES = {
    "twist": ("cube-twist", ["mesh.cells=4", "solve.steps=2"]),
    "stretch": ("cylinder-stretch", ["mesh.cells=4", "solve.steps=6"]),
    "squeeze": ("squeeze", ["mesh.cells=4", "solve.steps=5"]),
    "scramble": ("scramble", ["mesh.cells=4"]),
    "plane": ("collapse", ["mesh.cells=4", "start.shape=plane"]),
    "line": ("collapse", ["mesh.cells=4", "start.shape=line"]),
    "point": ("collapse", ["mesh.cells=4", "start.shape=point"]),
    "inside-out": ("collapse", ["mesh.cells=4", "start.shape=inside-out"]),
}
RATIOS = (0.3, 0.45, 0.49, 0.499)
CELLS = {"hex": ("hexahedron", "Q1"), "tet": ("tetrahedron", "P1")}

# Tolerance of the solver, and what the independent residual may be: relative to E times the square of the cube's
# edge, while the solver's is relative to the largest forces on the way, hundreds of times those for a scramble.
TOLERANCE, LIMIT = 1e-10, 1e-7

OUTCOMES = ("converged", "elsewhere", "failed", "refused", "crashed")


@dataclass
class Row:
    """One case and its outcome.

    Attributes:
        material: Name.
        scene: Key of SCENES.
        nu: Poisson's ratio.
        cell: Key of CELLS.
        status: "converged"; "elsewhere" if a start without loads ended in another minimum than rest; "failed",
            "refused" before solving, or "crashed", which should not be.
        newton: Newton steps.
        linear: Iterations of the linear solver, one a direct solve.
        seconds: Wall time.
        min_J: Least volume ratio of the last state.
        energy: Of the last state.
        residual: |r| of the last state, recomputed independently, over E times an edge squared.
        reason: Of what is not converged, with the diagnosis.
    """

    material: str
    scene: str
    nu: float
    cell: str
    status: str = ""
    newton: int = 0
    linear: int = 0
    seconds: float = 0.0
    min_J: float | None = None
    energy: float | None = None
    residual: float | None = None
    reason: str = ""

    @property
    def key(self) -> tuple[str, str, float, str]:
        """What tells cases apart."""
        return self.material, self.scene, self.nu, self.cell


def cases() -> list[Row]:
    """All cases, their outcomes open."""
    return [Row(*key) for key in product(CATALOGUE, SCENES, RATIOS, CELLS)]


def stress(
    folder: Path, comm: MPI.Comm, limit: float, tell: Callable[[Row], None], wanted: Callable[[Row], bool] | None = None
) -> list[Row]:
    """Solves what `folder/stress.csv` does not hold yet; each rank takes cases of its own.

    Args:
        folder: Of the table.
        comm: Its ranks share the cases.
        limit: Seconds a case may take.
        tell: Told each new row, on the rank that has it.
        wanted: Which cases; all by default.

    Returns:
        The whole table, on every rank.

    Raises:
        UserError: If the table cannot be read.
    """
    table = folder / "stress.csv"
    done = {row.key for row in read(table)}
    # Nobody writes before all have read.
    comm.barrier()
    todo = [row for row in cases() if row.key not in done and (wanted is None or wanted(row))]
    for row in todo[comm.rank :: comm.size]:
        solve(row, limit)
        _append(table, row)
        tell(row)
    comm.barrier()
    return read(table)


def solve(row: Row, limit: float) -> None:
    """Fills in the outcome of a case."""
    began = time.perf_counter()
    try:
        _solve(row, _scene(row, limit))
    except SceneError as error:
        row.status, row.reason = "refused", str(error)
    except Exception as error:
        # One case must not end the others; the picture shows it.
        row.status, row.reason = "crashed", f"{type(error).__name__}: {error}"
    row.reason = " ".join(row.reason.split())
    row.seconds = round(time.perf_counter() - began, 3)


def _scene(row: Row, limit: float) -> Scene:
    shipped, overrides = SCENES[row.scene]
    cell, element = CELLS[row.cell]
    settings = [
        f"material.name={row.material}",
        f"material.nu={row.nu}",
        f"mesh.cell={cell}",
        f"solve.element={element}",
        f"solve.tolerance={TOLERANCE}",
        f"solve.time_limit={limit}",
        "solve.smallest_step=0.01",
    ]
    if len(CATALOGUE[row.material].pair) < 2:
        # An energy without a λ part knows no ν.
        settings.append("material.volume=stable-neo-hookean")
    return load(shipped, [*overrides, *settings])


def _solve(row: Row, scene: Scene) -> None:
    problem = Problem(scene, MPI.COMM_SELF)
    try:
        for state in follow(problem):
            row.newton += state.newton
            row.linear += state.linear
        row.status = "converged"
    except LoadFailure as failure:
        row.status = "failed"
        told = f"load {failure.load:.4g}: {failure.kind}: {failure}"
        row.reason = _explained(problem, failure.values, failure.kind, told)
    row.min_J = Measures(problem).min_J()
    row.energy = problem.energy_at(problem.state)
    row.residual = out_of_balance(problem)
    if row.status != "converged":
        return
    if not (np.isfinite([row.min_J, row.energy]).all() and row.residual <= LIMIT):
        row.status = "failed"
        told = f"the independent residual is {row.residual:.1e}, expected {LIMIT:.0e}"
        row.reason = _explained(problem, None, "iterations", told)
    elif scene.start is not None and np.abs(problem.state).max() > 1e-6:
        row.status = "elsewhere"
        row.reason = f"another minimum, displaced by {np.abs(problem.state).max():.2g}, least J {row.min_J:.3g}"


def _explained(problem: Problem, values: Array | None, kind: str, told: str) -> str:
    """What happened, with the diagnosis, in one line."""
    found = diagnose(problem, values, kind)
    return (
        f"{told}; {found['inverted_cells']} cells inverted, J from {found['J'][0]:.3g}, "
        f"least acoustic eigenvalue {found['ellipticity']:.3g} mu; try: {found['advice'][0]}"
    )


def read(table: Path) -> list[Row]:
    """The rows of a table, none if there is no file.

    Raises:
        UserError: If it is another table, or cannot be read.
    """
    if not table.is_file():
        return []
    try:
        with table.open(newline="", encoding="utf-8") as file:
            return [Row(**_typed(entry)) for entry in csv.DictReader(file)]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UserError(f"{table}: expected a table of outcomes, or no file; {error!r}") from None


def _typed(entry: dict[str, str]) -> dict[str, Any]:
    """A row of text as what `Row` takes; a float that is missing is None."""
    kinds: dict[Any, Callable[[str], Any]] = {int: int, float: float, str: str}
    return {f.name: kinds.get(f.type, lambda text: float(text) if text else None)(entry[f.name]) for f in fields(Row)}


def _append(table: Path, row: Row) -> None:
    """Adds a row; ranks take turns."""
    with table.open("a", newline="") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        writer = csv.DictWriter(file, [field.name for field in fields(Row)], lineterminator="\n")
        if file.tell() == 0:
            writer.writeheader()
        writer.writerow(asdict(row))
