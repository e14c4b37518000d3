"""Loads on faces and on the volume: what each adds to Π."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from elastune.app.body.motions import Condition
from elastune.app.errors import UserError, meant
from elastune.forms.terms import DeadLoads, Domain, Fields, FollowerPressure, Term


class Setting(NamedTuple):
    """What a term is made for.

    Attributes:
        fields: What Π is a function of.
        domain: What is integrated over.
        held: Mask of the prescribed displacements, owned and ghost.
    """

    fields: Fields
    domain: Domain
    held: NDArray[np.bool_]


class Load(Condition, ABC):
    """A condition that adds to Π; all of one kind become one term."""

    @classmethod
    @abstractmethod
    def term(cls, loads: Mapping[int, Self], setting: Setting) -> Term:
        """The term of the loads of this kind, by number of their face."""


@dataclass(frozen=True)
class Pull(Load):
    """A dead traction.

    Attributes:
        vector: Force per rest area at full load, shape (d,).
    """

    vector: Sequence[float]

    @classmethod
    def term(cls, loads: Mapping[int, "Pull"], setting: Setting) -> Term:
        """Their work."""
        tractions = {tag: np.array(load.vector, dtype=np.float64) for tag, load in loads.items()}
        return DeadLoads(setting.fields, setting.domain, tractions=tractions)


@dataclass(frozen=True)
class Pressure(Load):
    """A pressure on the deformed face, at full load, positive into the body."""

    value: float

    @classmethod
    def term(cls, loads: Mapping[int, "Pressure"], setting: Setting) -> Term:
        """The pressure times the enclosed volume, where there is one."""
        pressures = {tag: load.value for tag, load in loads.items()}
        return FollowerPressure(setting.fields, setting.domain, pressures, setting.held)


@dataclass(frozen=True)
class BodyForce:
    """A dead load on the volume.

    Attributes:
        vector: Force per rest volume at full load, shape (d,).
    """

    vector: Sequence[float]

    def term(self, setting: Setting) -> Term:
        """Its work."""
        force = np.array(self.vector, dtype=np.float64)
        return DeadLoads(setting.fields, setting.domain, force, name="body_force")


def load_terms(conditions: Mapping[str, Condition], tags: Mapping[str, int], setting: Setting) -> list[Term]:
    """The terms of all loads on faces, one a kind."""
    kinds: dict[Any, dict[int, Any]] = {}
    for face, condition in conditions.items():
        if isinstance(condition, Load):
            kinds.setdefault(type(condition), {})[tags[face]] = condition
    return [kind.term(loads, setting) for kind, loads in kinds.items()]


def check(conditions: Mapping[str, Condition], force: BodyForce | None, faces: Iterable[str], dimension: int) -> None:
    """What only the mesh can tell of conditions.

    Raises:
        UserError: If a face is unknown, or a vector has another number of components than the mesh dimensions.
    """
    vectors = {f"boundary.{face}": getattr(condition, "vector", None) for face, condition in conditions.items()}
    for face in conditions:
        if face not in faces:
            raise UserError(f"boundary.{face}: unknown face; {meant(face, faces, 'the mesh has')}")
    if force is not None:
        vectors["body.force"] = force.vector
    for key, vector in vectors.items():
        if vector is not None and len(vector) != dimension:
            raise UserError(f"{key} = {list(vector)}: expected {dimension} components")
