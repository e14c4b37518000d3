"""Sets keys of nested tables by their dotted names."""

import tomllib
from typing import Any

from elastune.app.errors import SceneError


def assign(data: dict[str, Any], key: str, value: Any) -> None:
    """Sets a dotted key; tables on the way are made if needed.

    Raises:
        SceneError: If a key on the way is not a table.
    """
    *parents, last = key.split(".")
    table = data
    for part in parents:
        table = table.setdefault(part, {})
        if not isinstance(table, dict):
            raise SceneError(f"{key}: {part} is not a table")
    table[last] = value


def override(data: dict[str, Any], assignment: str) -> None:
    """Applies an assignment `key.key=value`, with a TOML value or a bare word.

    Raises:
        SceneError: If it is no assignment, or a key on the way is not a table.
    """
    key, equals, text = assignment.partition("=")
    names = [part.strip() for part in key.split(".")]
    if not equals or not all(names):
        raise SceneError(f"--set {assignment}: expected key.key=value")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        # A bare word is a string: --set material.name=hencky.
        value = text.strip()
    try:
        assign(data, ".".join(names), value)
    except SceneError as error:
        raise SceneError(f"--set {error}") from None
