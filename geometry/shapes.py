"""The shapes that can be built, and the check of what is asked of them: pure Python, before gmsh starts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

from elastune.geometry.errors import GeometryError

SOLID, PLANE = ("tetrahedron", "hexahedron"), ("triangle", "quadrilateral")
MOST_CELLS = 10**8
SMALLEST_GRADE = 0.01
# With 3 a single curved cell would span a quarter of the circle, and tetrahedra invert.
FEWEST_ACROSS = 4


@dataclass(frozen=True)
class Shape:
    """What a shape takes: its cells, the meaning of its size, and its faces.

    `ends` are the faces at the start and the end of each direction that cells are counted along; a
    cylinder counts across the diameter, where only its outer end is a face, and along the axis.
    """

    cells: tuple[str, str]
    size: str
    ends: tuple[tuple[str | None, str], ...]

    @property
    def dim(self) -> int:
        """Dimension of the cells and of space."""
        return 3 if self.cells == SOLID else 2

    @property
    def faces(self) -> tuple[str, ...]:
        """Names of the faces."""
        return tuple(name for pair in self.ends for name in pair if name)


XYZ = (("left", "right"), ("front", "back"), ("bottom", "top"))
XY = (("left", "right"), ("bottom", "top"))
SHAPES = {
    "cube": Shape(SOLID, "its edge, a length", XYZ),
    "box": Shape(SOLID, "[x, y, z], three lengths", XYZ),
    "cylinder": Shape(SOLID, "[radius, height]", ((None, "side"), ("bottom", "top"))),
    "square": Shape(PLANE, "its edge, a length", XY),
    "rectangle": Shape(PLANE, "[x, y], two lengths", XY),
}


@dataclass(frozen=True)
class Plan:
    """A checked request.

    Attributes:
        shape: The shape's entry in `SHAPES`.
        lengths: Edges of a box or rectangle; radius and height of a cylinder.
        counts: Cells along each edge; across the diameter and along the axis of a cylinder.
        cell: Cell type.
        order: Order of the cells' geometry, 1 or 2.
        grade: Size of the cells at a face over the average along that direction, by face.
    """

    shape: Shape
    lengths: tuple[float, ...]
    counts: tuple[int, ...]
    cell: str
    order: int
    grade: dict[str, float]

    @property
    def round(self) -> bool:
        """Whether the section is a disc."""
        return "side" in self.shape.faces

    def ring(self) -> int:
        """Cells of a cylinder from its square core to the side: half a radius."""
        return max(1, (self.counts[0] + 1) // 4)

    def grades(self, direction: int) -> tuple[float | None, float | None]:
        """Grading towards the start and the end of a direction, None where there is none."""
        start, end = self.shape.ends[direction]
        return (self.grade.get(start) if start else None), self.grade.get(end)


def face_names(shape: str) -> tuple[str, ...]:
    """Names of the faces of a shape, in the order of their tags, without building it.

    Args:
        shape: "cube", "box", "cylinder", "square", "rectangle" or "file".

    Returns:
        The names; empty for "file", whose names stand in the file.

    Raises:
        GeometryError: The shape is unknown.
    """
    return () if shape == "file" else _shape(shape).faces


def make_plan(
    shape: str,
    size: Any,
    cells: Any,
    cell: str,
    h: float | None,
    order: int,
    grade: Mapping[str, float] | None,
) -> Plan:
    """Check the arguments of `elastune.geometry.build` for a shape other than "file".

    Raises:
        GeometryError: One of them is impossible; the message names it, its value and what was expected.
    """
    kind = _shape(shape)
    if cell not in kind.cells:
        raise GeometryError(f"cell = {cell!r}: expected {_one_of(kind.cells)} for a {shape}")
    check_order(order)
    lengths = _lengths(shape, kind, size)
    counts = _counts(shape, kind, lengths, cells, h)
    plan = Plan(kind, lengths, counts, cell, order, _grade(shape, kind, grade))
    _check_grade(plan)
    return plan


def check_order(order: int) -> None:
    """Raise a GeometryError unless the order of the cells' geometry is 1 or 2."""
    if order not in (1, 2) or isinstance(order, bool):
        raise GeometryError(f"order = {order!r}: expected 1 (straight cells) or 2 (curved cells)")


