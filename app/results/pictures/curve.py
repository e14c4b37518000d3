"""The curve of a run: what the body does over what is done to it."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from elastune.app.body.conditions.loads import BodyForce, Force, Moment, NormalPull, Pressure, Pull
from elastune.app.body.conditions.motions import Condition, Rotation, Translation
from elastune.app.body.conditions.places import Place
from elastune.app.results.pictures import style
from elastune.app.results.record import Record
from elastune.forms.expressions import Expression

Labels = tuple[str, str]
Points = list[tuple[float, float]]

# What is done to a body, the most telling first: a prescribed motion tells more than a load beside it.
_KINDS = (Translation, Rotation, Pull, Pressure, NormalPull, Moment, Force, BodyForce)


def points(
    acting: Sequence[tuple[Place, Condition]], records: Sequence[Record], stages: int = 1
) -> tuple[Labels, Points]:
    """What the curve of a run shows, from the state at rest on.

    Where a face moves, its force over its path; where one turns, the energy over its angle; otherwise the load
    over the largest displacement. Without loads, the energy over the load steps. Of several stages, and of what is no
    number, the load factor over the largest displacement.

    Args:
        acting: What happens to the body at its end, and where.
        records: The recorded steps.
        stages: Of the load path.

    Returns:
        Labels of x and y, and the points.
    """
    doing = [(place.name, c) for place, c in acting if type(c) in _KINDS and _size(c) != 0]
    if not doing:
        return ("load step", "energy"), [(record.load, record.energy) for record in records]
    face, condition = min(doing, key=lambda entry: _KINDS.index(type(entry[1])))
    size = _size(condition)
    if stages > 1 or size is None:
        return ("largest displacement", "load factor"), _from_rest([(r.max_displacement, r.load) for r in records])
    if isinstance(condition, Translation):
        path = [0.0 if entry is None else float(entry) for entry in condition.vector]  # type: ignore[arg-type]
        labels = f"displacement of the {face} face", f"force on the {face} face"
        found = [(r.load * abs(size), float(np.dot(r.reaction[face], path)) / abs(size)) for r in records]
    elif isinstance(condition, Rotation):
        labels = f"rotation of the {face} face in degrees", "energy"
        found = [(r.load * size, r.energy) for r in records]
    else:
        names = {BodyForce: "body force", Pressure: "pressure on", Moment: "moment on", Force: "force on"}
        name = names.get(type(condition), "traction on")
        labels = "largest displacement", name if isinstance(condition, BodyForce) else f"{name} the {face} face"
        found = [(r.max_displacement, r.load * size) for r in records]
    return labels, _from_rest(found)


def _from_rest(found: Points) -> Points:
    return [(0.0, 0.0), *found]


def _size(condition: Condition) -> float | None:
    """How much of it there is, or None of an expression."""
    entries = getattr(condition, "vector", None)
    if entries is None:
        entries = [condition.angle if isinstance(condition, Rotation) else condition.value]  # type: ignore[attr-defined]
    given = [entry for entry in entries if entry is not None]
    if any(isinstance(entry, Expression) for entry in given):
        return None
    return float(given[0]) if len(given) == 1 else float(np.linalg.norm(given))


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
