"""What a step is to lower: Π, an augmented Lagrangian of mixed elements, or without a potential the forces."""

from abc import ABC, abstractmethod

import numpy as np
from mpi4py import MPI

from elastune.app.body.body import Body
from elastune.app.body.unknowns import Array, State
from elastune.app.solvers.globalise.balance import Balance
from elastune.app.solvers.globalise.linesearch import Line, backtrack, extend

# A filtered tangent is too stiff where it took negative curvature away: its step may be this many times too short.
LONGEST = 32.0

# A step of mixed elements that is shorter than this, of a whole one, comes from a tangent that says nothing.
SHORTEST = 1e-3


class Merit(ABC):
    """A function of the state that falls from iterate to iterate."""

    def __init__(self, body: Body, balance: Balance) -> None:
        """Of a body."""
        self.body, self.balance = body, balance

    @abstractmethod
    def value(self, state: State) -> float:
        """How good a state is to start from; not finite where none can."""

    @abstractmethod
    def search(self, state: State, step: Array, filtered: bool, counted: bool) -> State | None:
        """The state after a step, shortened or lengthened; None if no length lowers the merit.

        Args:
            state: The iterate.
            step: A direction, a vector.
            filtered: Whether a filtered tangent gave it.
            counted: Whether the tangent's eigenvalues were counted.
        """

    def _first(self, step: Array, filtered: bool) -> float:
        """A whole step, or as much as terms allow; of a filtered tangent, which sees not far, at most half the body."""
        body = self.body
        largest = max(float(np.abs(body.layout.split(step)[0]).max(initial=0.0)), 1e-300)
        first = min(1.0, body.extent / 2 / body.comm.allreduce(largest, op=MPI.MAX)) if filtered else 1.0
        return min([first, *(term.longest(step) for term in body.terms)])


class Energy(Merit):
    """Π itself.

    Where its decrease drowns in rounding the slope decides instead (the approximate Wolfe condition of Hager & Zhang
    2005), or the forces. The step of a filtered tangent is doubled as long as Π falls.
    """

    def value(self, state: State) -> float:
        """Π."""
        return self.body.assembly.energy(state)

    def search(self, state: State, step: Array, filtered: bool, counted: bool) -> State | None:
        """See `Merit`."""
        body, balance, assembly = self.body, self.balance, self.body.assembly
        gradient = balance.out_of_balance(state)
        slope = body.layout.dot(gradient, step)
        if not slope < 0:
            return None
        norm = body.layout.norm(gradient)
        # Of the trials, those looked at twice.
        trials: dict[float, State] = {}

        def trial(length: float) -> State:
            return trials.setdefault(length, moved(state, step, length))

        def agrees(length: float) -> bool:
            forces = balance.out_of_balance(trial(length))
            return abs(body.layout.dot(forces, step)) <= 0.9 * abs(slope) or body.layout.norm(forces) < norm

        # A body of no energy has rounding too.
        rounding = assembly.noise(state) + 1e-16 * body.stiffness * body.extent
        line = Line(lambda length: assembly.energy(trial(length)), assembly.energy(state), slope, rounding, agrees)
        length = backtrack(line, self._first(step, filtered))
        if length is None:
            return None
        if filtered and length == 1.0 and line.value(length) < line.start - rounding:
            length = extend(line, length, LONGEST)
        return trial(length)


class AugmentedLagrangian(Merit):
    """Π(u, p̂) + γ ∫μθ²/2 dX with θ = ∂Π/∂p (u, p̂), at the pressure p̂ that a step aims at.

    Newton's direction is one of descent of it for large enough γ, and its own Newton direction, so that steps end up
    whole; unlike the energy with the pressure eliminated, it does not punish a step for the volume that it changes to
    second order with an infinite λ.

    Reference:
        Nocedal & Wright 2006, Numerical Optimization, Sections 17.3, 18.4.
    """

    def value(self, state: State) -> float:
        """The error, finite where the forces are."""
        return self.balance.error(state)

    def search(self, state: State, step: Array, filtered: bool, counted: bool) -> State | None:
        """See `Merit`; the step's pressures are cut where they aim at what no volume ratio of the material has."""
        body, assembly, layout = self.body, self.body.assembly, self.body.layout
        motion, pressures = layout.joined(step), step - layout.joined(step)
        for _ in range(30):
            aim = State(state.values + pressures, state.load)
            residual = self.balance.out_of_balance(aim)
            if np.isfinite(layout.norm(residual)):
                break
            pressures = 0.5 * pressures
        slope = layout.dot(residual, motion)
        work, weight = body.pressures.work(layout.split(residual)[1]), 1.0
        if slope > 0:
            # Of a tangent whose eigenvalues nobody counted, a large weight is a sign that they are wrong.
            limit = np.inf if counted else 10.0
            weight = max(weight, slope / work) if work > 0 else np.inf
            if not weight < limit:
                return None

        def value(length: float) -> float:
            trial = moved(aim, motion, length)
            return assembly.energy(trial) + weight * body.pressures.work(assembly.strains(trial))

        start = assembly.energy(aim) + weight * work
        # Volume ratios are rounded relative to one, whatever the pressure.
        rounding = assembly.noise(aim) + 1e-16 * body.stiffness * body.parts.contrast * body.extent
        line = Line(value, start, slope - 2 * weight * work, rounding)
        length = backtrack(line, min(1.0, self._first(step, False)), SHORTEST)
        return None if length is None else State(state.values + length * (motion + pressures), state.load)


class Forces(Merit):
    """Half the square of the forces out of balance and of volume strains, relative to their scales at the iterate."""

    def value(self, state: State) -> float:
        """The error, finite where the forces are."""
        return self.balance.error(state)

    def search(self, state: State, step: Array, filtered: bool, counted: bool) -> State | None:
        """See `Merit`; there is no energy that would tell whether a longer step is a better one."""
        scales = self.balance.scales(state)
        trials: dict[float, State] = {}

        def value(length: float) -> float:
            here = trials.setdefault(length, moved(state, step, length))
            return 0.5 * sum((part / scale) ** 2 for part, scale in zip(self.balance.parts(here), scales, strict=True))

        start = value(0.0)
        length = backtrack(Line(value, start, -2 * start), self._first(step, filtered))
        return None if length is None else trials[length]


def choose(body: Body, balance: Balance) -> Merit:
    """The merit of a body's problem."""
    if not body.conservative:
        return Forces(body, balance)
    return Energy(body, balance) if body.p is None else AugmentedLagrangian(body, balance)


def moved(state: State, step: Array, length: float) -> State:
    """A state farther along."""
    return State(state.values + length * step, state.load)
