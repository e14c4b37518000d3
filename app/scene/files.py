"""TOML files by path, or by name where we ship them."""

import difflib
import tomllib
from pathlib import Path
from typing import Any

from elastune.app.errors import UserError


def names(folder: Path) -> list[str]:
    """Names of the files that a folder ships."""
    return sorted(path.stem for path in folder.glob("*.toml"))


def read(source: str, folder: Path, kind: str) -> tuple[Path, dict[str, Any]]:
    """Reads a file.

    Args:
        source: Its path, or the name of a shipped one.
        folder: Of the shipped ones.
        kind: What it is called in errors, e.g. "scene".

    Returns:
        Its path and its tables.

    Raises:
        UserError: One line, if there is no such file, or it is not TOML.
    """
    path = Path(source)
    if path.suffix != ".toml" and not path.is_file():
        path = folder / f"{source}.toml"
        if not path.is_file():
            near = difflib.get_close_matches(source, names(folder), 1)
            hint = f"did you mean {near[0]}?" if near else f"shipped are {', '.join(names(folder))}"
            raise UserError(f"{source}: no {kind} of that name and no such file; {hint}")
    try:
        return path, tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: not TOML: {error}") from None
