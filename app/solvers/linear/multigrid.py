"""Conjugate gradients with algebraic multigrid."""

from petsc4py import PETSc

from elastune.app.solvers.linear.solver import LinearSolver
from elastune.app.solvers.outcome import LinearFailure

# Iterations; more than a few hundred are rare.
LONGEST = 2000

# Of 105,000 unknowns of a stretched cylinder, with this threshold a fifth fewer iterations than with PETSc's of zero.
# Where a stiff part lies in a soft one, aggregates that reach across cost ten times the iterations.
# The smoothers' eigenvalues have to be estimated anew for each tangent: those of another one may be far too small.
GAMG = {"pc_gamg_threshold": 0.01}


class Multigrid(LinearSolver):
    """CG, or GMRES without a potential, preconditioned by PETSc's GAMG that knows the rigid motions."""

    name = "multigrid"

    def _configure(self) -> None:
        self.tangent.matrix.setNearNullSpace(self.tangent.rigid_motions)
        self.ksp.setType("cg" if self.tangent.body.conservative else "gmres")
        self.ksp.setTolerances(max_it=LONGEST)
        set_gamg(self.ksp)
        self.ksp.setFromOptions()

    def _usable(self, reason: int) -> bool:
        reasons = PETSc.KSP.ConvergedReason
        if reason in (reasons.DIVERGED_INDEFINITE_MAT, reasons.DIVERGED_INDEFINITE_PC):
            return False
        # Of a solve that took too long the step is still one of descent.
        if reason < 0 and reason != reasons.DIVERGED_MAX_IT:
            raise LinearFailure(f"the linear solver stopped with reason {reason}")
        return True


def set_gamg(ksp: PETSc.KSP) -> None:
    """Preconditions by GAMG with these options, unless a person asks for others."""
    ksp.getPC().setType("gamg")
    chosen = PETSc.Options(ksp.getOptionsPrefix() or "")
    for name, value in GAMG.items():
        if not chosen.hasName(name):
            chosen[name] = value
