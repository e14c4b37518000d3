"""Every material through the scenes that break solvers: what becomes of each case."""

import time
from collections.abc import Callable
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from elastune.app import interrupts
from elastune.app.batch.share import share
from elastune.app.batch.store import Table
from elastune.app.errors import SceneError
from elastune.app.results.diagnose import diagnose
from elastune.app.results.measures import Measures
from elastune.app.run import start
from elastune.app.scene.schema import Scene
from elastune.app.stress.cases import Row, keyed, scene, typed
from elastune.app.verify.independent import out_of_balance

# What the independent residual may be: relative to E times the square of the cube's edge, while the solver's is
# relative to the largest forces on the way, hundreds of times those for a scramble.
LIMIT = 1e-7


def stress(
    folder: Path,
    comm: MPI.Intracomm,
    limit: float,
    tell: Callable[[Row], None],
    wanted: Callable[[Row], bool] | None = None,
) -> list[Row]:
    """Solves what `folder/stress.csv` does not hold yet; ranks take cases one by one.

    Args:
        folder: Of the table.
        comm: Its ranks share the cases.
        limit: Seconds a case may take.
        tell: Told each new row, on the rank that has it.
        wanted: Which cases; all by default.

    Returns:
        The outcomes of all cases that have one, wanted or not, on every rank; none of another version or limit.

    Raises:
        UserError: If the table cannot be read.
    """
    table = Table(folder / "stress.csv", [field.name for field in fields(Row)])
    rows = keyed(limit)
    todo = [key for key, row in rows.items() if not table.of(key) and (wanted is None or wanted(row))]
    for key in share(todo, comm):
        row = rows[key]
        solve(row, limit)
        table.append(key, asdict(row))
        tell(row)
    table.refresh()
    return [typed(table.of(key)[-1]) for key in rows if table.of(key)]


def solve(row: Row, limit: float) -> None:
    """Fills in the outcome of a case."""
    began = time.perf_counter()
    try:
        _solve(row, scene(row, limit))
    except SceneError as error:
        row.status, row.reason = "refused", str(error)
    except Exception as error:
        if interrupts.came():
            # In the middle of a compilation.
            raise
        # One case must not end the others; the picture shows it.
        row.status, row.reason = "crashed", f"{type(error).__name__}: {error}"
    row.reason = " ".join(row.reason.split())
    row.seconds = round(time.perf_counter() - began, 3)


def _solve(row: Row, given: Scene) -> None:
    run = start(given, MPI.COMM_SELF).finish()
    body, failure = run.body, run.summary.failure
    row.status = run.summary.status
    row.newton = sum(step.newton_iterations for step in run.summary.steps)
    row.linear = sum(step.linear_iterations for step in run.summary.steps)
    if failure is not None:
        row.reason = _explained(failure.diagnosis, f"load {failure.load:.4g}: {failure.kind}: {failure.message}")
    row.min_J = Measures(body).min_J()
    row.energy = body.assembly.energy(body.state)
    row.residual = out_of_balance(body)
    if row.status != "converged":
        return
    largest = np.abs(body.state.values).max()
    if not (np.isfinite([row.min_J, row.energy]).all() and row.residual <= LIMIT):
        row.status = "failed"
        found = diagnose(body, run.options, body.state, "iterations", given.start is not None)
        row.reason = _explained(found, f"the independent residual is {row.residual:.1e}, expected {LIMIT:.0e}")
    elif given.start is not None and largest > 1e-6:
        row.status = "elsewhere"
        row.reason = f"another minimum, displaced by {largest:.2g}, least J {row.min_J:.3g}"


def _explained(found: dict[str, Any], told: str) -> str:
    """What happened, with the diagnosis, in one line."""
    return (
        f"{told}; {found['inverted_cells']} cells inverted, J from {found['J'][0]:.3g}, "
        f"least acoustic eigenvalue {found['ellipticity']:.3g} mu; try: {found['advice'][0]}"
    )
