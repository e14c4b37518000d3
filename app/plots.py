"""The two pictures of a run: a curve, and the deformed body.

VTK draws in a process of its own, on a virtual display where there is one: it aborts the process where no
display is. As a script, `plots.py DATA IMAGE`, this file is that process.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from app.results import Step

Array = NDArray[Any]

# Generous for a million cells without a graphics card; the rest is waiting for a display that hangs.
PATIENCE_S = 300


class PlotError(Exception):
    """A picture that could not be made."""


def curve_points(
    boundary: Mapping[str, Any], body: Any, steps: Sequence[Step], largest: Mapping[float, float]
) -> tuple[tuple[str, str], list[tuple[float, float]]]:
    """What the curve of a scene shows, from the state at rest on.

    Where a face moves, its force over its path; where one turns, the energy over its angle; otherwise the load
    over the largest displacement.

    Args:
        boundary: The scene's conditions by face.
        body: The scene's load on the volume, or None.
        steps: The converged steps.
        largest: Largest displacement of the body, by load factor.

    Returns:
        Labels of x and y, and the points.
    """
    loading = [(face, condition) for face, condition in boundary.items() if condition.loads]
    # A prescribed motion tells more than a load beside it.
    loading.sort(key=lambda entry: ("move", "rotate", "pull", "pressure").index(entry[1].kind))
    face, condition = loading[0] if loading else ("body", body)
    kind = condition.kind if loading else "force"
    value = getattr(condition, kind)
    if kind == "move":
        path = float(np.linalg.norm(value))
        labels = f"displacement of {face}", f"force on {face} along its displacement"
        points = [(step.load * path, float(np.dot(step.reaction[face], value)) / path) for step in steps]
    elif kind == "rotate":
        labels = f"rotation of {face} (degrees)", "energy"
        points = [(step.load * value.angle, step.energy) for step in steps]
    else:
        names = {"pull": f"traction on {face}", "pressure": f"pressure on {face}", "force": "body force"}
        labels = "largest displacement", names[kind]
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
            _call([sys.executable, "-P", __file__, str(source), str(image)], environment)
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


def _render(source: str, image: str) -> None:
    """Draws; runs in the child."""
    import pyvista

    data = np.load(source)
    rest = pyvista.UnstructuredGrid({int(data["vtk_type"]): data["cells"]}, data["points"])
    body = rest.copy()
    body.points = data["points"] + data["displacement"]
    label, values = str(data["label"]), data["values"]
    if len(values) == body.n_points:
        body.point_data[label] = values
    else:
        body.cell_data[label] = values
        body = body.cell_data_to_point_data()
    flat = bool(np.ptp(rest.points[:, 2]) == 0)
    # Second-order cells are drawn curved.
    surface = body.extract_surface(nonlinear_subdivision=2)
    rest_surface = rest.extract_surface(nonlinear_subdivision=2)
    if flat:
        outline = rest_surface.extract_feature_edges(boundary_edges=True, feature_edges=False, manifold_edges=False)
    else:
        outline = rest_surface.extract_feature_edges(feature_angle=35)

    towards = np.array([0.0, 0.0, 1.0]) if flat else np.array([0.45, -1.0, 0.42])
    up = np.array([0.0, 1.0, 0.0]) if flat else np.array([0.0, 0.0, 1.0])
    towards /= np.linalg.norm(towards)
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    above = np.cross(towards, right)
    seen = np.vstack([surface.points, outline.points])
    across, upwards = seen @ right, seen @ above
    width, height = max(np.ptp(across), 1e-300), max(np.ptp(upwards), 1e-300)
    middle = (
        (across.max() + across.min()) / 2 * right
        + (upwards.max() + upwards.min()) / 2 * above
        + np.mean(seen @ towards) * towards
    )

    # The image takes the shape of what is seen, with a column for the colour bar on the right.
    ratio = float(np.clip(width / height, 0.5, 2.4))
    tall = round(np.clip(1000 / ratio**0.5, 640, 1100))
    bar = 190
    wide = round(tall * ratio) + bar
    pixel = max(width / (wide - bar), height / tall) * 1.12
    plotter = pyvista.Plotter(off_screen=True, window_size=(wide, tall))
    plotter.set_background("white")
    span = [float(np.nanmin(surface[label])), float(np.nanmax(surface[label]))]
    if not span[0] < span[1] - 1e-9 * abs(span[1]):
        span = [span[0] - 0.5, span[0] + 0.5]
    plotter.add_mesh(
        surface,
        scalars=label,
        cmap="viridis",
        clim=span,
        lighting=not flat,
        ambient=0.25,
        diffuse=0.8,
        smooth_shading=not flat,
        split_sharp_edges=not flat,
        show_scalar_bar=False,
    )
    plotter.add_mesh(_cell_edges(body, surface), color="black", opacity=0.25, line_width=1.0)
    plotter.add_mesh(outline, color="#555555", line_width=2.0)
    plotter.add_scalar_bar(
        title=label + "\n",
        vertical=True,
        position_x=1 - (bar - 40) / wide,
        position_y=0.15,
        width=70 / wide,
        height=0.7,
        color="black",
        title_font_size=24,
        label_font_size=20,
        fmt="%.3g",
        n_labels=5,
    )
    centre = middle + right * (bar / 2) * pixel
    reach = 4 * float(np.linalg.norm(np.ptp(seen, axis=0)))
    camera = plotter.camera
    camera.parallel_projection = True
    camera.focal_point, camera.position, camera.up = centre, centre + reach * towards, up
    camera.parallel_scale = tall * pixel / 2
    plotter.renderer.reset_camera_clipping_range()
    plotter.enable_anti_aliasing("ssaa")
    plotter.screenshot(image)
    plotter.close()


def _cell_edges(body: Any, surface: Any) -> Any:
    return surface.extract_feature_edges(feature_angle=35)


if __name__ == "__main__":
    _render(*sys.argv[1:])
