"""Shapes to come home from: scrambled, collapsed, turned inside out."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from elastune.app.body.body import Body
from elastune.app.body.noise import uniform


@dataclass(frozen=True)
class Start:
    """The shape from which a body sets out, instead of the one at rest.

    Attributes:
        shape: "scramble": every node at random in the body's bounding box, enlarged about its centre; "plane", "line",
            "point": collapsed onto the plane through the centre across `axis`, the line along it, or the centre;
            "inside-out": mirrored in that plane.
        seed: Of the scramble.
        volume: Of the enlarged box, over that of the bounding box.
        axis: 0, 1 or 2.
    """

    shape: Literal["scramble", "plane", "line", "point", "inside-out"]
    seed: int = 0
    volume: float = 2.0
    axis: int = 0


def started(body: Body, start: Start) -> NDArray[np.float64]:
    """The displacements of a start, a vector; where they are prescribed it is not to be believed."""
    d, axis = body.dimension, start.axis
    points = body.points[: body.layout.displacements // d, :d]
    low, high = body.bounds
    center = (low + high) / 2
    if start.shape == "scramble":
        box = (high - low) * start.volume ** (1 / d)
        target = center + box * (noise(body, start.seed) - 0.5)
    elif start.shape == "plane":
        target = points.copy()
        target[:, axis] = center[axis]
    elif start.shape == "line":
        target = np.tile(center, (len(points), 1))
        target[:, axis] = points[:, axis]
    elif start.shape == "point":
        target = np.tile(center, (len(points), 1))
    else:
        target = points.copy()
        target[:, axis] = 2 * center[axis] - points[:, axis]
    return body.layout.joined((target - points).ravel())


def noise(body: Body, seed: int) -> NDArray[np.float64]:
    """Numbers in [0, 1) for each of this rank's displacements, shape (nodes, d), on any number of ranks the same."""
    own = body.layout.displacements // body.dimension
    return uniform(body.points[:own, : body.dimension], body.bounds[0], body.extent, seed)
