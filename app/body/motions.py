"""Motions that are prescribed on a face."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Condition:
    """Anything that happens to a face."""


@dataclass(frozen=True)
class Motion(Condition):
    """A prescribed displacement; where faces meet, the one of higher precedence has its way."""

    precedence: ClassVar[int] = 0

    def components(self, dimension: int) -> list[int]:
        """The components that are prescribed."""
        return list(range(dimension))

    def displacements(self, points: Array, load: float) -> Array:
        """Displacements of points, both of shape (n, 3), at a load factor."""
        return np.zeros_like(points)


@dataclass(frozen=True)
class Roller(Motion):
    """No displacement along some axes.

    Attributes:
        axes: Of 0, 1, 2.
    """

    axes: Sequence[int]
    precedence: ClassVar[int] = 0

    def components(self, dimension: int) -> list[int]:
        """The axes."""
        return list(self.axes)


@dataclass(frozen=True)
class Rotation(Motion):
    """A rotation of the face.

    Attributes:
        axis: Of any length, shape (3,).
        center: A point of it, shape (2,) or (3,).
        angle: In degrees, at full load.
    """

    axis: Sequence[float]
    center: Sequence[float]
    angle: float
    precedence: ClassVar[int] = 1

    def displacements(self, points: Array, load: float) -> Array:
        """Displacements of points, both of shape (n, 3), at a load factor."""
        return self.turned(points, np.full(len(points), np.deg2rad(load * self.angle)))

    def turned(self, points: Array, angles: Array) -> Array:
        """Displacements of points, shape (n, 3), that turn by angles in radians, shape (n,)."""
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        arm = points - np.pad(self.center, (0, 3 - len(self.center)))
        # Rodrigues' formula, with 1 - cos as 2 sin² to keep small rotations exact.
        once = np.cross(axis, arm)
        twice = np.cross(axis, once)
        return np.sin(angles)[:, None] * once + 2 * np.sin(angles / 2)[:, None] ** 2 * twice


@dataclass(frozen=True)
class Translation(Motion):
    """A displacement of the whole face.

    Attributes:
        vector: At full load, shape (d,).
    """

    vector: Sequence[float]
    precedence: ClassVar[int] = 2

    def displacements(self, points: Array, load: float) -> Array:
        """Displacements of points, both of shape (n, 3), at a load factor."""
        motion = np.zeros_like(points)
        motion[:, : len(self.vector)] = load * np.array(self.vector)
        return motion


@dataclass(frozen=True)
class Clamp(Motion):
    """No displacement."""

    precedence: ClassVar[int] = 3
