"""FGMRES on displacements and pressures, with a multigrid for the ones and a mass matrix for the others."""

from petsc4py import PETSc

from elastune.app.body.regions.parts import Part
from elastune.app.solvers.linear.multigrid import set_gamg
from elastune.app.solvers.linear.solver import LinearSolver

# Iterations; 30 to 60 are usual, and a tangent that takes more is likely not to be one of descent.
LONGEST = 200


class FieldSplit(LinearSolver):
    """Preconditioned by the upper block triangle of algebraic multigrid and a scaled pressure mass matrix.

    The latter stands in for the Schur complement of the rest state on smooth pressures.

    Reference:
        Elman, Silvester & Wathen 2014, Finite Elements and Fast Iterative Solvers, Chapters 4 and 9.
    """

    name = "fieldsplit"

    def _configure(self) -> None:
        self.tangent.blocks["u", "u"].setNearNullSpace(self.tangent.rigid_motions)
        self.ksp.setType("fgmres")
        self.ksp.setGMRESRestart(LONGEST)
        self.ksp.setTolerances(max_it=LONGEST)
        self._split = False

    def setup(self) -> None:
        """Takes the tangent as it is assembled now."""
        super().setup()
        if not self._split:
            # PETSc wants the blocks assembled.
            self._split_fields()

    def _split_fields(self) -> None:
        body, pc = self.tangent.body, self.ksp.getPC()
        schur = body.pressures.mass(_compliance)
        pc.setType("fieldsplit")
        rows, _ = self.tangent.matrix.getNestISs()
        pc.setFieldSplitIS(("u", rows[0]), ("p", rows[1]))
        pc.setFieldSplitType(PETSc.PC.CompositeType.SCHUR)
        pc.setFieldSplitSchurFactType(PETSc.PC.SchurFactType.UPPER)
        pc.setFieldSplitSchurPreType(PETSc.PC.SchurPreType.USER, schur)
        pc.setUp()
        displacements, pressures = pc.getFieldSplitSchurGetSubKSP()
        displacements.setType("preonly")
        set_gamg(displacements)
        pressures.setType("preonly")
        for ksp in (displacements, pressures, self.ksp):
            ksp.setFromOptions()
        self._split = True


def _compliance(part: Part) -> float:
    """What the Schur complement makes of a pressure in a part, less than zero."""
    assert part.split is not None
    return -(1 / part.shear_modulus + 1 / part.split.bulk)
