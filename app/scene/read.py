"""Reads scenes from TOML, and says in one line what is wrong with them."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from elastune.app.errors import SceneError
from elastune.app.scene import files as toml
from elastune.app.scene.check import check
from elastune.app.scene.complaints import complaint
from elastune.app.scene.override import override
from elastune.app.scene.schema import Scene

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
        scene = Scene.model_validate({"name": path.stem, **data})
    except ValidationError as error:
        raise SceneError(f"{path.name}: {complaint(error, data, Scene, 'scene')}") from None
    mesh = scene.mesh
    if mesh.path is not None and not Path(mesh.path).is_absolute():
        mesh = mesh.model_copy(update={"path": str(path.parent / mesh.path)})
        scene = scene.model_copy(update={"mesh": mesh})
    try:
        check(scene)
    except SceneError as error:
        raise SceneError(f"{path.name}: {error}") from None
    return scene
