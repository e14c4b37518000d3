"""The folder of a run: whole after every step."""

import csv
import io
import json
import logging
import tempfile
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from elastune import __version__
from elastune.app import interrupts
from elastune.app.body.body import Body
from elastune.app.errors import SceneError
from elastune.app.results import xdmf
from elastune.app.results.fields import CELL_FIELDS, Fields
from elastune.app.results.files import GrowingText, aside, remove, replace_text
from elastune.app.results.machine import peak_memory_mb, versions
from elastune.app.results.pictures import curve, picture
from elastune.app.results.record import Failure, Record, Summary
from elastune.app.results.root import on_root
from elastune.app.results.xdmf import FieldFile, WholeMesh

SCENE, SUMMARY, HISTORY = "scene.toml", "summary.json", "history.csv"
CURVE, PICTURE = "curve.png", "deformed.png"
FILES = (SCENE, SUMMARY, HISTORY, xdmf.DOCUMENT, xdmf.DATA, CURVE, PICTURE)

# How a scene that we have written begins: another is a person's own, and not to be lost.
MARK = "# Written by elastune "

log = logging.getLogger("elastune")


@dataclass(frozen=True)
class Outputs:
    """What is written beside `summary.json` and `history.csv`.

    Attributes:
        title: Above the curve.
        fields: Names of `CELL_FIELDS`, and "displacement".
        average: Whether fields of cells are averaged to the nodes.
        picture: Whether curve and deformed body are drawn.
    """

    title: str = ""
    fields: tuple[str, ...] = ("displacement",)
    average: bool = False
    picture: bool = True


class RunFolder:
    """The results of one run; every method is collective, and rank 0 writes.

    `history.csv` and the fields grow with every step, `summary.json` and the pictures come at the end. What an earlier
    run left in the folder goes when a new one starts.
    """

    def __init__(self, folder: Path, outputs: Outputs, comm: MPI.Comm) -> None:
        """Checks that the folder can be made and written, and leaves nothing behind.

        Raises:
            SceneError: On every rank, if it cannot.
        """
        self.folder, self._outputs, self._comm = Path(folder), outputs, comm
        on_root(comm, self.folder, lambda: _try_folder(self.folder), SceneError)
        self._history: GrowingText | None = None

    def start(self, body: Body, scene: str = "") -> None:
        """Makes the folder and, if fields are asked for, writes those of the state before the first step.

        Args:
            body: Holds the state whenever a step is written.
            scene: Text of the scene that repeats the run.

        Raises:
            UserError: On every rank, if a file cannot be written; the other methods likewise.
        """
        self._body = body
        self._fields = Fields(body)
        self._on_root(lambda: self._clear(scene))
        if self._outputs.fields:
            whole = self._whole
            self._file = self._on_root(lambda: FieldFile(self.folder, whole))
            self._write_fields(0.0)

    def step(self, record: Record) -> None:
        """Writes a recorded step: its row of `history.csv`, and its fields with the load factor as time."""
        self._on_root(lambda: self._add(record))
        if self._outputs.fields:
            self._write_fields(record.load)

    def finish(self, summary: Summary) -> list[Path]:
        """Writes what is left, also of a run that failed; adds versions and memory to the summary.

        Returns:
            The files of the run, on rank 0.
        """
        summary.versions = versions()
        summary.peak_memory_mb = peak_memory_mb(self._comm)
        self._on_root(self._close)
        self._on_root(lambda: self._write_summary(summary))
        if self._outputs.picture:
            data = self._picture_data()
            self._on_root(lambda: self._draw(CURVE, lambda path: self._draw_curve(path, summary)))
            self._on_root(lambda: self._draw(PICTURE, lambda path: picture.picture(path, data)))
        if summary.status == "converged" and interrupts.asked(self._comm):
            summary.status = "interrupted"
            summary.failure = Failure("interrupted", "stopped while results were drawn", summary.steps[-1].load)
            self._on_root(lambda: self._write_summary(summary))
        return self._on_root(lambda: [path for name in FILES if (path := self.folder / name).exists()]) or []

    def _on_root(self, task: Callable[[], Any]) -> Any:
        return on_root(self._comm, self.folder, task)

    # ------------------------------------------------------------------ fields

    @cached_property
    def _whole(self) -> WholeMesh:
        return WholeMesh(self._body.geometry.mesh)

    def _write_fields(self, time: float) -> None:
        asked, nodes, whole = self._outputs.fields, {}, self._whole
        if "displacement" in asked:
            nodes["displacement"] = whole.nodes_to_root(self._fields.displacement())
        of_nodes = [name for name in asked if name in CELL_FIELDS] if self._outputs.average else []
        own = self._fields.cells(name for name in asked if name not in ("displacement", *of_nodes))
        averages = self._fields.averages(of_nodes) if of_nodes else {}
        cells = {name: whole.cells_to_root(values) for name, values in own.items()}
        nodes |= {name: whole.nodes_to_root(values) for name, values in averages.items()}
        self._on_root(lambda: self._file.write(time, nodes, cells) if self._file else None)

    def _picture_data(self) -> dict[str, Any]:
        """The present shape and what colours it: the first of these fields asked for, or the displacement."""
        whole, asked = self._whole, self._outputs.fields
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

    def _clear(self, scene: str) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        xdmf.clear(self.folder)
        for name in (SUMMARY, HISTORY, CURVE, PICTURE):
            remove(self.folder / name)
        if scene:
            head = f"{MARK}{__version__}: the scene of this run, nothing left to defaults; elastune run repeats it.\n"
            # Never away, not for a moment: it may be the one that is run.
            replace_text(self.folder / SCENE, head + scene)
        else:
            remove(self.folder / SCENE)

    def _add(self, record: Record) -> None:
        row = record.row()
        if self._history is None:
            self._history = GrowingText(self.folder / HISTORY, _line(row))
        self._history.add(_line(row.values()))

    def _close(self) -> None:
        if self._outputs.fields and self._file:
            self._file.close()
        if self._history is None:
            # The columns are known with the first record; a table without any has one.
            replace_text(self.folder / HISTORY, _line(["load"]))
        else:
            self._history.close()

    def _write_summary(self, summary: Summary) -> None:
        text = json.dumps(summary.as_dict(), indent=2, allow_nan=False)
        replace_text(self.folder / SUMMARY, text + "\n")

    def _draw_curve(self, path: Path, summary: Summary) -> None:
        labels, points = curve.points(self._body.acting(), summary.steps, len(self._body.stages))
        title = self._outputs.title
        if summary.failure is not None:
            title += f"\nstopped before load {summary.failure.load:.4g}: {summary.failure.kind}"
        curve.draw(points, labels, title).savefig(path, format="png")

    def _draw(self, name: str, draw: Callable[[Path], None]) -> None:
        """A picture that cannot be made is a warning: the numbers are there. One that a signal stops is not missed."""
        try:
            with interrupts.raising(), aside(self.folder / name) as part:
                draw(part)
        except Exception as problem:
            if not isinstance(problem, interrupts.Interrupted):
                log.warning("%s was not drawn: %s", name, " ".join(str(problem).split()) or type(problem).__name__)


def _line(entries: Iterable[Any]) -> str:
    """A line of a CSV table."""
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow(entries)
    return line.getvalue()


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
        scene = folder / SCENE
        if scene.is_file() and not scene.read_bytes().startswith(MARK.encode()):
            raise FileExistsError(f"its {SCENE} is not of a run, and would be lost; choose another --out")
    finally:
        for path in made:
            with suppress(OSError):
                path.rmdir()
