"""The terms of a body's loads, and what only the mesh can tell of them."""

from collections.abc import Iterator, Sequence
from typing import Any

from elastune.app.body.conditions.load import Load, Setting
from elastune.app.body.conditions.loads import Pressure
from elastune.app.body.conditions.places import Face, Place
from elastune.app.body.conditions.stages import Stage, shares
from elastune.app.errors import UserError
from elastune.forms.expressions import Expression
from elastune.forms.terms import Term
from elastune.geometry import Geometry


def steady_terms(stage: Stage, setting: Setting) -> list[tuple[Place, Term]]:
    """The terms of what is the same in all stages, each at its place."""
    return [
        (place, type(load).term({place: load}, setting))
        for place, conditions in stage.items()
        for load in conditions
        if isinstance(load, Load) and load.steady
    ]


def load_terms(stages: Sequence[Stage], setting: Setting) -> list[Term]:
    """The terms of all loads, one a kind and stage: what a stage leads to comes with it and goes with the next."""
    terms = []
    for number, stage in enumerate(stages):
        kinds: dict[Any, dict[Place, Any]] = {}
        for place, conditions in stage.items():
            for load in conditions:
                if isinstance(load, Load) and load.acts and not load.steady:
                    kinds.setdefault(type(load), {})[place] = load
        for kind, loads in kinds.items():
            term = kind.term(loads, setting)
            if number > 0:
                term.name = f"{term.name} {number + 1}"
            term.amplitude = lambda load, number=number: shares(load, len(stages))[number]
            terms.append(term)
    return terms


def check(stages: Sequence[Stage], geometry: Geometry) -> None:
    """What only the mesh can tell of loads and vectors; collective.

    Raises:
        UserError: If a vector has another number of components than the mesh has dimensions, or a load that needs a
            side acts on an inner face.
    """
    d = geometry.mesh.geometry.dim
    for stage in stages:
        for place, conditions in stage.items():
            for condition in conditions:
                for name in ("vector", "stiffness"):
                    vector = getattr(condition, name, None)
                    if isinstance(vector, Sequence) and len(vector) != d:
                        key = _KEYS.get(type(condition).__name__, name)
                        raise UserError(f"{place.key}.{key} = {_shown(vector)}: expected {d} components")
                if isinstance(condition, Load) and condition.one_sided and isinstance(place, Face):
                    _check_side(place, condition, geometry)


_KEYS = {
    "Translation": "move",
    "Pull": "pull",
    "NormalPull": "pull.normal",
    "Spring": "spring.stiffness",
    "Force": "force",
    "BodyForce": "force",
}


def by_place(stages: Sequence[Stage], setting: Setting) -> Iterator[tuple[str, Term]]:
    """The loads that expressions tell, each with its key and as a term of its own."""
    for stage in stages:
        for place, conditions in stage.items():
            for load in conditions:
                if isinstance(load, Load) and _expressions(load):
                    key = f"{place.key}.{_KEYS[type(load).__name__]} = {' and '.join(_expressions(load))}"
                    yield key, type(load).term({place: load}, setting)


def _expressions(load: Load) -> list[str]:
    """As text, those that a load is told by."""
    entries = [entry for value in vars(load).values() for entry in (value if isinstance(value, Sequence) else [value])]
    return [repr(entry.text) for entry in entries if isinstance(entry, Expression)]


def _check_side(place: Face, condition: Load, geometry: Geometry) -> None:
    if place.name in geometry.faces and geometry.inside(place.name):
        what = "pressure" if isinstance(condition, Pressure) else "pull.normal"
        raise UserError(
            f"{place.key}.{what}: expected a face of the body's skin; this one has cells on both sides, so that "
            "nothing tells which way it is; pull = [x, y, z] acts there"
        )


def _shown(vector: Sequence[Any]) -> list[Any]:
    return [entry.text if isinstance(entry, Expression) else entry for entry in vector]
