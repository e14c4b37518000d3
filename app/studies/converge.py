"""Runs a study: each case in a process of its own, what is there already left alone, tables and figures at the end."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from elastune.app import interrupts
from elastune.app.batch.process import CaseFailure, answer
from elastune.app.errors import UserError
from elastune.app.studies.cases import REFINEMENT, Case, cases, references
from elastune.app.studies.compare import Comparison
from elastune.app.studies.figures import draw
from elastune.app.studies.records import Record, Records
from elastune.app.studies.schema import Settings, Study

Report = Callable[[str], None]


def converge(study: Study, folder: Path, report: Report) -> list[Path]:
    """Runs what a study lacks and writes its tables and figures.

    Args:
        study: What to run.
        folder: Where the results go and where those of an earlier call are.
        report: Told of each run in a line.

    Returns:
        The files written.

    Raises:
        UserError: If a case is impossible, or the folder.
    """
    if int(os.environ.get("OMPI_COMM_WORLD_SIZE", "1")) > 1:
        raise UserError("converge: expected one process, which starts the others: set ranks in the study's series")
    found = cases(study)
    records = Records(study, folder)
    given_up: list[tuple[str, int, Settings]] = []
    for case in found:
        line = case.solver, case.ranks, case.curve_settings
        if line not in given_up and not _measure(study, case, records, report):
            given_up.append(line)
    for case in found:
        for reference in references(study, case):
            _measure(study, reference, records, report, repeats=1)
    comparison = Comparison(study, found, records)
    # Whole files, whatever signal comes.
    with interrupts.held():
        files = [records.table.path, *comparison.write(folder)]
        return files + draw(study, comparison, folder)


def _measure(study: Study, case: Case, records: Records, report: Report, repeats: int | None = None) -> bool:
    """Runs a case as often as it lacks; whether finer ones of its curve are worth trying."""
    wanted = study.repeats if repeats is None else repeats
    while True:
        done = records.of(case)
        if done and (not done[0].converged or done[0].seconds > study.repeat_below or len(done) >= wanted):
            return done[0].entries["status"] != "timeout"
        measured = _run(study, case)
        entries = measured | {
            "curve": case.curve,
            "solver": case.solver,
            "ranks": case.ranks,
            "settings": case.line,
            "repeat": len(done) + 1,
        }
        record = records.append(case, entries, measured["values"])
        report(_line(study, case, record))


def _run(study: Study, case: Case) -> dict[str, Any]:
    """What the process of a case measured, by the names of `elastune.app.studies.worker.Measured`."""
    request = {
        "name": f"{study.name}.toml",
        "scene": case.scene.model_dump(exclude_unset=True),
        "solver": case.solver,
        "manufactured": study.reference.manufactured,
        "quantities": {name: quantity.model_dump(exclude_none=True) for name, quantity in study.quantities.items()},
    }
    nothing: dict[str, Any] = {
        "element": case.scene.element,
        "cells": 0,
        "dofs": 0,
        "newton": 0,
        "seconds": "nan",
        "memory_mb": "nan",
        "values": {},
    }
    try:
        return nothing | answer("elastune.app.studies.worker", request, case.ranks, study.timeout)
    except CaseFailure as failure:
        return nothing | {"status": failure.status, "message": str(failure)}


def _line(study: Study, case: Case, record: Record) -> str:
    entries = record.entries
    telling = {name: value for name, value in case.settings.items() if name in REFINEMENT}
    words = [case.curve, case.panel, *(f"{name} = {value}" for name, value in telling.items())]
    head = ", ".join(word for word in words if word)
    if not record.converged:
        return f"{head}: {entries['status']}: {entries['message']}"
    value = record.values.get(study.plot, float("nan"))
    return f"{head}: {entries['dofs']} unknowns, {record.seconds:.3g} s, {study.plot} {value:.6g}"
