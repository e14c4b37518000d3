"""Points on branches of equilibria: Newton's method on states and load together."""

from dataclasses import dataclass

import numpy as np

from elastune.app.body.unknowns import Array, State
from elastune.app.solvers.globalise.balance import Balance
from elastune.app.solvers.linear.direct import Direct
from elastune.app.solvers.options import Options
from elastune.app.solvers.outcome import Count, Deadline, Indefinite, Stalled
from elastune.forms.terms import RAW

# Newton steps after which a point of a branch is given up; how much larger than after the first of them, which may have
# to climb, the error may become.
LONGEST, WORST = 12, 10.0

# A load so much farther tells how the forces change with it.
AHEAD = 1e-4


@dataclass(frozen=True)
class Direction:
    """Which way a branch goes.

    Attributes:
        motion: Of the unknowns, a vector.
        load: Of the load; both per unit length.
    """

    motion: Array
    load: float


@dataclass(frozen=True)
class Point:
    """A state on a branch.

    Attributes:
        state: In balance.
        direction: Of the branch there.
        negative: Negative eigenvalues of the tangent, or None where nobody counts them.
    """

    state: State
    direction: Direction
    negative: int | None


class Corrector:
    """Newton's method for points of a branch, whatever the sign of the tangent.

    Lengths are the root mean square of displacements over the body's extent, and `weight` times the load.
    """

    def __init__(self, linear: Direct, options: Options, count: Count, deadline: Deadline) -> None:
        """Of a body.

        Args:
            linear: Factorises its tangent.
            options: The tolerance.
            count: Of what is spent.
            deadline: When to stop.
        """
        self._linear, self._tangent, self._options = linear, linear.tangent, options
        self.body, self._count, self._deadline = linear.tangent.body, count, deadline
        self.weight = 1.0

    # ------------------------------------------------------------------ lengths

    def dot(self, one: Array, other: Array) -> float:
        """Mean over the nodes of the product of two motions, over the square of the body's extent."""
        layout = self.body.layout
        nodes = (layout.size - layout.total_pressures) / layout.dimension
        return layout.total(layout.split(one)[0] @ layout.split(other)[0]) / (nodes * self.body.extent**2)

    def product(self, one: Direction, other: Direction) -> float:
        """The same of directions, the load with its weight."""
        return self.dot(one.motion, other.motion) + self.weight**2 * one.load * other.load

    # ------------------------------------------------------------------ points

    def balanced(self, state: State, toward: float = 1.0) -> Point:
        """The branch at a state in balance, in the sense of rising or falling loads, which weigh as much as motions.

        Args:
            state: In balance.
            toward: Its sign is that of the change of the load.

        Raises:
            NotConverged: If its tangent is singular.
        """
        self._factor(state)
        sign = float(np.sign(toward))
        rate = self._rate(state, sign)
        self.weight = float(np.sqrt(self.dot(rate, rate))) or 1.0
        return self.point(state, Direction(sign * rate, sign))

    def at(self, guess: State) -> Point:
        """The point near a guess, at its load.

        Raises:
            NotConverged: If Newton's method does not contract.
        """
        return self.point(self.settle(guess)[0], Direction(np.zeros_like(guess.values), 1.0))

    def settle(self, guess: State, across: Direction | None = None) -> tuple[State, int]:
        """The state in balance near a guess: at its load, or in the plane through it across a direction.

        Args:
            guess: Near the branch.
            across: The plane's normal; at the guess's load without.

        Returns:
            The state, and the Newton steps that it took.

        Raises:
            NotConverged: If Newton's method does not contract.
        """
        body, balance = self.body, Balance(self.body)
        state, first = body.placed(guess.values, guess.load), np.inf
        for number in range(LONGEST + 1):
            self._deadline.check(state)
            residual = balance.out_of_balance(state)
            error = balance.error(state)
            balance.accept(state)
            if error <= self._options.tolerance:
                return state, number
            # The forces of slender bodies rise and fall by turns.
            if number == 1:
                first = error
            if not np.isfinite(error) or error > WORST * first:
                break
            self._factor(state)
            self._count.newton += 1
            step, change = self._solve(-residual), 0.0
            if across is not None:
                rate = self._rate(state)
                off = state.values + step - guess.values
                change = -(self.dot(across.motion, off) + self.weight**2 * across.load * (state.load - guess.load))
                change /= self.dot(across.motion, rate) + self.weight**2 * across.load
                step = step + change * rate
            state = body.placed(state.values + step, state.load + change)
        raise Stalled(f"no contraction to a branch, residual {error:.1e}", state)

    def point(self, state: State, before: Direction) -> Point:
        """The branch at a state in balance, in the sense of a direction."""
        self._factor(state)
        rate = self._rate(state, 1.0 if before.load >= 0 else -1.0)
        direction = Direction(rate, 1.0)
        size = float(np.sqrt(self.product(direction, direction)))
        sign = 1.0 if self.product(direction, before) >= 0 else -1.0
        return Point(state, Direction(np.float64(sign / size) * rate, sign / size), self._linear.surplus())

    # ------------------------------------------------------------------ the tangent

    def _factor(self, state: State) -> None:
        if self._tangent.state is not state or self._tangent.convexity != RAW:
            self._tangent.assemble(state, RAW)
            self._linear.setup()

    def _solve(self, rhs: Array) -> Array:
        direction = self._linear.solve(rhs, 0.0, definite=False)
        if direction is None:
            raise Indefinite("the tangent is singular", self._tangent.state)
        return direction.step

    def _rate(self, state: State, toward: float = 1.0) -> Array:
        """How the state in balance changes with the load."""
        body, layout, ahead = self.body, self.body.layout, toward * AHEAD
        balance = Balance(body)
        farther = State(state.values, state.load + ahead)
        forces = balance.out_of_balance(farther) - balance.out_of_balance(state)
        body.take(state)
        increment = body.prescribed(state.load + ahead) - body.u.x.array
        lifted = body.assembly.lift(state, increment, RAW)
        lifted[body.held] = 0.0
        change: Array = np.where(body.held, layout.joined(increment), 0.0) + self._solve(lifted - forces)
        return change / np.float64(ahead)
