"""The raw table of a study: one row a run, appended as it ends, so that a study goes on where it stopped."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from elastune.app.errors import UserError
from elastune.app.studies.cases import Case

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

Key = tuple[str, int, str]


@dataclass(frozen=True)
class Record:
    """One run, as text or numbers.

    Attributes:
        entries: By column of `COLUMNS`.
        values: Energy, volume_ratio, quantities, or errors.
    """

    entries: dict[str, str]
    values: dict[str, float]

    @property
    def key(self) -> Key:
        """Solver, ranks and settings: what tells cases apart."""
        return self.entries["solver"], int(self.entries["ranks"]), self.entries["settings"]

    @property
    def converged(self) -> bool:
        """Whether the run came to its end."""
        return self.entries["status"] == "converged"

    @property
    def seconds(self) -> float:
        """Wall time; NaN of a run that did not come to its end."""
        return float(self.entries["seconds"])


def key_of(case: Case) -> Key:
    """The key that a case's records have."""
    return case.solver, case.ranks, case.key


class Records:
    """`cases.csv` of a study's folder."""

    def __init__(self, path: Path, names: Sequence[str]) -> None:
        """Reads what is there.

        Args:
            path: The file; it need not exist.
            names: Columns after `COLUMNS`.

        Raises:
            UserError: If the file is of another study, or cannot be read or written.
        """
        self.path, self.header = path, [*COLUMNS, *names]
        self.all: list[Record] = []
        try:
            if not path.exists() or path.stat().st_size == 0:
                path.parent.mkdir(parents=True, exist_ok=True)
                self._write(self.header, "w")
                return
            with path.open(newline="", encoding="utf-8") as file:
                header, *rows = csv.reader(file)
        except OSError as error:
            raise UserError(f"{path}: cannot be written: {error.strerror or error}") from None
        if header != self.header:
            raise UserError(f"{path}: is the table of another study; remove it, or choose another --out")
        # A last row cut off by a crash is run again.
        self.all = [self._parse(row) for row in rows if len(row) == len(header)]

    def of(self, key: Key) -> list[Record]:
        """The runs of one case."""
        return [record for record in self.all if record.key == key]

    def append(self, entries: dict[str, object], values: dict[str, float]) -> Record:
        """Adds a run to the file."""
        row = [str(entries[name]) for name in COLUMNS]
        row += [repr(values[name]) if name in values else "" for name in self.header[len(COLUMNS) :]]
        self._write(row, "a")
        self.all.append(self._parse(row))
        return self.all[-1]

    def _write(self, row: Sequence[str], mode: str) -> None:
        with self.path.open(mode, newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerow(row)

    def _parse(self, row: Sequence[str]) -> Record:
        entries = dict(zip(COLUMNS, row, strict=False))
        given = zip(self.header[len(COLUMNS) :], row[len(COLUMNS) :], strict=True)
        return Record(entries, {name: float(text) for name, text in given if text})
