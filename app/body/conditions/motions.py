"""Motions that are prescribed at a place."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from elastune.forms.expressions import Entry, values

Array = NDArray[np.float64]


class Condition:
    """Anything that happens at a place."""


class Motion(Condition):
    """A prescribed displacement, at the end of a stage."""

    def components(self, dimension: int) -> list[int]:
        """The components that are prescribed."""
        return list(range(dimension))

    def displacements(self, points: Array) -> Array:
        """Displacements of points, both of shape (n, 3)."""
        return np.zeros_like(points)

    def follows(self, before: "Motion") -> bool:
        """Whether a motion of this kind can lead on from another one."""
        return self.components(3) == before.components(3)

    @classmethod
    def between(cls, ends: Sequence["Motion"], shares: Sequence[float], points: Array) -> Array:
        """Displacements on the way, see `stages.shares`.

        Args:
            ends: Of this kind, at the ends of all stages.
            shares: Of the ends.
            points: Shape (n, 3).
        """
        parts = [share * end.displacements(points) for end, share in zip(ends, shares, strict=True) if share]
        return sum(parts, np.zeros_like(points))


@dataclass(frozen=True)
class Roller(Motion):
    """No displacement along some axes.

    Attributes:
        axes: Of 0, 1, 2.
    """

    axes: Sequence[int]

    def components(self, dimension: int) -> list[int]:
        """The axes."""
        return [axis for axis in self.axes if axis < dimension]


@dataclass(frozen=True)
class Rotation(Motion):
    """A rotation of the place.

    Attributes:
        axis: Of any length, shape (3,).
        center: A point of it, shape (2,) or (3,).
        angle: In degrees.
    """

    axis: Sequence[float]
    center: Sequence[float]
    angle: float

    def displacements(self, points: Array) -> Array:
        """Displacements of points, both of shape (n, 3)."""
        return self.turned(points, np.full(len(points), np.deg2rad(self.angle)))

    def follows(self, before: Motion) -> bool:
        """Whether both turn about one axis."""
        return isinstance(before, Rotation) and (self.axis, self.center) == (before.axis, before.center)

    @classmethod
    def between(cls, ends: Sequence[Motion], shares: Sequence[float], points: Array) -> Array:
        """See `Motion`: angles on the way, not chords."""
        turning = ends[0]
        assert isinstance(turning, Rotation)
        return turning.turned(points, np.full(len(points), cls.angle_between(ends, shares)))

    @staticmethod
    def angle_between(ends: Sequence[Motion], shares: Sequence[float]) -> float:
        """The angle on the way, in radians."""
        return float(np.deg2rad(sum(s * end.angle for end, s in zip(ends, shares, strict=True))))  # type: ignore[attr-defined]

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
    """A displacement, or some components of one.

    Attributes:
        vector: Numbers or expressions of x, y, z; None along axes that stay free. Shape (d,).
    """

    vector: Sequence[Entry | None]

    def components(self, dimension: int) -> list[int]:
        """Those that are not None."""
        return [i for i, entry in enumerate(self.vector) if entry is not None]

    def displacements(self, points: Array) -> Array:
        """Displacements of points, both of shape (n, 3)."""
        motion = np.zeros_like(points)
        for i, entry in enumerate(self.vector):
            if entry is not None:
                motion[:, i] = values(entry, points)
        return motion


@dataclass(frozen=True)
class Clamp(Motion):
    """No displacement."""
