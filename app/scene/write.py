"""Scenes as text: what was solved, with nothing left to defaults, and a key of it."""

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import tomli_w

from elastune import __version__
from elastune.app.scene.schema import Scene


def resolved(scene: Scene, element: str | None = None) -> dict[str, Any]:
    """The tables of a scene with every default filled in; what is None has no default, and stays out.

    Args:
        scene: The scene.
        element: What "auto" turned out to be; as it is unless given.
    """
    data = {"name": scene.name, **scene.model_dump(exclude_none=True)}
    if element is not None:
        data["solve"]["element"] = element
    if scene.mesh.path is None:
        data["mesh"]["cell"] = scene.cell
    else:
        data["mesh"]["path"] = os.path.abspath(scene.mesh.path)
        # Only the file tells.
        data["mesh"].pop("cell", None)
    return data


def text(scene: Scene, element: str | None = None) -> str:
    """A scene as TOML that `elastune run` takes from anywhere, see `resolved`."""
    return tomli_w.dumps(resolved(scene, element))


def digest(scene: Scene) -> str:
    """A key of what a scene computes: its tables, the content of its mesh file, and our version.

    It is the same in every process, whatever the order of keys. Name, title and output, which change no number, and
    the place of the mesh file are no part of it.

    Raises:
        OSError: If the mesh file cannot be read.
    """
    data = resolved(scene)
    for name in ("name", "title", "output"):
        data.pop(name)
    path = data["mesh"].pop("path", None)
    content = "" if path is None else hashlib.sha256(Path(path).read_bytes()).hexdigest()
    whole = json.dumps([__version__, content, data], sort_keys=True)
    return hashlib.sha256(whole.encode()).hexdigest()[:16]
