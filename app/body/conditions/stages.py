"""The parts of a load path: what conditions lead to, and how much of it there is at a load."""

from collections.abc import Mapping, Sequence
from typing import Any

from elastune.app.body.conditions.motions import Condition, Motion
from elastune.app.body.conditions.places import Face, Place
from elastune.app.errors import UserError

# By place, or by name of a face.
Given = Mapping[Any, Condition | Sequence[Condition]]
Stage = dict[Place, tuple[Condition, ...]]


def shares(load: float, stages: int) -> list[float]:
    """The shares that the ends of stages have in the conditions at a load.

    Stage k, from one on, leads from load k - 1 to load k; what there was at the end of the one before goes as what is
    new comes. The first sets out from nothing. Beyond the last end it goes on as before.
    """
    current = min(max(int(load), 0), stages - 1)
    found = [0.0] * stages
    found[current] = load - current
    if current > 0:
        found[current - 1] = 1.0 - found[current]
    return found


def staged(conditions: Given, stages: Sequence[Given] = ()) -> list[Stage]:
    """All that happens at the end of each stage.

    Args:
        conditions: At the end of the first stage; a word as key is a face's name.
        stages: What is other at the ends of those that follow; a condition takes the place of one of its kind.

    Raises:
        UserError: If a stage begins to hold what was free.
    """
    whole = [{_place(key): _several(given) for key, given in conditions.items()}]
    for number, changes in enumerate(stages, start=2):
        stage = dict(whole[-1])
        for key, given in changes.items():
            place = _place(key)
            before = {type(condition): condition for condition in stage.get(place, ())}
            new = {type(condition): condition for condition in _several(given)}
            for kind, condition in new.items():
                known = before.get(kind)
                if isinstance(condition, Motion) and not (isinstance(known, Motion) and condition.follows(known)):
                    raise UserError(
                        f"stage {number}: {place.key}: expected the same components held from the first stage on, "
                        "only to other values; hold them there, e.g. at zero"
                    )
            stage[place] = tuple((before | new).values())
        whole.append(stage)
    return whole


def _place(key: Any) -> Place:
    return Face(key) if isinstance(key, str) else key


def _several(given: Condition | Sequence[Condition]) -> tuple[Condition, ...]:
    return (given,) if isinstance(given, Condition) else tuple(given)
