"""What a scene may say: every key with its kind, default, meaning and unit, from the schema itself."""

from collections.abc import Iterator
from dataclasses import dataclass
from types import NoneType
from typing import Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from elastune.app.scene.complaints import Table, branches
from elastune.app.scene.schema import Scene

# What ends the description of a key that is a number.
UNITS = (
    "–",
    "length",
    "stress",
    "stress or –",
    "stress/length",
    "force",
    "force × length",
    "force/length³",
    "degrees",
    "s",
)

# Words for what a value is, one and many.
_WORDS = {
    float: ("number", "numbers"),
    int: ("whole number", "whole numbers"),
    str: ("text", "texts"),
    bool: ("true or false", "of true or false"),
    Any: ("value", "values"),
}


@dataclass(frozen=True)
class Key:
    """A key of a scene.

    Attributes:
        path: With its tables, NAME for a name of the scene's own, [] for each of a list of tables.
        kind: What its value is.
        default: As in TOML; "needed" without one, "–" where leaving it out is a value of its own.
        meaning: In a phrase.
        unit: Of the scene's own: length, force, stress …; "–" for pure numbers, nothing for words and tables.
    """

    path: str
    kind: str
    default: str
    meaning: str
    unit: str


def keys(model: type[Table] = Scene, prefix: str = "", told: dict[Any, str] | None = None) -> Iterator[Key]:
    """All keys of a table, depth first; a table that stands in several places is told in the first.

    Args:
        model: The table.
        prefix: Before its keys.
        told: Where tables were told so far.
    """
    told = {} if told is None else told
    told[model] = prefix.rstrip(".")
    for name, field in model.model_fields.items():
        if field.exclude:
            continue
        path = prefix + name
        meaning, unit = _told(field.description or "")
        inner = list(_tables(field.annotation, path))
        known = next((told[table] for _, table in inner if table in told), None)
        words = _kind(field.annotation) if known is None else f"as {known}"
        yield Key(path, words, _default(field), meaning, unit)
        if known is None:
            for where, table in inner:
                yield from keys(table, f"{where}.", told)


def schema() -> dict[str, Any]:
    """JSON schema of a scene, for editors."""
    found = Scene.model_json_schema()
    found["title"] = "Elastune scene"
    # The file's own name, which it does not say.
    del found["properties"]["name"]
    return found


def _told(description: str) -> tuple[str, str]:
    """Meaning and unit."""
    meaning, _, unit = description.rpartition("; ")
    return (meaning, unit) if unit in UNITS else (description, "")


def _tables(annotation: Any, path: str) -> Iterator[tuple[str, type[Table]]]:
    """The tables that a value may hold, and how their keys begin."""
    for branch in branches(annotation):
        if get_origin(branch) is dict:
            yield from _tables(get_args(branch)[1], f"{path}.NAME")
        elif get_origin(branch) is list:
            yield from _tables(get_args(branch)[0], f"{path}[]")
        elif isinstance(branch, type) and issubclass(branch, Table):
            yield path, branch


def _kind(annotation: Any, many: bool = False) -> str:
    words = [_word(branch, many) for branch in branches(annotation) if branch is not NoneType]
    return " or ".join(dict.fromkeys(words))


def _word(branch: Any, many: bool) -> str:
    if get_origin(branch) is Literal:
        return " | ".join("true" if value is True else _text(value) for value in get_args(branch))
    if get_origin(branch) is list:
        inner = get_args(branch)[0]
        return "tables [[…]]" if any(_tables(inner, "")) else f"list of {_kind(inner, many=True)}"
    if get_origin(branch) is dict:
        inner = get_args(branch)[1]
        return "tables by name" if any(_tables(inner, "")) else f"{_kind(inner, many=True)} by name"
    if isinstance(branch, type) and issubclass(branch, Table):
        return "table"
    return _WORDS[branch][many]


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "needed"
    value = field.default
    if value is None or isinstance(value, Table) or value in ({}, [], ""):
        return "–"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(map(_text, value))}]"
    return _text(value)


def _text(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"
