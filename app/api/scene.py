"""Scenes in Python, and the solution of scenes and bodies."""

from collections.abc import Mapping
from os import PathLike
from typing import Any, overload

import numpy as np
from mpi4py import MPI

from elastune.app.body.body import Body
from elastune.app.errors import UserError
from elastune.app.run import Run, start
from elastune.app.scene import files
from elastune.app.scene.override import assign
from elastune.app.scene.read import SHIPPED, parse
from elastune.app.scene.schema import Scene
from elastune.app.solvers.options import Options


def scene(source: str | PathLike[str], changes: Mapping[str, Any] | None = None) -> Scene:
    """A shipped scene by name, or a scene file, checked.

    Args:
        source: Path of a TOML file, or the name of a shipped scene.
        changes: Values by key, as in `{"mesh.cells": 4, "boundary.right": {"move": [1, 0, 0]}}`.

    Raises:
        UserError: One line with file, key and what was expected.
    """
    path, data = files.read(str(source), SHIPPED, "scene")
    for key, value in (changes or {}).items():
        assign(data, key, _plain(value))
    return parse(data, path)


@overload
def solve(problem: Scene, *, comm: MPI.Comm | None = None) -> Run: ...


@overload
def solve(problem: Body, options: Options | None = None) -> Run: ...


def solve(problem: Scene | Body, options: Options | None = None, comm: MPI.Comm | None = None) -> Run:
    """A run, which is solved as it is iterated, or when its results are first asked for.

    Args:
        problem: What to solve.
        options: Of a body, how; a scene says so itself.
        comm: Of a scene, who takes part, all ranks by default; a body has that of its mesh.

    Raises:
        UserError: If the scene is impossible, or what is given does not belong to the problem.
    """
    if isinstance(problem, Body):
        if comm is not None:
            raise UserError("comm: expected none with a body, which has that of its mesh")
        return Run(problem, options)
    if options is not None:
        raise UserError('options: expected none with a scene, which has its own, e.g. {"solve.steps": 4}')
    return start(problem, MPI.COMM_WORLD if comm is None else comm)


def _plain(value: Any) -> Any:
    """What TOML would have given: no tuples, and no numbers and arrays of numpy."""
    if isinstance(value, Mapping):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return str(value) if isinstance(value, PathLike) else value
