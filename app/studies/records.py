"""The runs of a study, in `cases.csv` of its folder."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from elastune.app.batch.store import KEY, Row, Table
from elastune.app.scene.write import digest
from elastune.app.studies.cases import Case
from elastune.app.studies.schema import NORMS, Study

COLUMNS = (
    "curve",
    "solver",
    "ranks",
    "settings",
    "repeat",
    "status",
    "message",
    "element",
    "cells",
    "dofs",
    "newton",
    "seconds",
    "memory_mb",
)


@dataclass(frozen=True)
class Record:
    """One run.

    Attributes:
        entries: By column of `COLUMNS`.
        values: Energy, volume_ratio, quantities, or errors.
    """

    entries: Row
    values: dict[str, float]

    @property
    def converged(self) -> bool:
        """Whether the run came to its end."""
        return self.entries["status"] == "converged"

    @property
    def seconds(self) -> float:
        """Wall time; NaN of a run that did not come to its end."""
        return float(self.entries["seconds"])


def key(study: Study, case: Case) -> str:
    """What tells a case from others, and from itself in another version of the study, the scene or Elastune."""
    quantities = {name: quantity.model_dump(exclude_none=True) for name, quantity in study.quantities.items()}
    parts = [digest(case.scene), case.solver, case.ranks, study.reference.manufactured, quantities]
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


class Records:
    """The table of a study's folder."""

    def __init__(self, study: Study, folder: Path) -> None:
        """Reads what is there.

        Raises:
            UserError: If the file is of another study, or cannot be read or written.
        """
        self._study = study
        self._names = ["energy", "volume_ratio", *(NORMS if study.reference.manufactured else study.quantities)]
        self.table = Table(folder / "cases.csv", [*COLUMNS, *self._names])

    def of(self, case: Case) -> list[Record]:
        """The runs of a case."""
        return [self._record(row) for row in self.table.of(key(self._study, case))]

    def append(self, case: Case, entries: dict[str, Any], values: dict[str, float]) -> Record:
        """Adds a run."""
        numbers = {name: repr(values[name]) for name in self._names if name in values}
        return self._record(self.table.append(key(self._study, case), entries | numbers))

    def _record(self, row: Row) -> Record:
        entries = {name: row[name] for name in (KEY, *COLUMNS)}
        return Record(entries, {name: float(row[name]) for name in self._names if row[name]})
