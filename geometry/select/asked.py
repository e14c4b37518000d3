"""Selectors as people write them, checked: pure Python, before any mesh is built."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

from elastune.geometry.errors import GeometryError

TOLERANCE = 1e-6
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
FACES = ("tag", "plane", "box", "sphere", "cylinder", "all")
REGIONS = ("tag", "box", "sphere", "cylinder", "all")

Vector = tuple[float, ...]


@dataclass(frozen=True)
class Selector:
    """What has a name.

    Attributes:
        key: Where it stands, for messages.
        text: As it was written.
        kind: One of `FACES`.
        number: Of the group, for "tag".
        vectors: "plane": normal, point; "box": corners; "sphere": center; "cylinder": axis, center.
        radius: Of "sphere" and "cylinder".
        tolerance: Over the largest extent of the body.
    """

    key: str
    text: str
    kind: str
    number: int = 0
    vectors: tuple[Vector, ...] = ()
    radius: float = 0.0
    tolerance: float = TOLERANCE


def selectors(table: str, given: Any, dim: int | None) -> dict[str, Selector]:
    """Check the selectors of faces or of regions.

    Args:
        table: "faces" or "regions".
        given: A mapping of names to mappings; keys whose value is None count as not given.
        dim: Dimension of the mesh, None where only a file tells: then vectors have 2 or 3 components.

    Raises:
        GeometryError: One of them is impossible; the message names it.
    """
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise GeometryError(f"{table} = {given!r}: expected selectors by name")
    return {name: _selector(f"{table}.{name}", each, table, dim) for name, each in given.items()}


def _selector(key: str, given: Any, table: str, dim: int | None) -> Selector:
    kinds = FACES if table == "faces" else REGIONS
    if not isinstance(given, Mapping):
        raise GeometryError(f"{key} = {given!r}: expected a selector, such as {{all = true}}")
    keys = {name: value for name, value in given.items() if value is not None}
    found = [name for name in keys if name in FACES]
    if len(found) != 1:
        raise GeometryError(f"{key}: expected one of {', '.join(kinds)}, got {' and '.join(found) or 'none'}")
    kind = found[0]
    if kind not in kinds:
        raise GeometryError(f"{key}.{kind}: a plane has no cells in it; expected one of {', '.join(kinds)}")
    flat = kind == "plane" and isinstance(keys[kind], str)
    allowed = {kind, "tolerance", *(["at"] if flat else [])}
    for name in keys:
        if name not in allowed:
            raise GeometryError(f"{key}.{name}: expected only {', '.join(sorted(allowed))} with {kind}")
    tolerance = keys.get("tolerance", TOLERANCE)
    if not _is_number(tolerance) or not 0 <= tolerance < 1:
        raise GeometryError(f"{key}.tolerance = {tolerance!r}: expected a part of the body's extent, from 0 to 1")
    return Selector(key, _text(keys), kind, **_READERS[kind](f"{key}.{kind}", keys, dim), tolerance=float(tolerance))


def _tag(key: str, keys: Mapping[str, Any], dim: int | None) -> dict[str, Any]:
    number = keys["tag"]
    if not isinstance(number, Integral) or isinstance(number, bool) or number < 1:
        raise GeometryError(f"{key} = {number!r}: expected the number of a group, from 1 on")
    return {"number": int(number)}


def _plane(key: str, keys: Mapping[str, Any], dim: int | None) -> dict[str, Any]:
    plane = keys["plane"]
    if isinstance(plane, str):
        if plane not in (axes := list(AXES)[: dim or 3]):
            raise GeometryError(f"{key} = {plane!r}: expected {', '.join(axes)}, or {{normal, point}}")
        if not _is_number(keys.get("at")):
            where = f" = {keys['at']!r}:" if "at" in keys else ": missing;"
            raise GeometryError(f"{key.removesuffix('plane')}at{where} expected the plane's place along {plane}")
        # In 2D and 3D alike: vectors are cut to the mesh's dimension.
        place = tuple(float(keys["at"]) * part for part in AXES[plane])
        return {"vectors": (AXES[plane], place)}
    normal, point = _table(key, plane, ("normal", "point"))
    return {"vectors": (_direction(f"{key}.normal", normal, dim), _vector(f"{key}.point", point, dim))}


def _box(key: str, keys: Mapping[str, Any], dim: int | None) -> dict[str, Any]:
    box = keys["box"]
    if isinstance(box, str | Mapping) or not hasattr(box, "__len__") or len(box) != 2:
        raise GeometryError(f"{key} = {box!r}: expected two corners")
    low, high = (_vector(key, corner, dim) for corner in box)
    if len(low) != len(high) or any(a > b for a, b in zip(low, high, strict=True)):
        raise GeometryError(f"{key} = {box!r}: expected the lower corner, then the upper one")
    return {"vectors": (low, high)}


def _sphere(key: str, keys: Mapping[str, Any], dim: int | None) -> dict[str, Any]:
    center, radius = _table(key, keys["sphere"], ("center", "radius"))
    return {"vectors": (_vector(f"{key}.center", center, dim),), "radius": _radius(key, radius)}


def _cylinder(key: str, keys: Mapping[str, Any], dim: int | None) -> dict[str, Any]:
    if dim == 2:
        raise GeometryError(f"{key}: not in 2D; a sphere is a disc there")
    axis, center, radius = _table(key, keys["cylinder"], ("axis", "center", "radius"))
    along = AXES[axis] if isinstance(axis, str) and axis in AXES else _direction(f"{key}.axis", axis, 3)
    return {"vectors": (along, _vector(f"{key}.center", center, 3)), "radius": _radius(key, radius)}


def _all(key: str, keys: Mapping[str, Any], dim: int | None) -> dict[str, Any]:
    if keys["all"] is not True:
        raise GeometryError(f"{key} = {keys['all']!r}: expected true")
    return {}


_READERS = {"tag": _tag, "plane": _plane, "box": _box, "sphere": _sphere, "cylinder": _cylinder, "all": _all}


def _table(key: str, value: Any, names: Sequence[str]) -> list[Any]:
    if not isinstance(value, Mapping) or set(value) != set(names):
        raise GeometryError(f"{key} = {value!r}: expected {{{', '.join(names)}}}")
    return [value[name] for name in names]


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def _radius(key: str, value: Any) -> float:
    if not _is_number(value) or value <= 0:
        raise GeometryError(f"{key}.radius = {value!r}: expected a positive length")
    return float(value)


def _vector(key: str, value: Any, dim: int | None) -> Vector:
    lengths = (2, 3) if dim is None else (dim,)
    listed = not isinstance(value, str | Mapping) and hasattr(value, "__len__")
    if not listed or len(value) not in lengths or not all(map(_is_number, value)):
        raise GeometryError(f"{key} = {value!r}: expected {' or '.join(map(str, lengths))} numbers")
    return tuple(map(float, value))


def _direction(key: str, value: Any, dim: int | None) -> Vector:
    vector = _vector(key, value, dim)
    length = math.hypot(*vector)
    if not length:
        raise GeometryError(f"{key} = {value!r}: expected a vector other than zero")
    return tuple(part / length for part in vector)


def _text(value: Any) -> str:
    """A selector as TOML has it."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {_text(each)}" for key, each in value.items()) + "}"
    if isinstance(value, str):
        return f'"{value}"'
    return str(value).lower() if isinstance(value, bool) else str(value)
