"""A trust region by PETSc's SNES: steps that know negative curvature."""

from functools import cached_property

from petsc4py import PETSc

from elastune.app.body.unknowns import State
from elastune.app.solvers.options import Options
from elastune.app.solvers.outcome import Count, Deadline, Undefined
from elastune.app.solvers.snes import Shell, Until
from elastune.app.solvers.tangent import Tangent
from elastune.forms.terms import RAW, Convexity

# The trust region hands over where the error has fallen to this: the differences of the energy that it lives on are
# lost in rounding near the minimum, where Newton's method needs no help.
HANDOVER = 1e-4


class TrustRegion(Shell):
    """Goes to where Newton's method can take over, or as far as it gets.

    Steihaug's conjugate gradients on the true tangent follow negative curvature to the region's edge instead of
    filtering it away. The filtered tangent is their preconditioner, so that near the minimum, where both agree, one
    factorisation gives the step. Displacement elements only.

    Reference:
        Steihaug 1983, SIAM J. Numer. Anal. 20:626.
    """

    def __init__(self, tangent: Tangent, direct: bool, options: Options, count: Count, deadline: Deadline) -> None:
        """See `Shell`.

        Args:
            tangent: Of the body.
            direct: Whether the preconditioner is factorised.
            options: Tolerance and number of steps.
            count: Of what is spent.
            deadline: When to stop.
        """
        super().__init__(tangent, options, f"{options.prefix}trust_", count, deadline)
        self.snes.setType("newtontr")
        self.snes.setJacobian(self._jacobian, tangent.matrix, self._filtered.matrix)
        ksp, pc = self.snes.getKSP(), self.snes.getKSP().getPC()
        ksp.setType("stcg")
        ksp.setTolerances(rtol=1e-2, max_it=200)
        pc.setType("cholesky" if direct else "gamg")
        if direct:
            pc.setFactorSolverType("mumps")
        else:
            self._filtered.matrix.setNearNullSpace(self._filtered.rigid_motions)
        self.snes.setFromOptions()

    @cached_property
    def _filtered(self) -> Tangent:
        return Tangent(self.body)

    def run(self, state: State, until: Until = None) -> State:
        """A state of less Π.

        Args:
            state: The start, its prescribed displacements right.
            until: Stops early where it holds of the body's state.

        Raises:
            NotConverged: If the time is up, or the loads have no potential.
        """
        if not self.body.conservative:
            raise Undefined("a trust region needs loads with a potential", state)
        return super().run(state, until)

    def _ended(self, reason: int, found: State) -> None:
        """As far as it gets is good enough."""

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, matrix: PETSc.Mat, preconditioner: PETSc.Mat) -> None:
        state = self._state(x)
        self.tangent.assemble(state, RAW)
        self._filtered.assemble(state, Convexity("clamp"))

    def _arrived(self, state: State, error: float) -> bool:
        """Where the last step met no negative curvature and stayed inside, Newton's would be the same."""
        inside = self.snes.getKSP().getConvergedReason() == PETSc.KSP.ConvergedReason.CONVERGED_RTOL
        return inside and error <= max(HANDOVER, self.options.tolerance)
