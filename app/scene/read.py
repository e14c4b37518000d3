"""Reads scenes from TOML, and says in one line what is wrong with them."""

import difflib
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from elastune.app.errors import SceneError
from elastune.app.scene import files as toml
from elastune.app.scene.check import check
from elastune.app.scene.schema import Condition, Material, Scene

SHIPPED = Path(__file__).parent / "shipped"


def load(source: str, overrides: Iterable[str] = ()) -> Scene:
    """Reads a shipped scene by name, or a scene file, and checks it.

    Args:
        source: Path of a TOML file, or the name of a shipped scene.
        overrides: Assignments `key.key=value` with TOML values, applied before the check.

    Raises:
        UserError: One line with file, key and what was expected.
    """
    path, data = toml.read(source, SHIPPED, "scene")
    for assignment in overrides:
        override(data, assignment)
    return parse(data, path)


def shipped() -> list[str]:
    """Names of the shipped scenes."""
    return toml.names(SHIPPED)


def parse(data: dict[str, Any], path: Path) -> Scene:
    """Checks a scene given as nested tables.

    Args:
        data: Tables as TOML gives them.
        path: Where they come from: its name is the scene's, and mesh files are relative to it.

    Raises:
        SceneError: One line with file, key and what was expected.
    """
    try:
        scene = Scene.model_validate({**data, "name": path.stem} if "name" not in data else data)
    except ValidationError as error:
        raise SceneError(f"{path.name}: {_first(error, data)}") from None
    mesh = scene.mesh
    if mesh.path is not None and not Path(mesh.path).is_absolute():
        mesh = mesh.model_copy(update={"path": str(path.parent / mesh.path)})
        scene = scene.model_copy(update={"mesh": mesh})
    try:
        check(scene)
    except SceneError as error:
        raise SceneError(f"{path.name}: {error}") from None
    return scene


def override(data: dict[str, Any], assignment: str) -> None:
    """Applies an assignment `key.key=value`, with a TOML value or a bare word, to nested tables.

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
    table = data
    for part in names[:-1]:
        table = table.setdefault(part, {})
        if not isinstance(table, dict):
            raise SceneError(f"--set {assignment}: {part} is not a table")
    table[names[-1]] = value


def _first(error: ValidationError, data: dict[str, Any]) -> str:
    """The first of pydantic's complaints in one line: key = value: what was expected."""
    problems = error.errors(include_url=False)
    # Of a union, the branch that got furthest says most.
    problem = max(problems, key=lambda p: len(p["loc"])) if _is_union(problems) else problems[0]
    location = [str(part) for part in problem["loc"] if _in_data(part)]
    key = ".".join(location) or "scene"
    kind, given = problem["type"], problem["input"]
    if kind == "extra_forbidden":
        return f"{key}: unknown key; {_expected_keys(problem['loc'])}"
    if kind == "missing":
        return f"{key}: missing; every scene needs it"
    message = problem["msg"].removeprefix("Value error, ")
    if kind in ("model_type", "dict_type"):
        message = "expected a table of keys"
    shown = "" if isinstance(given, dict) else f" = {given!r}"
    return f"{key}{shown}: {message[:1].lower()}{message[1:]}"


def _is_union(problems: list[Any]) -> bool:
    first = problems[0]["loc"]
    return all(problem["loc"][: len(first) - 1] == first[:-1] for problem in problems) and len(problems) > 1


def _in_data(part: object) -> bool:
    # Names of union branches, such as "list[constrained-float]", are pydantic's own.
    return isinstance(part, int) or (part.isidentifier() and part not in ("float", "int", "str"))  # type: ignore[attr-defined]


def _expected_keys(location: tuple[Any, ...]) -> str:
    model: Any = Scene
    for part in location[:-1]:
        field = getattr(model, "model_fields", {}).get(part)
        if field is None:
            model = Condition if model is Scene or model is dict else model
            continue
        candidates = [field.annotation, *getattr(field.annotation, "__args__", ())]
        model = next((c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel)), dict)
    names = [
        name for name in getattr(model, "model_fields", Condition.model_fields) if name != "name" or model is Material
    ]
    near = difflib.get_close_matches(str(location[-1]), names, 1)
    return f"did you mean {near[0]}?" if near else f"expected one of {', '.join(names)}"
