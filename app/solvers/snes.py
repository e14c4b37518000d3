"""PETSc's SNES around a body: what its methods ask for, and Newton's method as one of them."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np
from petsc4py import PETSc

from elastune.app.body.unknowns import State
from elastune.app.solvers.globalise.balance import Balance
from elastune.app.solvers.linear.choose import choose
from elastune.app.solvers.newton import Newton
from elastune.app.solvers.options import Options
from elastune.app.solvers.outcome import Count, Deadline, NotConverged, Stalled, TooManySteps
from elastune.app.solvers.tangent import Tangent
from elastune.forms.terms import RAW

Until = Callable[[], bool] | None
Reason = PETSc.SNES.ConvergedReason


class Shell(ABC):
    """A SNES that minimises Π of a body at the load of the state it is given.

    Attributes:
        snes: PETSc's object.
        tangent: Is assembled anew.
        count: Of what is spent.
    """

    def __init__(self, tangent: Tangent, options: Options, prefix: str, count: Count, deadline: Deadline) -> None:
        """Creates it; methods and options of PETSc are for the subclass to set.

        Args:
            tangent: Its matrix is SNES's Jacobian.
            options: Tolerance and number of steps.
            prefix: Of PETSc's options.
            count: Of what is spent.
            deadline: When to stop.
        """
        self.body, self.tangent, self.options, self.count = tangent.body, tangent, options, count
        self._deadline, self._balance, self._start = deadline, Balance(tangent.body), tangent.body.state
        self._until: Until = None
        self._failure: NotConverged | KeyboardInterrupt | None = None
        self.snes = PETSc.SNES().create(self.body.comm)
        self.snes.setOptionsPrefix(prefix)
        self.snes.setFunction(self._function, tangent.vector())
        if self.body.conservative:
            self.snes.setObjective(self._objective)
        # Its own tests know nothing of what is large.
        self.snes.setTolerances(rtol=0.0, atol=0.0, stol=0.0, max_it=options.max_iterations)
        self.snes.setConvergenceTest(self._test)

    def run(self, state: State, until: Until = None) -> State:
        """Where SNES ends.

        Args:
            state: The start, its prescribed displacements right.
            until: Stops early where it holds of the body's state.

        Raises:
            NotConverged: With the kind of failure.
        """
        self._start, self._until, self._failure, self._balance = state, until, None, Balance(self.body)
        x = self.tangent.vector(state.values)
        try:
            self.snes.solve(None, x)
        finally:
            if self.snes.getType() != "python":
                self.count.newton += self.snes.getIterationNumber()
                self.count.linear += self.snes.getLinearSolveIterations()
        if self._failure is not None:
            raise self._failure
        found = self._state(x)
        self._ended(self.snes.getConvergedReason(), found)
        return found

    def _ended(self, reason: int, found: State) -> None:
        """Raises if a reason of PETSc's is a failure."""
        if reason < 0:
            kind = TooManySteps if reason == Reason.DIVERGED_MAX_IT else Stalled
            raise kind(f"SNES {self.snes.getType()} stopped with reason {reason}", found)

    @abstractmethod
    def _arrived(self, state: State, error: float) -> bool:
        """Whether an iterate is good enough."""

    def _state(self, x: PETSc.Vec) -> State:
        # An iterative solver's steps are not zero to the last digit where displacements are prescribed.
        return State(np.where(self.body.held, self._start.values, x.array_r), self._start.load)

    def _objective(self, snes: PETSc.SNES, x: PETSc.Vec) -> float:
        energy = self.body.assembly.energy(self._state(x))
        return energy if np.isfinite(energy) else np.inf

    def _function(self, snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        f.array[:] = self._balance.out_of_balance(self._state(x))

    def _test(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]) -> int:
        state = self._state(snes.getSolution())
        try:
            self._deadline.check(state)
        except NotConverged as failure:
            self._failure = failure
            return Reason.DIVERGED_FUNCTION_COUNT
        self._balance.accept(state)
        if self._arrived(state, self._balance.error(state)):
            return Reason.CONVERGED_FNORM_RELATIVE
        self.body.take(state)
        return Reason.CONVERGED_ITS if self._until is not None and self._until() else Reason.CONVERGED_ITERATING


class NewtonShell(Shell):
    """SNES of the type "python", which is `Newton`; or of another type that PETSc's options name.

    Attributes:
        linear: The solver of its tangent.
        watchful: Whether to stop at saddle points.
        patience: Filtered steps in a row before it stops too.
        suspicious: Whether a saddle point has been left: then every true tangent is asked for its eigenvalues.
    """

    def __init__(
        self,
        tangent: Tangent,
        options: Options,
        count: Count,
        deadline: Deadline,
        unstable: Callable[[State], bool],
    ) -> None:
        """Creates SNES and the linear solver.

        Args:
            tangent: Of the body.
            options: All of them.
            count: Of what is spent.
            deadline: When to stop.
            unstable: Whether the tangent at a state nearly in balance has a negative eigenvalue.
        """
        super().__init__(tangent, options, options.prefix, count, deadline)
        self._unstable = unstable
        self.watchful, self.patience, self.suspicious = False, np.inf, False
        self._found: State | None = None
        # A branch is followed through tangents that no iterative method is for.
        linear = options.linear if options.follow == "minimum" else "direct"
        self.linear = choose(tangent, self.snes.getKSP(), count, linear)
        self.snes.setJacobian(self._jacobian, tangent.matrix)
        self.snes.setType("python")
        self.snes.setPythonContext(self)
        self.snes.setFromOptions()

    def run(self, state: State, until: Until = None) -> State:
        """See `Shell`; a state that Newton's method has found is returned as it is, with what is known of it."""
        self._found = None
        found = super().run(state, until)
        return found if self._found is None else self._found

    def solve(self, snes: PETSc.SNES, b: Any, x: PETSc.Vec) -> None:
        """SNES's call to the type "python"; leaves the solution in x, or the reason in `_failure`."""

        def monitor(iteration: int, state: State, norm: float) -> None:
            self._deadline.check(state)
            snes.setIterationNumber(iteration)
            snes.setFunctionNorm(norm)
            snes.monitor(iteration, norm)

        try:
            start = self._state(x)
            suspicious = self.suspicious and not self.linear.inertia
            newton = Newton(self.linear, self.options, start, self.watchful, self.patience, self._unstable, suspicious)
            self._found = newton.run(monitor, self._until)
            x.array[:] = self._found.values
            snes.setConvergedReason(Reason.CONVERGED_FNORM_RELATIVE)
        # PETSc makes an error without a name of any other exception: in a notebook Ctrl-C is to stay what it is.
        except (NotConverged, KeyboardInterrupt) as failure:
            self._failure = failure
            snes.setConvergedReason(Reason.DIVERGED_LINE_SEARCH)

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, matrix: PETSc.Mat, preconditioner: PETSc.Mat) -> None:
        self.tangent.assemble(self._state(x), RAW)

    def _arrived(self, state: State, error: float) -> bool:
        """In balance: of PETSc's own methods; `Newton` has its own eye on it."""
        return error <= self.options.tolerance
