"""Which linear solver a body gets."""

from typing import Literal

from petsc4py import PETSc

from elastune.app.solvers.linear.direct import Direct
from elastune.app.solvers.linear.fieldsplit import FieldSplit
from elastune.app.solvers.linear.multigrid import Multigrid
from elastune.app.solvers.linear.solver import LinearSolver
from elastune.app.solvers.outcome import Count
from elastune.app.solvers.tangent import Tangent

# Unknowns above which a factorisation costs more than an iterative method, by dimension.
DIRECT_LIMIT = {2: 400_000, 3: 60_000}


def choose(
    tangent: Tangent, ksp: PETSc.KSP, count: Count, linear: Literal["auto", "direct", "iterative"]
) -> LinearSolver:
    """The solver asked for, or the faster one by size and dimension; an iterative one by element."""
    body = tangent.body
    if linear == "direct" or (linear == "auto" and body.size <= DIRECT_LIMIT[body.dimension]):
        return Direct(tangent, ksp, count)
    return (Multigrid if body.p is None else FieldSplit)(tangent, ksp, count)
