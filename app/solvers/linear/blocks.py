"""The tangent of mixed elements as four blocks, and its linear solvers."""

from typing import Literal, NamedTuple

import dolfinx.fem.petsc
import numpy as np
from petsc4py import PETSc

from elastune.app.body.body import Array, Problem
from elastune.app.solvers.tangent import DIRECT_LIMIT, Count, rigid_motions
from elastune.forms.terms.mixed import MixedPotential

# Iterations of FGMRES; 30 to 60 are usual, and a tangent that takes more is likely not to be one of descent.
LONGEST = 200


class Convexity(NamedTuple):
    """What is done to the displacement block: the filter of the μ part, and the share of `stretching` added."""

    filter: Literal["none", "clamp", "absolute"]
    share: float


class Blocks:
    """The saddle-point matrix: displacements and pressures of each rank, one after the other.

    Small ones are factorised as L D Lᵀ by MUMPS, whose negative pivots count the negative eigenvalues. Large ones
    are solved by FGMRES, preconditioned by the upper block triangle of algebraic multigrid for the displacements
    and a scaled mass matrix in place of the Schur complement.

    Attributes:
        count: What has been spent.
        fresh: As of `Tangent`.
        direct: Whether it is factorised.
        matrix: As it is solved, once assembled.
        volumes: Diagonal of the pressures' mass matrix, owned.

    Reference:
        Elman, Silvester & Wathen 2014, Finite Elements and Fast Iterative Solvers, Chapters 4 and 9.
    """

    def __init__(self, problem: Problem, forms: MixedPotential) -> None:
        """Creates the matrices and the linear solver."""
        self.problem, self.potential = problem, forms
        self.count, self.fresh = Count(), False
        create = dolfinx.fem.petsc.create_matrix
        self._blocks = [
            (create(forms.tangent[0]), forms.tangent),
            (create(forms.coupling_transposed), [forms.coupling_transposed]),
            (create(forms.coupling), [forms.coupling]),
            (create(forms.compliance), [forms.compliance]),
        ]
        a, b, c, d = (matrix for matrix, _ in self._blocks)
        self._nest = PETSc.Mat().createNest([[a, b], [c, d]], comm=problem.comm)
        self._mass = dolfinx.fem.petsc.assemble_matrix(forms.mass)
        self._mass.assemble()
        self.volumes = self._mass.getDiagonal().array_r.copy()
        self._pressures = problem.comm.allreduce(problem.owned_pressures)

        linear = problem.scene.solve.linear
        self.direct = linear == "direct" or (linear == "auto" and problem.size <= DIRECT_LIMIT)
        self.matrix = PETSc.Mat() if self.direct else self._nest
        self._ksp = PETSc.KSP().create(problem.comm)
        if self.direct:
            self._ksp.setType("preonly")
            pc = self._ksp.getPC()
            pc.setType("cholesky" if forms.loads.conservative else "lu")
            pc.setFactorSolverType("mumps")
            self._ksp.setFromOptions()

    def _configure_iterative(self) -> None:
        """Needs the blocks assembled."""
        a = self._blocks[0][0]
        a.setNearNullSpace(rigid_motions(self.problem))
        bulk = self.problem.split.bulk if self.problem.split is not None else np.inf
        # The Schur complement of the rest state on smooth pressures, but for its sign.
        self._mass.scale(-(1 / self.potential.shear_modulus + 1 / bulk))
        self._ksp.setType("fgmres")
        self._ksp.setGMRESRestart(LONGEST)
        self._ksp.setTolerances(max_it=LONGEST)
        self._ksp.setOperators(self.matrix)
        pc = self._ksp.getPC()
        pc.setType("fieldsplit")
        rows, _ = self._nest.getNestISs()
        pc.setFieldSplitIS(("u", rows[0]), ("p", rows[1]))
        pc.setFieldSplitType(PETSc.PC.CompositeType.SCHUR)
        pc.setFieldSplitSchurFactType(PETSc.PC.SchurFactType.UPPER)
        pc.setFieldSplitSchurPreType(PETSc.PC.SchurPreType.USER, self._mass)
        pc.setUp()
        displacements, pressures = pc.getFieldSplitSchurGetSubKSP()
        displacements.setType("preonly")
        displacements.getPC().setType("gamg")
        pressures.setType("preonly")
        for ksp in (displacements, pressures, self._ksp):
            ksp.setFromOptions()

    def assemble(self, convexity: Convexity) -> None:
        """Assembles the tangent at the current state, rows and columns of prescribed displacements aside."""
        problem, forms = self.problem, self.potential
        self.fresh = False
        forms.set_filter(convexity.filter)
        forms.share.value = convexity.share
        stretching = [forms.stretching] if convexity.share > 0 else []
        for matrix, terms in self._blocks:
            matrix.zeroEntries()
            for form in [*terms, *(stretching if terms is forms.tangent else [])]:
                dolfinx.fem.petsc.assemble_matrix(matrix, form, problem.conditions, 0.0)  # type: ignore[arg-type]
                # Zeros inserted on the diagonal and what the next form adds must not meet.
                matrix.assemble(PETSc.Mat.AssemblyType.FLUSH)
            matrix.assemble()
        stiffness = self._blocks[0][0]
        # A diagonal of the size of the others keeps the prescribed rows out of the conditioning.
        diagonal = stiffness.getDiagonal()
        diagonal.array[problem.held[: problem.owned_displacements]] = diagonal.norm(PETSc.NormType.INFINITY) or 1.0
        stiffness.setDiagonal(diagonal)
        self._nest.assemble()
        if self.direct:
            self.matrix = self._nest.convert("aij", out=self.matrix)
            self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, forms.loads.conservative)
        elif self._ksp.getType() != "fgmres":
            self._configure_iterative()

    def solve(self, rhs: Array, rtol: float) -> Array | None:
        """Solves with the assembled tangent; None if the solution is of no use, or no direction of descent."""
        problem = self.problem
        b = PETSc.Vec().createMPI((problem.owned, problem.size), comm=problem.comm)
        y = b.duplicate()
        b.array[:] = rhs[: problem.owned]
        self._ksp.setOperators(self.matrix)
        self._ksp.setTolerances(rtol=rtol)
        self._ksp.solve(b, y)
        self.count.linear += max(self._ksp.getIterationNumber(), 1)
        pc = self._ksp.getPC()
        reason = self._ksp.getConvergedReason()
        if reason == PETSc.KSP.ConvergedReason.DIVERGED_PCSETUP_FAILED:
            # A factorisation that met a singular matrix would stay failed.
            pc.reset()
        if reason < 0:
            return None
        counted = pc.getType() == "cholesky" and pc.getFactorSolverType() == "mumps"
        if counted and pc.getFactorMatrix().getMumpsInfog(12) != self._pressures:
            return None
        step = np.zeros_like(rhs)
        step[: problem.owned] = y.array_r
        step[problem.held] = 0.0
        return step if np.isfinite(problem.norm(step)) else None
