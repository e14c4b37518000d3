"""The two pictures of a run: a curve, and the deformed body."""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from elastune.app.results.record import Step

RENDER = Path(__file__).with_name("render.py")

# Generous for a million cells without a graphics card; the rest is waiting for a display that hangs.
PATIENCE_S = 300


class PlotError(Exception):
    """A picture that could not be made."""


def curve_points(
    boundary: Mapping[str, Any], body: Any, steps: Sequence[Step], largest: Mapping[float, float]
) -> tuple[tuple[str, str], list[tuple[float, float]]]:
    """What the curve of a scene shows, from the state at rest on.

    Where a face moves, its force over its path; where one turns, the energy over its angle; otherwise the load
    over the largest displacement. Without loads, the energy over the load steps.

    Args:
        boundary: The scene's conditions by face.
        body: The scene's load on the volume, or None.
        steps: The converged steps.
        largest: Largest displacement of the body, by load factor.

    Returns:
        Labels of x and y, and the points.
    """
    if body is None and not any(condition.loads for condition in boundary.values()):
        return ("load step", "energy"), [(step.load, step.energy) for step in steps]
    loading = [(face, condition) for face, condition in boundary.items() if condition.loads]
    # A prescribed motion tells more than a load beside it.
    loading.sort(key=lambda entry: ("move", "rotate", "pull", "pressure").index(entry[1].kind))
    face, condition = loading[0] if loading else ("body", body)
    kind = condition.kind if loading else "force"
    value = getattr(condition, kind)
    if kind == "move":
        path = float(np.linalg.norm(value))
        labels = f"displacement of the {face} face", f"force on the {face} face"
        points = [(step.load * path, float(np.dot(step.reaction[face], value)) / path) for step in steps]
    elif kind == "rotate":
        labels = f"rotation of the {face} face in degrees", "energy"
        points = [(step.load * value.angle, step.energy) for step in steps]
    else:
        names = {"pull": "traction on the {} face", "pressure": "pressure on the {} face", "force": "body force"}
        labels = "largest displacement", names[kind].format(face)
        full = value if kind == "pressure" else float(np.linalg.norm(value))
        points = [(largest[step.load], step.load * full) for step in steps]
    return labels, [(0.0, 0.0), *points]


def curve(path: Path, points: Sequence[tuple[float, float]], labels: tuple[str, str], title: str) -> None:
    """Draws a curve through points.

    Args:
        path: The image.
        points: x and y of each.
        labels: Of the two axes.
        title: Above them.

    Raises:
        ImportError: If matplotlib is missing.
    """
    # A figure without pyplot: no display, no state that others share.
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.2), dpi=150, layout="constrained")
    axes = figure.add_subplot()
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    axes.plot(*zip(*points, strict=True), "-o", color="#1f5a94", markersize=4, linewidth=1.6)
    axes.set_xlabel(labels[0])
    axes.set_ylabel(labels[1])
    axes.set_title(title, fontsize=11)
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, format="png")


def picture(path: Path, data: Mapping[str, Any]) -> None:
    """Draws the deformed body in colour and the edges of the body at rest.

    Args:
        path: The image.
        data: points (n, 3), cells (m, nodes of a cell), vtk_type, displacement (n, 3), values (n,) or (m,),
            and label, the name of the values.

    Raises:
        PlotError: If it cannot be drawn; the message says why in one line.
    """
    with tempfile.TemporaryDirectory() as folder:
        source, image = Path(folder) / "data.npz", Path(folder) / "image.png"
        np.savez(source, **data)
        with _display() as environment:
            # -P: the modules beside this file are not to be found under their bare names.
            _call([sys.executable, "-P", str(RENDER), str(source), str(image)], environment)
        if not image.is_file():
            raise PlotError("PyVista left no image")
        shutil.copyfile(image, path)


def _call(command: list[str], environment: dict[str, str]) -> None:
    try:
        done = subprocess.run(
            command, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=PATIENCE_S
        )
    except subprocess.TimeoutExpired:
        raise PlotError(f"PyVista took more than {PATIENCE_S} s") from None
    if done.returncode != 0:
        said = [line for line in (done.stderr + done.stdout).splitlines() if line.strip()]
        raise PlotError(said[-1].strip() if said else f"PyVista ended with status {done.returncode}")


@contextmanager
def _display() -> Iterator[dict[str, str]]:
    """The environment of a process that draws, with a virtual X server if there is the program for one."""
    # Of no MPI job: the child is not one of the ranks.
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("OMPI_", "PMIX_", "PRTE_"))}
    program = shutil.which("Xvfb")
    if program is None:
        yield environment
        return
    reading, writing = os.pipe()
    try:
        # The server itself picks a free display and says its number when it is ready.
        server = subprocess.Popen(
            [program, "-displayfd", str(writing), "-screen", "0", "640x480x24", "-nolisten", "tcp"],
            pass_fds=[writing],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    finally:
        os.close(writing)
    try:
        with os.fdopen(reading) as announcement:
            number = announcement.readline().strip()
        if not number:
            raise PlotError("Xvfb did not start")
        yield environment | {"DISPLAY": f":{number}"}
    finally:
        server.terminate()
        server.wait()
