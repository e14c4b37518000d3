"""The only file that writes results: a run's folder, whole after every step."""

import csv
import io
import json
import logging
import math
import platform
import resource
import sys
import tempfile
import tomllib
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar

import dolfinx
import numpy as np
from mpi4py import MPI

from elastune.app.errors import SceneError, UserError
from elastune.app.results.fields import Fields
from elastune.app.results.pictures import curve as plots
from elastune.app.results.record import Step, Summary
from elastune.app.results.xdmf import FieldFile, WholeMesh, replace_text
from elastune.app.scene.schema import Scene
from elastune.forms.energy import Energy
from elastune.forms.volumetric import Split

T = TypeVar("T")
Row = dict[str, float | int | None]

FILES = ("summary.json", "history.csv", "fields.xdmf", "fields.h5", "curve.png", "deformed.png")

log = logging.getLogger("elastune")


class Output:
    """The results of one run; every method is collective, and rank 0 writes.

    `history.csv` and the field file grow with every step, `summary.json` and the pictures come at the end. What
    an earlier run left in the folder goes when a new one starts.
    """

    def __init__(self, folder: Path, scene: Scene, comm: MPI.Comm) -> None:
        """Checks that the folder can be made and written, and leaves nothing behind.

        Raises:
            SceneError: On every rank, if it cannot.
        """
        self.folder, self._scene, self._comm = Path(folder), scene, comm
        self._on_root(lambda: _try_folder(self.folder), SceneError)
        self._steps: list[Step] = []
        self._largest: dict[float, float] = {}

    def start(
        self,
        u: dolfinx.fem.Function,
        energy: Energy,
        extension: float | None,
        quadrature: int | None = None,
        mixed: tuple[Split, dolfinx.fem.Function] | None = None,
    ) -> None:
        """Makes the folder and, if the scene asks for fields, writes those of the state before the first step.

        Args:
            u: The displacement; it holds the state whenever a step is written.
            energy: Strain-energy density.
            extension: Stretch below which a singular energy is continued.
            quadrature: Degree of the points where fields are evaluated.
            mixed: Of a mixed element, the energy as it sees it and the pressure.

        Raises:
            UserError: On every rank, if a file cannot be written; the other methods likewise.
        """
        self._mesh = u.function_space.mesh
        self._fields = Fields(u, energy, extension, quadrature, mixed)
        self._on_root(self._clear_folder)
        if self._scene.output.fields:
            whole = self._whole
            self._file = self._on_root(lambda: FieldFile(self.folder, whole))
            self._write_fields(0.0)

    def step(self, step: Step) -> None:
        """Writes a converged step: its row of `history.csv`, and its fields with the load factor as time."""
        self._steps.append(step)
        self._largest[step.load] = self._comm.allreduce(self._fields.largest_displacement(), op=MPI.MAX)
        self._on_root(lambda: self._write_history(self._steps))
        if self._scene.output.fields:
            self._write_fields(step.load)

    def finish(self, summary: Summary) -> list[Path]:
        """Writes what is left, also of a run that failed; adds versions and memory to the summary.

        Returns:
            The files of the run, on rank 0.
        """
        summary.versions = versions()
        summary.peak_memory_mb = _peak_memory_mb(self._comm)
        self._on_root(lambda: self._write_history(summary.steps))
        self._on_root(lambda: self._write_summary(summary))
        if self._scene.output.picture:
            data = self._picture_data()
            self._on_root(lambda: self._draw("curve.png", lambda path: self._curve(path, summary)))
            self._on_root(lambda: self._draw("deformed.png", lambda path: plots.picture(path, data)))
        return self._on_root(lambda: [path for name in FILES if (path := self.folder / name).exists()]) or []

    # ------------------------------------------------------------------ fields

    @cached_property
    def _whole(self) -> WholeMesh:
        return WholeMesh(self._mesh)

    def _write_fields(self, time: float) -> None:
        asked, nodes, whole = self._scene.output.fields, {}, self._whole
        if "displacement" in asked:
            nodes["displacement"] = whole.nodes_to_root(self._fields.displacement())
        own = self._fields.cells(name for name in asked if name != "displacement")
        cells = {name: whole.cells_to_root(values) for name, values in own.items()}
        self._on_root(lambda: self._file.write(time, nodes, cells) if self._file else None)

    def _picture_data(self) -> dict[str, Any]:
        """The present shape and what colours it: the first of these fields asked for, or the displacement."""
        whole, asked = self._whole, self._scene.output.fields
        displacement = whole.nodes_to_root(self._fields.displacement())
        name = next((name for name in ("von_mises", "J", "energy") if name in asked), None)
        if name is None:
            values = np.linalg.norm(displacement, axis=1)
        else:
            values = whole.cells_to_root(self._fields.cells([name])[name])
        labels = {None: "displacement", "von_mises": "von Mises stress", "J": "volume ratio J"}
        return {
            "points": whole.points,
            "cells": whole.cells,
            "vtk_type": whole.vtk_type,
            "displacement": displacement,
            "values": values,
            "label": labels.get(name, name),
        }

    # ------------------------------------------------------------------ on rank 0

    def _clear_folder(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        for name in FILES:
            (self.folder / name).unlink(missing_ok=True)

    def _write_history(self, steps: list[Step]) -> None:
        rows = [self._row(step) for step in steps]
        table = io.StringIO()
        writer = csv.DictWriter(table, list(rows[0]) if rows else ["load"], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        replace_text(self.folder / "history.csv", table.getvalue())

    def _write_summary(self, summary: Summary) -> None:
        document = summary.as_dict()
        for step in document["steps"]:
            step["max_displacement"] = self._largest.get(step["load"])
        text = json.dumps(_finite(document), indent=2, allow_nan=False)
        replace_text(self.folder / "summary.json", text + "\n")

    def _row(self, step: Step) -> Row:
        """A step as columns; reactions as reaction_FACE_x and so on."""
        row: Row = {}
        for name in Step.__dataclass_fields__:
            value = getattr(step, name)
            if name == "reaction":
                for face, force in value.items():
                    row |= {f"reaction_{face}_{axis}": part for axis, part in zip("xyz", force, strict=False)}
            else:
                row[name] = value
        return row | {"max_displacement": self._largest.get(step.load)}

    def _curve(self, path: Path, summary: Summary) -> None:
        scene = self._scene
        labels, points = plots.curve_points(scene.boundary, scene.body, summary.steps, self._largest)
        title = scene.title or scene.name
        if summary.failure is not None:
            title += f"\nstopped before load {summary.failure.load:.4g}: {summary.failure.kind}"
        plots.curve(path, points, labels, title)

    def _draw(self, name: str, draw: Callable[[Path], None]) -> None:
        """A picture that cannot be made is a warning: the numbers are there."""
        try:
            draw(self.folder / name)
        except Exception as problem:
            log.warning("%s was not drawn: %s", name, " ".join(str(problem).split()) or type(problem).__name__)

    def _on_root(self, task: Callable[[], T], kind: type[UserError] = UserError) -> T | None:
        """Runs a task on rank 0, which has its result; what goes wrong there is raised on every rank."""
        result, reason, cause = None, None, None
        if self._comm.rank == 0:
            try:
                result = task()
            # Ranks that wait for rank 0 would wait for ever.
            except Exception as problem:
                reason = getattr(problem, "strerror", None) or " ".join(str(problem).split())
                cause = problem
        reason = self._comm.bcast(reason)
        # A full disk, HDF5's own errors, no h5py; anything else is a mistake of ours.
        if cause is not None and not isinstance(cause, OSError | RuntimeError | ImportError):
            raise cause
        if reason is not None:
            raise kind(f"{self.folder}: cannot be written: {reason}") from cause
        return result


def versions() -> dict[str, str]:
    """Releases of what computed the results."""
    from petsc4py import PETSc

    return {
        "elastune": _own_version(),
        "dolfinx": dolfinx.__version__,
        "petsc": ".".join(map(str, PETSc.Sys.getVersion())),  # type: ignore[attr-defined]
        "python": platform.python_version(),
    }


def _own_version() -> str:
    # A checkout says its own; an installed older release must not answer for it.
    project = Path(__file__).parents[2] / "pyproject.toml"
    if project.is_file():
        return str(tomllib.loads(project.read_text(encoding="utf-8"))["project"]["version"])
    return metadata.version("elastune")


def _peak_memory_mb(comm: MPI.Comm) -> float:
    """Sum over the ranks of the most memory that each has had, in 10⁶ bytes."""
    unit = 1 if sys.platform == "darwin" else 1024
    return comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6)


def _finite(value: Any) -> Any:
    """JSON has no infinity and no NaN: null."""
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _try_folder(folder: Path) -> None:
    """Makes the folder and a file in it, and removes both: permissions alone do not tell.

    Raises:
        OSError: If that fails.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    finally:
        for path in made:
            with suppress(OSError):
                path.rmdir()
