"""Whether the conditions of a scene go together: at each place, from stage to stage, and in the whole."""

from typing import Any

from elastune.app.errors import SceneError, meant
from elastune.app.scene.schema import Scene
from elastune.app.scene.schema.conditions import Components, End, Motions, Point
from elastune.geometry import face_names

# Keys of vectors along the axes.
_VECTORS = ("move", "pull", "force")


def check_conditions(scene: Scene) -> None:
    """Checks all that can be told without a mesh.

    Raises:
        SceneError: One line with key and what was expected.
    """
    ends = scene.ends
    _check_names(scene, ends)
    for number, end in enumerate(ends):
        where = "" if not scene.stage else f"stage {end.name or number + 1}: "
        for (group, name), given in end.places.items():
            key = f"{where}{group}.{name}"
            _check_place(key, given, scene.mesh.dimension)
            if number > 0:
                _check_change(key, ends[number - 1].places.get((group, name)), given)
        if end.force is not None:
            _check_length(f"{where}body.force", end.force.force, scene.mesh.dimension)
    _check_whole(scene, ends)


def _check_names(scene: Scene, ends: list[End]) -> None:
    known = (*face_names(scene.mesh.shape), *scene.mesh.faces) if scene.mesh.dimension else None
    seen: dict[str, str] = {}
    for end in ends:
        for group, name in end.places:
            if group == "boundary" and known is not None and name not in known:
                said = meant(name, known, f"a {scene.mesh.shape} has")
                raise SceneError(f"boundary.{name}: unknown face; {said}")
            if seen.setdefault(name, group) != group:
                raise SceneError(f"{group}.{name}: {seen[name]}.{name} has that name; results are kept by it")


def _check_place(key: str, given: Motions, dimension: int | None) -> None:
    for name in _VECTORS:
        value = getattr(given, name, None)
        if isinstance(value, list):
            _check_length(f"{key}.{name}", value, dimension)
        elif isinstance(value, Components) and dimension == 2 and "z" in value.model_fields_set:
            raise SceneError(f"{key}.move.z: expected x or y in 2D")
    if given.roller is not None and dimension == 2 and "z" in given.roller:
        raise SceneError(f"{key}.roller = {given.roller}: expected axes x or y in 2D")
    if isinstance(given, Point) and given.at is not None:
        _check_length(f"{key}.at", given.at, dimension)
    for name in ("rotate", "moment"):
        table = getattr(given, name, None)
        if table is not None and not any(table.axis):
            raise SceneError(f"{key}.{name}.axis = {table.axis}: expected a vector other than zero")
        if table is not None:
            _check_length(f"{key}.{name}.center", table.center, dimension)
    spring = getattr(given, "spring", None)
    if spring is not None and isinstance(spring.stiffness, list):
        _check_length(f"{key}.spring.stiffness", spring.stiffness, dimension)
    _check_components(key, given, dimension or 3)


def _check_length(key: str, value: list[Any], dimension: int | None) -> None:
    if dimension is not None and len(value) != dimension:
        raise SceneError(f"{key} = {value}: expected {dimension} components")


def _check_components(key: str, given: Motions, dimension: int) -> None:
    """No component twice held, nor held and loaded."""
    by: dict[int, str] = {}
    for kind, components in given.held(dimension).items():
        for i in components:
            if i in by:
                raise SceneError(f"{key}: {'xyz'[i]} is prescribed by {by[i]} and by {kind}; expected one of them")
            by[i] = kind
    for kind in ("pull", "force"):
        value = getattr(given, kind, None)
        loaded = [i for i, entry in enumerate(value) if entry != 0 and i in by] if isinstance(value, list) else []
        if loaded:
            raise SceneError(f"{key}: {'xyz'[loaded[0]]} is held by {by[loaded[0]]} and loaded by {kind}")
    if set(by) >= set(range(dimension)):
        for kind in given.kinds:
            if kind not in given.held(dimension) and loads(kind, getattr(given, kind)):
                raise SceneError(f"{key}: {kind} on a face that {' and '.join(sorted(set(by.values())))} hold whole")


def _check_change(key: str, before: Motions | None, now: Motions) -> None:
    """A stage changes values, not what is held."""
    held = before.held() if before is not None else {}
    if now.held() != held:
        raise SceneError(f"{key}: holds other components than before; hold them from the first stage on, at zero")
    if before is None:
        return
    if isinstance(now, Point) and isinstance(before, Point) and now.at != before.at:
        raise SceneError(f"{key}.at = {now.at}: expected the point of the stage before")
    for kind in ("spring", "pull", "rotate"):
        old, new = getattr(before, kind, None), getattr(now, kind, None)
        if kind == "spring" and old != new:
            raise SceneError(f"{key}.spring: expected the same in all stages")
        if kind == "pull" and old is not None and type(old) is not type(new):
            raise SceneError(f"{key}.pull: expected the form of the stage before, a vector or normal")
        if kind == "rotate" and old and new and (old.axis, old.center) != (new.axis, new.center):
            raise SceneError(f"{key}.rotate: expected axis and center of the stage before")


def _check_whole(scene: Scene, ends: list[End]) -> None:
    first = ends[0].places.values()
    pinned = scene.start is not None and bool(scene.start.pins)
    springs = any(getattr(given, "spring", None) is not None for given in first)
    if not (pinned or springs or scene.solve.free or any(given.held() for given in first)):
        raise SceneError("boundary: nothing holds the body; expected fix, move, rotate or roller on some face")
    acts = any(
        (end.force is not None and any(end.force.force))
        or any(loads(kind, getattr(given, kind)) for given in end.places.values() for kind in given.kinds)
        for end in ends
    )
    if scene.start is None and not acts:
        raise SceneError("boundary: nothing loads the body; expected move, rotate, pull or pressure on some face")


def loads(kind: str, value: Any) -> bool:
    """Whether a condition does anything to a body at rest."""
    if kind in ("fix", "roller", "spring"):
        return False
    if kind == "rotate":
        return bool(value.angle != 0)
    if kind == "moment":
        return bool(value.value != 0)
    if kind == "pull" and not isinstance(value, list):
        return bool(value.normal != 0)
    if isinstance(value, Components):
        return any(value.model_dump(exclude_unset=True).values())
    return any(value) if isinstance(value, list) else bool(value)
