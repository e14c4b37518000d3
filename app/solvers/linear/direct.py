"""Factorisation by MUMPS."""

from petsc4py import PETSc

from elastune.app.solvers.linear.solver import LinearSolver


class Direct(LinearSolver):
    """L D Lᵀ, whose negative pivots are as many as the negative eigenvalues (Sylvester); LU without a potential."""

    name = "direct"
    inertia = True

    def _configure(self) -> None:
        self._matrix: PETSc.Mat | None = None
        pc = self.ksp.getPC()
        self.ksp.setType("preonly")
        pc.setType("cholesky" if self.tangent.body.conservative else "lu")
        pc.setFactorSolverType("mumps")
        self.ksp.setFromOptions()

    def setup(self) -> None:
        """Takes the tangent as it is assembled now; one of four blocks as one matrix."""
        body = self.tangent.body
        if body.p is None:
            self._matrix = self.tangent.matrix
        elif self._matrix is None:
            self._matrix = self.tangent.matrix.convert("aij", out=PETSc.Mat())
        else:
            self._matrix = self.tangent.matrix.convert("aij", out=self._matrix)
        self._matrix.setOption(PETSc.Mat.Option.SYMMETRIC, body.conservative)
        self.ksp.setOperators(self._matrix)

    def _usable(self, reason: int) -> bool:
        # Without eigenvalues counted, a factorisation that went well is all there is to know.
        return reason > 0 and (not self._counts() or self.surplus() == 0)

    def surplus(self) -> int | None:
        """Negative eigenvalues of the tangent that was solved with last, those of pressures aside; None without."""
        return self._negative() - self.tangent.body.layout.total_pressures if self._counts() else None

    def _counts(self) -> bool:
        pc = self.ksp.getPC()
        return pc.getType() == "cholesky" and pc.getFactorSolverType() == "mumps"

    def _negative(self) -> int:
        return int(self.ksp.getPC().getFactorMatrix().getMumpsInfog(12))
