"""The picture of a deformed body, drawn by a process of its own."""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

RENDER = Path(__file__).with_name("render.py")

# Generous for a million cells without a graphics card; the rest is waiting for a display that hangs.
PATIENCE_S = 300


class PlotError(Exception):
    """A picture that could not be made."""


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
