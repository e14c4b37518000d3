"""One summand of Π: an energy with its derivatives, or forces that have none."""

from collections.abc import Callable, Mapping
from typing import Any, Literal, NamedTuple

import ufl
from dolfinx import fem

Form = Any
Field = str


class Fields(NamedTuple):
    """What Π is a function of: the displacement, and of mixed elements the pressure."""

    u: fem.Function
    p: fem.Function | None = None


class Convexity(NamedTuple):
    """What is done to a tangent to make it convex.

    Attributes:
        filter: What becomes of negative eigenvalues, point by point.
        share: How much of the stiffness of a membrane of the body's shear modulus is added.
    """

    filter: Literal["none", "clamp", "absolute"] = "none"
    share: float = 0.0


RAW = Convexity()


class Term:
    """A named summand of Π, at the present values of the fields.

    A term of a pattern of its own, such as contact, overrides `own_forces`, `own_stiffness` and `own_energy`
    beside, or instead of, giving forms.

    Attributes:
        name: What people call it.
        energy: A functional; None where the forces have no potential, or where `linear` says it.
        residual: Its derivative by field.
        tangent: Its second derivative by pair of fields, rows first; several forms of one pair are summed.
        internal: Whether the forces are those of the body against itself, not loads.
        conservative: Whether the forces have a potential.
        convex: Whether the tangent in the displacement is positive semi-definite once it is convexified.
        linear: Whether the forces depend on the load only: they are assembled once, and Π is their work.
        factor: Constant that the amplitude is put into; None of a term that knows no load.
        amplitude: How much of it there is at a load factor.
    """

    internal = False
    conservative = True
    convex = False
    linear = False

    def __init__(
        self,
        name: str,
        energy: Form | None = None,
        residual: Mapping[Field, Form] | None = None,
        tangent: Mapping[tuple[Field, Field], list[Form]] | None = None,
        factor: fem.Constant | None = None,
    ) -> None:
        """Takes compiled forms."""
        self.name, self.energy, self.factor = name, energy, factor
        self.amplitude: Callable[[float], float] = float
        self.residual: dict[Field, Form] = dict(residual or {})
        self.tangent: dict[tuple[Field, Field], list[Form]] = dict(tangent or {})

    @classmethod
    def from_energy(cls, name: str, energy: Any, fields: Fields, factor: fem.Constant | None = None) -> "Term":
        """A term whose derivatives in the displacement are UFL's.

        Args:
            name: What people call it.
            energy: A UFL functional of the displacement.
            fields: What it is a function of.
            factor: A constant of it that follows the load factor.
        """
        V = fields.u.function_space
        residual = ufl.derivative(energy, fields.u, ufl.TestFunction(V))
        tangent = ufl.derivative(residual, fields.u, ufl.TrialFunction(V))
        return cls(name, fem.form(energy), {"u": fem.form(residual)}, {("u", "u"): [fem.form(tangent)]}, factor)

    def at(self, load: float) -> None:
        """Takes a load factor."""
        if self.factor is not None:
            self.factor.value = self.amplitude(load)

    def refresh(self) -> None:
        """Updates what depends on the fields beside the forms; called when they have changed."""

    def convexify(self, convexity: Convexity) -> None:
        """Makes the next tangent as convex as is asked for; terms that cannot stay as they are."""

    def longest(self, direction: Any) -> float:
        """The longest step that the term allows from the present state.

        Args:
            direction: Change of the displacement, an array of its owned and ghost values.
        """
        return float("inf")

    def own_energy(self) -> float:
        """This rank's part of an energy that is no form."""
        return 0.0

    def own_forces(self) -> Any:
        """Forces that are no form: an array of the displacement's owned values, or None; of a linear term in full."""
        return None

    def own_stiffness(self) -> Any:
        """A PETSc matrix of the displacement's, of any pattern, with the derivative of `own_forces`; or None."""
        return None