def _shape(shape: str) -> Shape:
    if not isinstance(shape, str) or shape not in SHAPES:
        raise GeometryError(f"shape = {shape!r}: expected {_one_of((*SHAPES, 'file'))}")
    return SHAPES[shape]


def _one_of(names: Sequence[str]) -> str:
    quoted = [f'"{name}"' for name in names]
    return " or ".join([", ".join(quoted[:-1]), quoted[-1]])


def _is_positive(value: Any) -> bool:
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        return 0 < float(value) < math.inf
    except OverflowError:
        return False


def _is_count(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool) and 0 < int(value) <= MOST_CELLS


def _bounded(count: float) -> float:
    """Keep a count of cells where it can be rounded, and is refused when too large."""
    return min(max(1.0, count), MOST_CELLS + 1.0)


def _as_list(value: Any) -> list[Any] | None:
    """Return the entries of a list, a tuple or an array; None for a scalar, a string, a mapping."""
    if isinstance(value, str | bytes | Mapping) or not hasattr(value, "__len__"):
        return None
    return list(value)


def _lengths(shape: str, kind: Shape, size: Any) -> tuple[float, ...]:
    regular = shape in ("cube", "square")
    values = [size] * len(kind.ends) if regular else _as_list(size)
    if values is None or len(values) != len(kind.ends) or not all(map(_is_positive, values)):
        raise GeometryError(f"size = {size!r}: expected {kind.size}, positive, for a {shape}")
    return tuple(float(value) for value in values)


def _counts(shape: str, kind: Shape, lengths: tuple[float, ...], cells: Any, h: Any) -> tuple[int, ...]:
    extents = (2 * lengths[0], lengths[1]) if shape == "cylinder" else lengths
    if h is not None:
        if not _is_positive(h):
            raise GeometryError(f"h = {h!r}: expected a positive cell size")
        given = f"h = {h!r}"
        # A length that is a whole number of cells up to rounding must not get one more.
        counts = [math.ceil(_bounded(extent / h) - 1e-9) for extent in extents]
        if shape == "cylinder":
            counts[0] = max(counts[0], FEWEST_ACROSS)
    else:
        given = f"cells = {cells!r}"
        values = _as_list(cells) or [cells]
        if len(values) not in (1, len(extents)) or not all(map(_is_count, values)):
            raise GeometryError(f"{given}: expected a whole number from 1 to {MOST_CELLS:,}, or {len(extents)} of them")
        counts = [int(value) for value in values]
        if len(values) == 1:
            reference = extents[0] if shape == "cylinder" else max(extents)
            counts = [round(_bounded(counts[0] * (extent / reference))) for extent in extents]
    if shape == "cylinder" and counts[0] < FEWEST_ACROSS:
        least = f"at least {FEWEST_ACROSS} cells across the diameter of a cylinder"
        raise GeometryError(f"{given}: expected {least}")
    total = math.prod(counts) * (counts[0] if shape == "cylinder" else 1)
    if total > MOST_CELLS:
        raise GeometryError(f"{given}: expected at most {MOST_CELLS:,} cells, got about {total:,}")
    return tuple(counts)


def _grade(shape: str, kind: Shape, grade: Any) -> dict[str, float]:
    if grade is None:
        return {}
    if not isinstance(grade, Mapping):
        raise GeometryError(f"grade = {grade!r}: expected ratios by face, such as {kind.faces[-1]} = 0.3")
    for face, ratio in grade.items():
        if face not in kind.faces:
            raise GeometryError(f"grade.{face}: expected a face of a {shape}: {', '.join(kind.faces)}")
        if not _is_positive(ratio) or not SMALLEST_GRADE <= ratio <= 1:
            raise GeometryError(
                f"grade.{face} = {ratio!r}: expected the size of the cells at this face over the average, "
                f"from {SMALLEST_GRADE} to 1"
            )
    return {face: float(ratio) for face, ratio in grade.items() if ratio != 1}


def _check_grade(plan: Plan) -> None:
    for direction, ends in enumerate(plan.shape.ends):
        faces = [face for face in ends if face in plan.grade]
        in_ring = plan.round and direction == 0
        if faces and (plan.ring() if in_ring else plan.counts[direction]) <= len(faces):
            least = "7 cells across the diameter" if in_ring else f"{len(faces) + 1} cells between its ends"
            raise GeometryError(
                f"grade towards {' and '.join(map(str, faces))}: expected at least {least}, "
                f"got {plan.counts[direction]}"
            )
