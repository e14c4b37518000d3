"""The curve of a run: what the body does over what is done to it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from elastune.app.body.loads import BodyForce, Pressure, Pull
from elastune.app.body.motions import Condition, Rotation, Translation
from elastune.app.results.pictures import style
from elastune.app.results.record import Record

Labels = tuple[str, str]
Points = list[tuple[float, float]]

# What is done to a body, the most telling first: a prescribed motion tells more than a load beside it.
_KINDS = (Translation, Rotation, Pull, Pressure, BodyForce)


def points(
    conditions: Mapping[str, Condition], force: BodyForce | None, records: Sequence[Record]
) -> tuple[Labels, Points]:
    """What the curve of a run shows, from the state at rest on.

    Where a face moves, its force over its path; where one turns, the energy over its angle; otherwise the load
    over the largest displacement. Without loads, the energy over the load steps.

    Args:
        conditions: By face.
        force: Load on the volume, or None.
        records: The recorded steps.

    Returns:
        Labels of x and y, and the points.
    """
    doing: list[tuple[str, Any]] = [(face, c) for face, c in conditions.items() if _does(c)]
    doing += [] if force is None else [("body", force)]
    if not doing:
        return ("load step", "energy"), [(record.load, record.energy) for record in records]
    face, condition = min(doing, key=lambda entry: _KINDS.index(type(entry[1])))
    size = float(np.linalg.norm(condition.vector)) if hasattr(condition, "vector") else 0.0
    if isinstance(condition, Translation):
        labels = f"displacement of the {face} face", f"force on the {face} face"
        found = [(r.load * size, float(np.dot(r.reaction[face], condition.vector)) / size) for r in records]
    elif isinstance(condition, Rotation):
        labels = f"rotation of the {face} face in degrees", "energy"
        found = [(r.load * condition.angle, r.energy) for r in records]
    else:
        full = condition.value if isinstance(condition, Pressure) else size
        names = {Pull: f"traction on the {face} face", Pressure: f"pressure on the {face} face"}
        labels = "largest displacement", names.get(type(condition), "body force")
        found = [(r.max_displacement, r.load * full) for r in records]
    return labels, [(0.0, 0.0), *found]


def _does(condition: Condition) -> bool:
    """Whether anything happens to the body."""
    if isinstance(condition, Translation | Pull):
        return any(condition.vector)
    if isinstance(condition, Rotation):
        return condition.angle != 0
    return isinstance(condition, Pressure) and condition.value != 0


def draw(found: Points, labels: Labels, title: str) -> Any:
    """A figure of a curve through points.

    Args:
        found: x and y of each.
        labels: Of the two axes.
        title: Above them.

    Raises:
        ImportError: If matplotlib is missing.
    """
    figure = style.figure((6.4, 4.2))
    axes = figure.add_subplot()
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    axes.plot(*zip(*found, strict=True), "-o", color="#1f5a94", markersize=4, linewidth=1.6)
    axes.set_xlabel(labels[0])
    axes.set_ylabel(labels[1])
    axes.set_title(title, fontsize=11)
    style.dress(axes)
    return figure
