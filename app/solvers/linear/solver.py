"""What every linear solver offers."""

from typing import ClassVar, NamedTuple

import numpy as np
from petsc4py import PETSc

from elastune.app import interrupts
from elastune.app.body.unknowns import Array
from elastune.app.solvers.outcome import Count, Stopped
from elastune.app.solvers.tangent import Tangent


class Direction(NamedTuple):
    """A solution that is of use.

    Attributes:
        step: A vector, zero where the body is held.
        counted: Whether the tangent's eigenvalues were counted and only as many are negative as there are pressures:
            the state is then a minimum, if it is in balance.
    """

    step: Array
    counted: bool


class LinearSolver:
    """Solves with a tangent as it is assembled.

    A method sets `name`, `inertia` and `_configure`, and may override `_usable`.

    Attributes:
        name: What people call it.
        inertia: Whether it counts negative eigenvalues.
        tangent: What it solves with.
        count: What was spent.
        ksp: PETSc's solver.
    """

    name: ClassVar[str] = ""
    inertia: ClassVar[bool] = False

    def __init__(self, tangent: Tangent, ksp: PETSc.KSP, count: Count) -> None:
        """Configures PETSc's solver; options of its prefix come last."""
        self.tangent, self.ksp, self.count = tangent, ksp, count
        self._b, self._y = tangent.vector(), tangent.vector()
        self._configure()

    def _configure(self) -> None:
        """Chooses PETSc's methods."""
        raise NotImplementedError

    def setup(self) -> None:
        """Takes the tangent as it is assembled now."""
        self.ksp.setOperators(self.tangent.matrix)

    def solve(self, rhs: Array, rtol: float, definite: bool = True) -> Direction | None:
        """Solves after `setup`.

        Args:
            rhs: A vector, zero where the body is held.
            rtol: Relative residual of an iterative method.
            definite: Whether a tangent that is known not to be one of descent is of no use.

        Returns:
            None if the tangent turned out not to be one of descent, or the solution is of no use.

        Raises:
            LinearFailure: If the method broke down for another reason.
            Stopped: If a signal asked to: what follows may take longest of all.
        """
        body, ksp = self.tangent.body, self.ksp
        if number := interrupts.asked(body.comm):
            raise Stopped(number)
        self._b.array[:] = rhs
        ksp.setTolerances(rtol=rtol)
        ksp.solve(self._b, self._y)
        self.count.linear += max(ksp.getIterationNumber(), 1)
        reason = ksp.getConvergedReason()
        if reason == PETSc.KSP.ConvergedReason.DIVERGED_PCSETUP_FAILED:
            # A factorisation that met a singular matrix would stay failed.
            ksp.getPC().reset()
            return None
        if reason <= 0 if not definite else not self._usable(reason):
            return None
        step = self._y.array_r.copy()
        step[body.held] = 0.0
        return Direction(step, self._counts()) if np.isfinite(body.layout.norm(step)) else None

    def _usable(self, reason: int) -> bool:
        """Whether a solution that ended for a reason of PETSc's is of use."""
        return reason > 0

    def _counts(self) -> bool:
        """Whether the present solve counted eigenvalues."""
        return False
