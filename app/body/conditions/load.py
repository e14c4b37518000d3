"""What every load is: a condition that becomes a term of Π."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray

from elastune.app.body.conditions.motions import Condition
from elastune.app.body.conditions.places import Place
from elastune.forms.expressions import Entry, Expression, symbolic
from elastune.forms.terms import Domain, Fields, Term
from elastune.geometry import Geometry


class Setting(NamedTuple):
    """What a term is made for.

    Attributes:
        fields: What Π is a function of.
        domain: What is integrated over.
        geometry: With the named places.
        held: Mask of the prescribed displacements, owned and ghost.
    """

    fields: Fields
    domain: Domain
    geometry: Geometry
    held: NDArray[np.bool_]

    @property
    def X(self) -> Any:
        """The place at rest."""
        return ufl.SpatialCoordinate(self.domain.mesh)

    def symbolic(self, vector: Sequence[Entry]) -> Any:
        """Numbers and expressions as what forms take."""
        if any(isinstance(entry, Expression) for entry in vector):
            return ufl.as_vector([symbolic(entry, self.X) for entry in vector])
        return fem.Constant(self.domain.mesh, np.array(vector, dtype=np.float64))


class Load(Condition, ABC):
    """A condition that adds to Π; all of one kind become one term a stage.

    Attributes:
        steady: Whether it is there from the start and the same in all stages; it then is a term of its own a place, and
            has a reaction.
    """

    steady: ClassVar[bool] = False

    @property
    def acts(self) -> bool:
        """Whether there is any of it."""
        return True

    @property
    def one_sided(self) -> bool:
        """Whether it takes a face with a side that is outside."""
        return False

    @classmethod
    @abstractmethod
    def term(cls, loads: Mapping[Place, Self], setting: Setting) -> Term:
        """The term of the loads of this kind, by place."""
