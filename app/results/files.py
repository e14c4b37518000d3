"""Files that are at any time whole: written aside, brought to the disk, and renamed."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def aside(path: Path) -> Iterator[Path]:
    """A file to write, which takes the place of another when it is done; if it fails the other stays.

    Raises:
        OSError: If it cannot be written.
    """
    part = _part(path)
    try:
        yield part
        with part.open("rb") as file:
            os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def replace_bytes(path: Path, content: bytes) -> None:
    """Writes a file.

    Raises:
        OSError: If it cannot be written; the old file is there then.
    """
    with aside(path) as part:
        part.write_bytes(content)


def replace_text(path: Path, text: str) -> None:
    """Writes a text file, see `replace_bytes`."""
    replace_bytes(path, text.encode())


def remove(path: Path) -> None:
    """Removes a file, if it is there, and what a run that was killed has left aside.

    Raises:
        OSError: If it cannot be removed.
    """
    for name in (path, _part(path), _part(_part(path))):
        name.unlink(missing_ok=True)


class GrowingText:
    """A text file that grows before its last lines, for no more than it costs to write what is new.

    Two copies take turns: what is new goes to the one that nobody sees, which then takes the other's name. Where a
    file cannot have two names there is one copy, and all of it is written again.
    """

    def __init__(self, path: Path, head: str, tail: str = "") -> None:
        """Writes nothing yet.

        Args:
            path: The file.
            head: First lines.
            tail: Last lines, after all that is added.
        """
        self._path, self._tail = path, tail.encode()
        self._chunks = [head.encode()]
        # Of the copy in sight and the one aside: how many chunks it has, and how many bytes they are.
        self._seen = self._aside = (0, 0)

    def add(self, text: str) -> None:
        """Adds to the file.

        Raises:
            OSError: If it cannot be written; the file is then as it was.
        """
        chunks, (count, start) = [*self._chunks, text.encode()], self._aside
        part, other, new = _part(self._path), _part(_part(self._path)), b"".join(chunks[count:])
        with part.open("r+b" if count else "wb") as file:
            file.seek(start)
            file.write(new + self._tail)
            file.truncate()
            file.flush()
            os.fsync(file.fileno())
        other.unlink(missing_ok=True)
        with suppress(OSError):
            os.link(self._path, other)
        part.replace(self._path)
        self._chunks, self._aside = chunks, (0, 0)
        if other.exists():
            other.replace(part)
            self._aside = self._seen
        self._seen = len(chunks), start + len(new)

    def close(self) -> None:
        """Leaves one copy."""
        _part(self._path).unlink(missing_ok=True)
        self._aside = (0, 0)


def _part(path: Path) -> Path:
    return path.with_name(f".{path.name.removeprefix('.')}.part")
