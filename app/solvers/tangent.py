"""The tangent: assembled with any filter, and solved with."""

import time
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import dolfinx.fem.petsc
import numpy as np
from petsc4py import PETSc

from elastune.app.body.body import Array, Problem
from elastune.app.errors import NotConverged

# "shifted" is clamped with a share of the stiffness at rest on the diagonal: where a body is collapsed to a point the
# clamped tangent may be zero.
Filter = Literal["none", "clamp", "absolute", "shifted"]

# Above this many unknowns a factorisation in 3D costs more than CG with algebraic multigrid.
DIRECT_LIMIT = 60_000


@dataclass
class Count:
    """What was spent."""

    newton: int = 0
    linear: int = 0


class Deadline:
    """The moment at which a scene's time is up, counted from now."""

    def __init__(self, problem: Problem) -> None:
        """Without a limit in the scene there is none."""
        self._problem = problem
        limit = problem.scene.solve.time_limit
        self._end = None if limit is None else time.monotonic() + limit

    def check(self) -> None:
        """Stops all ranks together.

        Raises:
            NotConverged: If the time is up on any of them.
        """
        if self._end is None or not self._problem.comm.allreduce(time.monotonic() > self._end):
            return
        limit = self._problem.scene.solve.time_limit
        raise NotConverged("time", f"stopped after the {limit:g} s of solve.time_limit", self._problem.state)


class Tangent:
    """Π'' with rows and columns of prescribed displacements aside, and its linear solver.

    Attributes:
        problem: Its state is where the tangent is taken.
        ksp: The linear solver.
        direct: Whether it factorises.
        matrix: What it solves with.
        count: What was spent.
        fresh: Whether `matrix` is the unfiltered tangent of a state near the balance that was found last: good
            enough to predict from, and factorised already.
    """

    def __init__(self, problem: Problem, ksp: PETSc.KSP) -> None:
        """Creates the matrix and configures the solver."""
        self.problem, self.ksp, self.count, self.fresh = problem, ksp, Count(), False
        linear = problem.scene.solve.linear
        self.direct = linear == "direct" or (linear == "auto" and problem.size <= DIRECT_LIMIT)
        self.matrix = self.create_matrix()
        self._configure()

    def _configure(self) -> None:
        pc = self.ksp.getPC()
        if self.direct:
            self.ksp.setType("preonly")
            pc.setType("cholesky" if self.problem.potential.loads.conservative else "lu")
            pc.setFactorSolverType("mumps")
            return
        self.ksp.setType("cg" if self.problem.potential.loads.conservative else "gmres")
        self.ksp.setTolerances(max_it=2000)
        pc.setType("gamg")

    def create_matrix(self) -> PETSc.Mat:
        """An empty matrix for the tangent."""
        matrix = dolfinx.fem.petsc.create_matrix(self.problem.potential.tangent[0])
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, self.problem.potential.loads.conservative)
        if not self.direct:
            matrix.setNearNullSpace(rigid_motions(self.problem))
        return matrix

    def assemble(self, filtering: Filter, into: PETSc.Mat | None = None) -> None:
        """Assembles the tangent at the current state, rows and columns of prescribed displacements aside.

        Args:
            filtering: What is done to negative eigenvalues, point by point.
            into: The matrix; by default the one that `linear_solve` reads.
        """
        problem, matrix = self.problem, self.matrix if into is None else into
        self.fresh = self.fresh and into is not None
        problem.potential.set_filter("clamp" if filtering == "shifted" else filtering)
        matrix.zeroEntries()
        for form in problem.potential.tangent:
            dolfinx.fem.petsc.assemble_matrix(matrix, form, problem.conditions, 0.0)  # type: ignore[arg-type]
            # dolfinx leaves PETSc's matrix in another mode of insertion; without a flush a second form is lost.
            matrix.assemble(PETSc.Mat.AssemblyType.FLUSH)
        matrix.assemble()
        if filtering == "shifted":
            matrix.shift(self._shift)
        # A diagonal of the size of the others keeps the prescribed rows out of the conditioning.
        diagonal = matrix.getDiagonal()
        diagonal.array[problem.held[: problem.owned]] = self._typical(diagonal)
        matrix.setDiagonal(diagonal)

    @cached_property
    def _shift(self) -> float:
        """A thousandth of the mean diagonal of the tangent at rest."""
        kept = self.problem.state
        self.problem.set_state(np.zeros_like(kept))
        matrix = self.create_matrix()
        self.assemble("none", matrix)
        self.problem.set_state(kept)
        return 1e-3 * matrix.getDiagonal().sum() / self.problem.size

    def _typical(self, diagonal: PETSc.Vec) -> float:
        largest = diagonal.norm(PETSc.NormType.INFINITY)
        return largest if largest > 0 else 1.0

    def linear_solve(self, rhs: Array, rtol: float) -> Array | None:
        """Solves with the assembled tangent; None if it turned out not to be positive definite."""
        problem, ksp = self.problem, self.ksp
        b = vector(problem)
        b.array[:] = rhs[: problem.owned]
        y = b.duplicate()
        ksp.setOperators(self.matrix)
        ksp.setTolerances(rtol=rtol)
        ksp.solve(b, y)
        self.count.linear += max(ksp.getIterationNumber(), 1)
        reason = ksp.getConvergedReason()
        reasons = PETSc.KSP.ConvergedReason
        if reason in (reasons.DIVERGED_INDEFINITE_MAT, reasons.DIVERGED_INDEFINITE_PC):
            return None
        if reason == reasons.DIVERGED_PCSETUP_FAILED:
            # A factorisation that met a singular matrix would stay failed.
            ksp.getPC().reset()
            return None
        if self.direct and problem.potential.loads.conservative and self._negative_pivots() > 0:
            return None
        if reason < 0 and reason != reasons.DIVERGED_MAX_IT:
            raise NotConverged("linear", f"the linear solver stopped with reason {reason}")
        step = np.zeros_like(rhs)
        step[: problem.owned] = y.array_r
        return step if np.isfinite(problem.norm(step)) else None

    def _negative_pivots(self) -> int:
        """Sylvester: as many as the tangent has negative eigenvalues."""
        pc = self.ksp.getPC()
        if pc.getType() != "cholesky" or pc.getFactorSolverType() != "mumps":
            return 0
        return pc.getFactorMatrix().getMumpsInfog(12)


def vector(problem: Problem) -> PETSc.Vec:
    """An empty vector of the problem's unknowns, displacements only."""
    return PETSc.Vec().createMPI((problem.owned, problem.size), bsize=problem.dimension, comm=problem.comm)


def rigid_motions(problem: Problem) -> PETSc.NullSpace:
    """Translations and rotations of the reference body: what algebraic multigrid must represent."""
    d, owned = problem.dimension, problem.owned_displacements
    coordinates = PETSc.Vec().createMPI((owned, PETSc.DETERMINE), bsize=d, comm=problem.comm)
    nodes = owned // d
    points = problem.V.tabulate_dof_coordinates()[:nodes, : problem.dimension]
    coordinates.array[:] = points.ravel()
    return PETSc.NullSpace().createRigidBody(coordinates)
