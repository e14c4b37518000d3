"""Branches of equilibria, followed by their length or to a load, through limits, and where others lead off."""

from collections.abc import Iterator
from itertools import islice

import numpy as np

from elastune.app.body.unknowns import Array, State
from elastune.app.solvers.branches.corrector import Corrector, Direction, Point
from elastune.app.solvers.outcome import Failed, LimitLoad, Stalled

# Newton steps that a step's length is chosen for, and how much longer it gets at most.
WANTED, GROWTH = 4, 2.0

# The shortest step, over the longest, and the least cosine between the branch's directions before and after one.
SHORTEST, STRAIGHT = 1e-3, 0.85

# Points that a limit is found by.
TURNS = 4

# Of branches that lead off: first amplitudes and the longest step, over the body's extent, and points at most.
AMPLITUDES, LARGEST, LONG_WAY = (0.01, 0.03), 0.15, 30


class Branch(Corrector):
    """Follows a branch by its length (Keller's pseudo-arclength).

    Reference:
        Keller 1977, Numerical solution of bifurcation and nonlinear eigenvalue problems; Riks 1979, Int. J. Solids
        Struct. 15:529.
    """

    def toward(self, state: State, load: float) -> Iterator[Point]:
        """Points of the branch from a state on, the last of them at a load.

        Args:
            state: In balance at another load.
            load: Where the branch is to lead.

        Raises:
            LimitLoad: If it turns back before.
            NotConverged: If it cannot be followed.
        """
        sign = float(np.sign(load - state.load))
        point = self.balanced(state, sign)
        yield from self.on(point, load, (load - state.load) / point.direction.load)

    def on(
        self, point: Point, load: float, length: float, longest: float | None = None, through: bool = False
    ) -> Iterator[Point]:
        """Points from another one on, as far as a load; see `toward`.

        Args:
            point: On the branch.
            load: Where it is to lead.
            length: Of the first step.
            longest: Of all steps; as the first unless given.
            through: Whether it may turn back on the way.

        Raises:
            LimitLoad: If it turns back before, and may not.
            NotConverged: If it cannot be followed.
        """
        sign = float(np.sign(load - point.state.load))
        for following in self.walk(point, length, longest):
            before, after = point.state, following.state
            if sign * (after.load - load) >= 0:
                share = (load - before.load) / (after.load - before.load)
                values = before.values + share * (after.values - before.values)
                yield self.at(State(values, load))
                return
            if not through and sign * point.direction.load > 0 >= sign * following.direction.load:
                highest = self.turn(point, following).state
                under = (
                    "dead load"
                    if all(term.linear for term in self.body.terms if term.factor is not None)
                    else "this load"
                )
                raise LimitLoad(
                    f"limit load {highest.load:.4g}; beyond it there is no equilibrium under {under}", highest
                )
            yield following
            point = following

    def walk(self, point: Point, length: float, longest: float | None = None) -> Iterator[Point]:
        """Points farther and farther along, at distances that Newton's method likes.

        Args:
            point: Where to set out.
            length: Of the first step.
            longest: Of all steps; as the first unless given.

        Raises:
            NotConverged: If steps of a thousandth of that fail.
        """
        longest = longest or length
        while True:
            try:
                following, steps = self._ahead(point, length)
            except Failed:
                if length < SHORTEST * longest:
                    raise
                length /= 2
                continue
            length = min(longest, length * float(np.clip(WANTED / max(steps, 1), 0.5, GROWTH)))
            point = following
            yield point

    def turn(self, one: Point, other: Point) -> Point:
        """Where the load is stationary between two points, on whose branch it rises at one and falls at the other."""
        found = one
        for _ in range(TURNS):
            gap = Direction(other.state.values - one.state.values, other.state.load - one.state.load)
            length = float(np.sqrt(self.product(gap, gap)))
            share = one.direction.load / (one.direction.load - other.direction.load)
            try:
                found, _ = self._ahead(one, share * length)
            except Failed:
                return one
            if found.direction.load * one.direction.load > 0:
                one = found
            else:
                other = found
        return found

    def off(self, state: State, mode: Array, load: float) -> Point:
        """The state at a load on the branch that leads off an unstable one.

        Args:
            state: In balance, at the load.
            mode: The motion along which it leads off, and its sense.
            load: The load, beyond that where it does.

        Raises:
            NotConverged: If there is none that can be followed.
        """
        self.balanced(state)
        across = Direction(mode / np.sqrt(self.dot(mode, mode)), 0.0)
        for amplitude in AMPLITUDES:
            try:
                start, _ = self.settle(State(state.values + amplitude * across.motion, load), across)
                for found in islice(self.on(self.point(start, across), load, amplitude, LARGEST), LONG_WAY):
                    if found.state.load == load:
                        return found
            except Failed:
                pass
        raise Stalled("the branch that leads off does not lead to the load", state)

    def _ahead(self, point: Point, length: float) -> tuple[Point, int]:
        """The point of the branch at about a distance from another, and the Newton steps that it took."""
        way = point.direction
        guess = State(point.state.values + length * way.motion, point.state.load + length * way.load)
        state, steps = self.settle(guess, way)
        following = self.point(state, way)
        if self.product(following.direction, way) < STRAIGHT:
            raise Stalled("the branch turns", state)
        return following, steps
