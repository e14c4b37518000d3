"""The only file that writes results: a folder that is complete after every step."""

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

from app import plots
from app.errors import SceneError, UserError
from app.fields import CELL_FIELDS, Fields
from app.results import Step, Summary
from app.scene import Scene
from app.xdmf import FieldFile, WholeMesh, replace_text
from forms.energy import Energy

T = TypeVar("T")

SUMMARY, HISTORY, CURVE, PICTURE = "summary.json", "history.csv", "curve.png", "deformed.png"
FILES = (SUMMARY, HISTORY, "fields.xdmf", "fields.h5", CURVE, PICTURE)
log = logging.getLogger("elastune")


class Output:
    """The results of one run.

    `history.csv` and the field file are whole after every step, `summary.json` and the pictures come at the
    end. What an earlier run left in the folder is removed when a new one starts. Every method is collective;
    rank 0 writes.
    """

    def __init__(self, folder: Path, scene: Scene, comm: MPI.Comm) -> None:
        """Checks that the folder can be made and written, and leaves nothing behind.

        Raises:
            SceneError: On every rank, if it cannot.
        """
        self.folder, self._scene, self._comm = Path(folder), scene, comm
        self._root(lambda: _try_folder(self.folder), SceneError)
        self._steps: list[Step] = []
        self._largest: dict[float, float] = {}

    def start(self, u: dolfinx.fem.Function, energy: Energy, extension: float | None) -> None:
        """Opens the field file, if the scene asks for fields, and writes the state before the first step.

        Args:
            u: The displacement; it holds the state whenever a step is written.
            energy: Strain-energy density.
            extension: Stretch below which a singular energy is continued.

        Raises:
            UserError: On every rank, if a file cannot be written; so do the other methods.
        """
        self._fields = Fields(u, energy, extension, self._scene.solve.quadrature)
        self._mesh = u.function_space.mesh
        self._file: FieldFile | None = None
        self._root(self._make_folder)
        if self._scene.output.fields:
            self._file = self._root(lambda: FieldFile(self.folder, self._whole) if self._whole else None)
            self._write_fields(0.0)

    def step(self, step: Step) -> None:
        """Writes a converged step: its row of `history.csv`, and its fields with the load factor as time."""
        self._steps.append(step)
        self._largest[step.load] = self._comm.allreduce(self._fields.largest_displacement(), op=MPI.MAX)
        self._root(lambda: self._write_history(self._steps))
        if self._scene.output.fields:
            self._write_fields(step.load)

    def finish(self, summary: Summary) -> list[Path]:
        """Writes what is left, also of a run that failed; adds versions and memory to the summary.

        Returns:
            The files of the run, on every rank.
        """
        summary.versions = versions()
        summary.peak_memory_mb = _peak_memory_mb(self._comm)
        self._root(lambda: self._write_history(summary.steps))
        self._root(lambda: self._write_summary(summary))
        if self._scene.output.picture:
            data = self._picture_data()
            self._root(lambda: self._draw(CURVE, lambda path: self._curve(path, summary)))
            self._root(lambda: self._draw(PICTURE, lambda path: plots.picture(path, data)))
        return self._root(lambda: [self.folder / name for name in FILES if (self.folder / name).exists()])
