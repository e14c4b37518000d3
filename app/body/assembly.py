"""Π, its forces and its volume strains at states, each computed once a state."""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem, la
from numpy.typing import NDArray

from elastune.app.body.conditions.constraints import Constraints
from elastune.app.body.unknowns import Layout, State
from elastune.forms.terms import Convexity, Fields, Term

Array = NDArray[np.float64]

# The iterate, the trial that is looked at, and the point that its pressures aim at.
REMEMBERED = 4


@dataclass
class _Known:
    """What is known of a state."""

    energies: dict[str, float] | None = None
    forces: tuple[Array, Array] | None = None
    strains: Array | None = None
    distortion: float | None = None


class Assembly:
    """What a body's terms add up to.

    The fields hold one state at a time; every method takes the state that it is about, and puts it into the
    fields if another is there.

    Attributes:
        state: What the fields hold.
    """

    def __init__(self, fields: Fields, terms: Sequence[Term], layout: Layout, constraints: Constraints) -> None:
        """Makes the vectors that assembly works in."""
        self.fields, self.terms, self.layout, self._constraints = fields, terms, layout, constraints
        self._known: OrderedDict[int, _Known] = OrderedDict()
        self._vectors = {name: _vector(f.function_space) for name, f in zip("up", fields, strict=True) if f is not None}
        self._unit: dict[str, Array] = {}
        gradient = ufl.grad(fields.u)
        self._distortion = fem.form(ufl.inner(gradient, gradient) * ufl.dx)
        self.state = State(np.zeros(layout.owned))
        self._put(self.state)

    # ------------------------------------------------------------------ the state of the fields

    def take(self, state: State) -> None:
        """Makes the fields hold a state, ghosts too, and the terms its load."""
        if state.stamp != self.state.stamp:
            self._put(state)

    def _put(self, state: State) -> None:
        displacements, pressures = self.layout.split(state.values)
        u, p = self.fields
        u.x.array[: len(displacements)] = displacements
        u.x.scatter_forward()
        if p is not None:
            p.x.array[: len(pressures)] = pressures
            p.x.scatter_forward()
        for term in self.terms:
            term.at(state.load)
            term.refresh()
        self.state = state

    def forget(self) -> None:
        """Forgets what it knows: a term's parameters have changed."""
        self._known.clear()
        self._unit.clear()

    def _of(self, state: State) -> _Known:
        known = self._known.setdefault(state.stamp, _Known())
        self._known.move_to_end(state.stamp)
        if len(self._known) > REMEMBERED:
            self._known.popitem(last=False)
        return known

    # ------------------------------------------------------------------ energies

    def energies(self, state: State) -> dict[str, float]:
        """What each term that has a potential adds to Π, by name; NaN where it is undefined."""
        known = self._of(state)
        if known.energies is None:
            self.take(state)
            terms = [term for term in self.terms if term.conservative]
            with np.errstate(all="ignore"):
                own = np.array([self._own_energy(term, state) for term in terms])
            total = self.layout.comm.allreduce(own)
            known.energies = {term.name: float(value) for term, value in zip(terms, total, strict=True)}
        return known.energies

    def energy(self, state: State) -> float:
        """Π, the same on every rank; NaN where it is undefined."""
        return sum(self.energies(state).values())

    def noise(self, state: State) -> float:
        """What rounding may do to Π: it grows with the energies that Π is the sum of."""
        return 1e-13 * sum(map(abs, self.energies(state).values()))

    def _own_energy(self, term: Term, state: State) -> float:
        if term.linear:
            assert term.factor is not None
            return float(term.factor.value) * float(self.at_full_load(term) @ self.layout.split(state.values)[0])
        return term.own_energy() + (0.0 if term.energy is None else float(fem.assemble_scalar(term.energy)))

    # ------------------------------------------------------------------ forces

    def forces(self, state: State) -> tuple[Array, Array]:
        """Internal and external forces on this rank's displacements, in balance where they sum to zero."""
        known = self._of(state)
        if known.forces is None:
            self.take(state)
            known.forces = self._sum(True), self._sum(False)
        return known.forces

    def of(self, term: Term, state: State) -> Array:
        """A term's forces on this rank's displacements, from its form."""
        self.take(state)
        return self._assembled("u", [term.residual["u"]])

    def _sum(self, internal: bool) -> Array:
        terms = [term for term in self.terms if term.internal == internal]
        changing = [term for term in terms if not term.linear]
        total = self._assembled("u", [term.residual["u"] for term in changing if "u" in term.residual])
        for term in terms:
            if term.linear:
                assert term.factor is not None
                total += float(term.factor.value) * self.at_full_load(term)
            elif (own := term.own_forces()) is not None:
                total += own
        return total

    def at_full_load(self, term: Term) -> Array:
        """Forces of a linear term at full load, on this rank's displacements."""
        if term.name not in self._unit:
            own = term.own_forces()
            self._unit[term.name] = self._assembled("u", [term.residual["u"]]) if own is None else own
        return self._unit[term.name]

    def _assembled(self, field: str, forms: Sequence[fem.Form]) -> Array:
        """A new array of the sum of forms over this rank's values, ghosts' shares added to their owners."""
        b = self._vectors[field]
        own = self.layout.displacements if field == "u" else self.layout.pressures
        if not forms:
            return np.zeros(own)
        b.array[:] = 0.0
        for form in forms:
            fem.assemble_vector(b.array, form)
        b.scatter_reverse(la.InsertMode.add)
        return b.array[:own].copy()

    def strains(self, state: State) -> Array:
        """∂Π/∂p on this rank's pressures: the volume strains that are left; empty without pressures."""
        known = self._of(state)
        if known.strains is None:
            if self.fields.p is None:
                known.strains = np.empty(0)
            else:
                self.take(state)
                known.strains = self._assembled("p", [t.residual["p"] for t in self.terms if "p" in t.residual])
        return known.strains

    def residual(self, state: State) -> Array:
        """A new vector of all forces, reactions at the prescribed displacements among them, and of strains."""
        internal, external = self.forces(state)
        return np.concatenate([internal + external, self.strains(state)])

    def distortion(self, state: State) -> float:
        """∫|∇u|² dX."""
        known = self._of(state)
        if known.distortion is None:
            self.take(state)
            known.distortion = self.layout.total(fem.assemble_scalar(self._distortion))
        return known.distortion

    # ------------------------------------------------------------------ prescribed displacements

    def lift(self, state: State, increment: Array, convexity: Convexity) -> Array:
        """Forces -K Δg of an increment of the prescribed displacements at a state; a vector, not zero where held.

        Args:
            state: Where the tangent is taken.
            increment: Displacements, owned and ghost; read where they are prescribed.
            convexity: Of the tangent.
        """
        self.take(state)
        self._constraints.increment.x.array[:] = increment
        for term in self.terms:
            term.convexify(convexity)
        parts = []
        for field in self._vectors:
            forms = [form for term in self.terms for form in term.tangent.get((field, "u"), ())]
            b = self._vectors[field]
            b.array[:] = 0.0
            for form in forms:
                fem.apply_lifting(b.array, [form], [self._constraints.conditions])
            b.scatter_reverse(la.InsertMode.add)
            parts.append(b.array[: self.layout.displacements if field == "u" else self.layout.pressures].copy())
        for term in self.terms:
            stiffness = term.own_stiffness()
            if stiffness is not None:
                motion, forces = stiffness.createVecs()
                motion.array[:] = increment[: self.layout.displacements]
                stiffness.mult(motion, forces)
                parts[0] -= forces.array_r
        return np.concatenate(parts)


def _vector(space: fem.FunctionSpace) -> la.Vector:
    return la.vector(space.dofmap.index_map, space.dofmap.index_map_bs)
