"""A table of cases: one row a run, appended as it ends, so that what was interrupted goes on where it stopped."""

import csv
import fcntl
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from elastune.app.errors import UserError

Row = dict[str, str]

# The column that tells what a row is the result of: a hash of the case as it was solved.
KEY = "key"


class Table:
    """A CSV file that several processes may append to.

    A row is a line, so that one that a crash cut off spoils no other. Rows whose key is not asked for stay in the
    file, and nobody takes them for results.

    Attributes:
        path: The file.
        columns: Of the file.
    """

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        """Reads what is there, and makes the file and its folder if there is nothing.

        Args:
            path: The file.
            columns: Beside `KEY`.

        Raises:
            UserError: If the file has other columns, or cannot be read or written.
        """
        self.path, self.columns = path, [KEY, *columns]
        self.refresh()

    def refresh(self) -> None:
        """Reads the rows again, which others may have added.

        Raises:
            UserError: As at first.
        """
        with self._locked() as file:
            _, *lines = self._mended(file).decode(errors="replace").splitlines()
        self._rows: dict[str, list[Row]] = {}
        for line in lines:
            entries = next(csv.reader([line]), [])
            if len(entries) == len(self.columns):
                row = dict(zip(self.columns, entries, strict=True))
                self._rows.setdefault(row[KEY], []).append(row)

    def of(self, key: str) -> list[Row]:
        """The rows of a case, oldest first."""
        return self._rows.get(key, [])

    def append(self, key: str, values: Mapping[str, object]) -> Row:
        """Adds a row; a column without a value stays empty.

        Raises:
            UserError: If the file cannot be written.
        """
        given = {KEY: key} | {name: value for name, value in values.items() if value is not None}
        row = {name: " ".join(str(given.get(name, "")).splitlines()) for name in self.columns}
        with self._locked() as file:
            self._mended(file)
            file.write(_line(row.values()))
        self._rows.setdefault(key, []).append(row)
        return row

    @contextmanager
    def _locked(self) -> Iterator[BinaryIO]:
        """The file at its end, while other processes wait."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("ab+") as file:
                fcntl.flock(file, fcntl.LOCK_EX)
                yield file
        except OSError as error:
            raise UserError(f"{self.path}: cannot be written: {error.strerror or error}") from None

    def _mended(self, file: BinaryIO) -> bytes:
        """What is in the file, header first, after a last row that a crash cut off is taken away: it is run again."""
        file.seek(0)
        header, content = _line(self.columns), file.read()
        if content and content.partition(b"\n")[0] + b"\n" != header:
            raise UserError(f"{self.path}: is another table; remove it, or choose another --out")
        whole = content[: content.rfind(b"\n") + 1]
        if whole != content:
            file.truncate(len(whole))
        if whole:
            return whole
        file.write(header)
        return header


def _line(entries: Iterable[str]) -> bytes:
    """Entries without line breaks as a line of the file."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(entries)
    return text.getvalue().encode()
