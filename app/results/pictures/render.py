"""Draws a deformed body with PyVista: a script of its own, `render.py DATA IMAGE`, that knows nothing of the rest.

VTK aborts the process that asks it to draw without a display; a run must not be that process.
"""

import sys
from typing import Any

import numpy as np
import pyvista
from numpy.typing import NDArray

Array = NDArray[Any]

# Pixels for the colour bar.
BAR = 200
# More cells on the surface would be all edges.
MOST_EDGED = 30_000


def render(source: str, image: str) -> None:
    """Draws the deformed body in colour and the edges of the body at rest.

    Args:
        source: What `plots.picture` saved.
        image: The PNG to write.
    """
    data = np.load(source)
    rest: Any = pyvista.UnstructuredGrid({int(data["vtk_type"]): data["cells"]}, data["points"])
    body: Any = rest.copy()
    body.points = data["points"] + data["displacement"]
    label = str(data["label"])
    if len(data["values"]) == body.n_points:
        body.point_data[label] = data["values"]
    else:
        body.cell_data[label] = data["values"]
        body = body.cell_data_to_point_data()
    flat = np.ptp(rest.points[:, 2]) == 0
    towards, up = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]] if flat else [[0.45, -1.0, 0.42], [0.0, 0.0, 1.0]])
    towards /= np.linalg.norm(towards)
    # A second-order cell is drawn through its mid nodes.
    surface = body.extract_surface(nonlinear_subdivision=1)
    outline = rest.extract_surface(nonlinear_subdivision=1).extract_feature_edges(
        35, boundary_edges=bool(flat), feature_edges=not flat, manifold_edges=False
    )

    plotter: Any = pyvista.Plotter(off_screen=True, lighting="none")
    plotter.set_background("white")
    for position, intensity in (((-0.6, 0.8, 1.0), 0.6), ((1.0, 0.1, 0.6), 0.35)):
        plotter.add_light(pyvista.Light(position=position, light_type="camera light", intensity=intensity))
    actor = plotter.add_mesh(
        surface,
        scalars=label,
        clim=_span(surface[label]),
        cmap="viridis",
        lighting=not flat,
        ambient=0.45,
        diffuse=0.7,
        smooth_shading=not flat,
        split_sharp_edges=not flat,
        feature_angle=50,
        show_scalar_bar=False,
    )
    if surface.n_cells <= MOST_EDGED:
        # Edges inside the body are hidden by its surface; a little nearer, the others are not.
        edges = body.extract_all_edges()
        edges.points += 2e-3 * body.length * towards
        plotter.add_mesh(edges, color="black", opacity=0.25, line_width=1)
    plotter.add_mesh(outline, color="#444444", line_width=2)
    width = _aim(plotter, np.vstack([surface.points, outline.points]), towards, up)
    plotter.add_scalar_bar(
        label + "\n",
        mapper=actor.mapper,
        vertical=True,
        position_x=1 - 0.8 * BAR / width,
        position_y=0.15,
        width=0.35 * BAR / width,
        height=0.7,
        color="black",
        title_font_size=26,
        label_font_size=22,
        fmt="%.3g",
    )
    plotter.enable_anti_aliasing("ssaa")
    plotter.screenshot(image)
    plotter.close()


def _span(values: Array) -> tuple[float, float]:
    """Range of the colours; a constant is no range, nor is its rounding."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    least = 1e-6 * max(abs(low), abs(high)) or 1.0
    return (low, high) if high - low > least else (low - least, high + least)


def _aim(plotter: Any, points: Array, towards: Array, up: Array) -> int:
    """Points the camera at the points and shapes the image like them, with room for the colour bar.

    Args:
        plotter: What draws.
        points: All that is to be seen, shape (n, 3).
        towards: Unit vector to the camera.
        up: What is up in the image.

    Returns:
        Width of the image in pixels.
    """
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    axes = np.array([right, np.cross(towards, right), towards])
    seen = points @ axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    width, height = high[:2] - low[:2]
    ratio = float(np.clip(width / height, 0.4, 2.5))
    rows = round(1000 / ratio**0.5)
    columns = round(rows * ratio)
    pixel = 1.1 * max(width / columns, height / rows)
    plotter.window_size = columns + BAR, rows
    camera = plotter.camera
    camera.parallel_projection = True
    centre = (low + high) / 2 @ axes + right * pixel * BAR / 2
    camera.focal_point, camera.up = centre, up
    camera.position = centre + 2 * np.linalg.norm(high - low) * towards
    camera.parallel_scale = rows * pixel / 2
    plotter.renderer.reset_camera_clipping_range()
    return columns + BAR


if __name__ == "__main__":
    render(*sys.argv[1:])
