"""Finds equilibria of least Π: Newton's method first, and what leads it on where it cannot go on by itself."""

from functools import cached_property

import numpy as np

from elastune.app.body.body import Body
from elastune.app.body.shapes import noise
from elastune.app.body.unknowns import Array, State
from elastune.app.solvers.branches.branch import Branch
from elastune.app.solvers.branches.corrector import Point
from elastune.app.solvers.globalise.balance import Balance
from elastune.app.solvers.globalise.escape import escape
from elastune.app.solvers.linear.direct import Direct
from elastune.app.solvers.linear.solver import LinearSolver
from elastune.app.solvers.newton import ladder
from elastune.app.solvers.options import Options
from elastune.app.solvers.outcome import Count, Deadline, Indefinite, LeadOn, Saddle
from elastune.app.solvers.snes import NewtonShell, Until
from elastune.app.solvers.stability import Stability, random_forces
from elastune.app.solvers.tangent import Tangent
from elastune.app.solvers.trust_region import TrustRegion
from elastune.forms.terms import RAW

# How often Newton's method is led on where it cannot go on, and the noise that moves the body before the trust
# region takes over, relative to its extent.
ATTEMPTS, NOISE = 6, 1e-4

# Filtered steps in a row after which steps that know negative curvature do better.
PATIENCE = 12

# Relative residual of a prediction, whose own error is larger.
PREDICTION = 1e-4


class Minimizer:
    """Minimises Π of a body at given loads.

    Attributes:
        body: Whose Π it is.
        options: How.
        count: What was spent.
        tangent: The tangent that steps and predictions share.
        linear: Its solver.
        saddles: How many saddle points were left on the way to it.
        proven: Whether the last state that was found is a minimum; None where nobody tells.
    """

    def __init__(self, body: Body, options: Options) -> None:
        """Creates PETSc's solvers and the matrices for a body."""
        self.body, self.options, self.count = body, options, Count()
        self._deadline = Deadline(body.comm, options.time_limit)
        self.tangent = Tangent(body)
        self._newton = NewtonShell(self.tangent, options, self.count, self._deadline, self._unstable)
        self.linear: LinearSolver = self._newton.linear
        self.proven: bool | None = None
        self.saddles = 0

    @cached_property
    def _stability(self) -> Stability:
        return Stability(self.tangent, self.linear)

    @cached_property
    def _trust_region(self) -> TrustRegion:
        direct = self.linear.name == "direct"
        return TrustRegion(self.tangent, direct, self.options, self.count, self._deadline)

    def predict(self, state: State, load: float, prescribed: Array | None = None) -> State:
        """First-order prediction of the state at a new load.

        Args:
            state: In balance at its own load.
            load: The new load factor.
            prescribed: Displacements, owned and ghost, that are prescribed; those of the new load by default.

        Raises:
            NotConverged: If no tangent gives one.
        """
        body, layout = self.body, self.body.layout
        ahead = State(state.values.copy(), load)
        residual = Balance(body).out_of_balance(ahead)
        body.take(ahead)
        increment = (body.prescribed(load) if prescribed is None else prescribed) - body.u.x.array
        values = state.values + np.where(body.held, layout.joined(increment), 0.0)
        for convexity in ladder(body, self.options):
            if not (self.tangent.settled and convexity == RAW):
                self.tangent.assemble(ahead, convexity)
                self.linear.setup()
            forces = body.assembly.lift(ahead, increment, convexity)
            forces[body.held] = 0.0
            direction = self.linear.solve(forces - residual, PREDICTION)
            if direction is not None:
                guess = State(values + direction.step, load)
                # A pressure may be predicted that no volume ratio of the material has.
                if body.p is None or np.isfinite(layout.norm(body.assembly.residual(guess))):
                    return guess
                return State(layout.joined(guess.values, layout.split(state.values)[1]), load)
        raise Indefinite("the prediction's tangent has negative eigenvalues, however filtered", state)

    @cached_property
    def branch(self) -> Branch | None:
        """Of states in balance, if the linear solver factorises."""
        linear = self.linear
        return Branch(linear, self.options, self.count, self._deadline) if isinstance(linear, Direct) else None

    def unstable(self, point: Point) -> bool:
        """Whether a point of a branch is no minimum, by more than rounding; no where nobody counts eigenvalues."""
        return bool(point.negative) and self._lost(point.state)

    def off(self, point: Point) -> Point:
        """The state at the same load on the branch that leads off an unstable point along its softest motion.

        Raises:
            NotConverged: If there is none that can be followed.
        """
        assert self.branch is not None
        if not self.body.parts.can_filter:
            raise Indefinite("no direction is known in which the energy falls", point.state)
        return self.branch.off(point.state, self._stability.valley(point.state), point.state.load)

    def minimize(
        self,
        state: State,
        until: Until = None,
        patience: float = PATIENCE,
        prove: bool = False,
        led: bool = True,
    ) -> State:
        """The minimiser from a state whose prescribed displacements are right.

        Args:
            state: The state, at its load.
            until: Stops early where it holds of the body's state.
            patience: Filtered steps in a row before steps that know negative curvature take over.
            prove: Whether to make sure that it is a minimum where the linear solver counts no eigenvalues.
            led: Whether it is led on where Newton's method cannot go on by itself.

        Raises:
            NotConverged: With the kind of failure.
        """
        body, newton = self.body, self._newton
        self.proven, self.saddles = None, 0
        if self.options.method == "trust-region":
            state = self._trust_region.run(state, until)
        newton.patience = patience if body.p is None else np.inf
        for seed in range(ATTEMPTS if body.conservative and body.parts.can_filter else 0):
            try:
                # A prediction may well be in balance: at rest, without loads.
                newton.watchful, newton.suspicious = True, seed > 0 and body.p is not None
                found = newton.run(state, until)
                if prove and not self.linear.inertia and self._stability.downwards(found) is not None:
                    raise Saddle("a saddle point", found)
                self.proven = True if prove or self.linear.inertia else None
                return found
            except LeadOn as failure:
                if not led or failure.state is None or (body.p is not None and not isinstance(failure, Saddle)):
                    raise
                state = self._led_on(failure, state, seed, until)
        newton.watchful, newton.patience, newton.suspicious = False, np.inf, False
        return newton.run(state, until)

    def _led_on(self, failure: LeadOn, state: State, seed: int, until: Until) -> State:
        """Where to start again from, after Newton's method has set out from `state` and failed."""
        body, stopped = self.body, failure.state
        assert stopped is not None
        if isinstance(failure, Saddle):
            self.saddles += 1
            direction = self._stability.downwards(stopped)
            lower = None if direction is None else escape(body, stopped, direction)
            if lower is not None:
                return lower
        values = stopped.values + body.layout.joined(NOISE * body.extent * (2 * noise(body, seed) - 1).ravel())
        shaken = State(np.where(body.held, state.values, values), state.load)
        return shaken if body.p is not None else self._trust_region.run(shaken, until)

    def _unstable(self, state: State) -> bool:
        """Whether the tangent has a negative eigenvalue that it should not have."""
        if not self.linear.inertia:
            return self._stability.downwards(state) is not None
        self.tangent.assemble(state, RAW)
        self.linear.setup()
        return self.linear.solve(random_forces(self.tangent), PREDICTION) is None and self._lost(state)

    def _lost(self, state: State) -> bool:
        """Whether a negative eigenvalue that was counted is more than rounding."""
        return not self.body.parts.can_filter or self._stability.downwards(state) is not None
