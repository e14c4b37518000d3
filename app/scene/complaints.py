"""Tables of our files, read strictly, and what pydantic has against one, in a line."""

import re
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError

from elastune.app.errors import meant


class Table(BaseModel):
    """A table with no other keys than those that it names; what is read cannot be changed."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


def complaint(error: ValidationError, data: dict[str, Any], model: type[Table], what: str) -> str:
    """The most telling of pydantic's complaints in one line: key = value: what was expected.

    Args:
        error: All of them.
        data: The tables that were read.
        model: What they were to be.
        what: What a file of them is called, e.g. "scene".
    """
    problem = _most_telling(error.errors(include_url=False), data)
    location, kind, given = problem["loc"], problem["type"], problem["input"]
    keys = _keys(location, data, missing=kind == "missing")
    key = ".".join(map(str, keys)) or what
    if kind == "extra_forbidden":
        return f"{key}: unknown key; {_expected(model, keys)}"
    if kind == "missing":
        owner = next((name for name in reversed(keys[:-1]) if isinstance(name, str)), what)
        return f"{key}: missing; every {owner} needs it"
    message = problem["msg"].removeprefix("Value error, ")
    if kind in ("model_type", "dict_type"):
        message = "expected a table of keys"
    if kind == "literal_error" and (words := re.findall(r"'([^']*)'", problem["ctx"]["expected"])):
        message = meant(given, words)
    shown = "" if isinstance(given, dict) or repr(given) in message else f" = {given!r}"
    return f"{key}{shown}: {message[:1].lower()}{message[1:]}"


def _most_telling(problems: list[Any], data: dict[str, Any]) -> Any:
    """The first; but an unknown key may be why one is missing, and of a union the longest branch says most."""
    unknown = [problem for problem in problems if problem["type"] == "extra_forbidden"]
    if unknown and problems[0]["type"] == "missing":
        return unknown[0]
    paths = [_keys(problem["loc"], data, missing=problem["type"] == "missing") for problem in problems]
    of_one = [(path, problem) for path, problem in zip(paths, problems, strict=True) if _along(path, paths[0])]
    # Our own words say more than that it is no number, and a key that nobody knows more than that one is missing.
    rank = {"value_error": 2, "extra_forbidden": 1}
    return max(of_one, key=lambda pair: (len(pair[0]), rank.get(pair[1]["type"], 0)))[1]


def _along(path: list[Any], other: list[Any]) -> bool:
    """Whether one path goes on where the other ends."""
    return all(one == two for one, two in zip(path, other, strict=False))


def _keys(location: tuple[Any, ...], data: Any, missing: bool) -> list[Any]:
    """A location without what is pydantic's own, such as the branches of a union."""
    keys: list[Any] = []
    for part in location[:-1] if missing else location:
        if (isinstance(data, dict) and part in data) or (isinstance(data, list) and isinstance(part, int)):
            keys.append(part)
            data = data[part]
    return [*keys, location[-1]] if missing else keys


def _expected(model: type[Table], keys: list[Any]) -> str:
    """What an unknown key may have been meant for."""
    owners: list[Any] = [model]
    for key in keys[:-1]:
        owners = [branch for owner in owners for branch in branches(_within(owner, key))]
    known = [owner for owner in owners if isinstance(owner, type) and issubclass(owner, BaseModel)]
    names = [name for owner in known for name, field in owner.model_fields.items() if not field.exclude]
    return meant(keys[-1], names)


def _within(annotation: Any, key: Any) -> Any:
    """The annotation of what a key of a table, or a place in a list, holds."""
    if get_origin(annotation) in (dict, list):
        return get_args(annotation)[-1]
    field = getattr(annotation, "model_fields", {}).get(key)
    return None if field is None else field.annotation


def branches(annotation: Any) -> list[Any]:
    """The annotations that a union is made of."""
    if get_origin(annotation) is Annotated:
        return branches(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return [found for branch in get_args(annotation) for found in branches(branch)]
    return [annotation]
