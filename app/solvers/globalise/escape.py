"""Off a saddle point: along the direction in which Π curves downwards most."""

from collections.abc import Callable

import numpy as np
from petsc4py import PETSc

from elastune.app.body.body import Array
from elastune.app.body.shapes import uniform
from elastune.app.solvers.tangent import Tangent, vector

# The longest way to try, relative to the body's extent, and the shortest.
FIRST, LEAST = 0.1, 1e-6


def escape(tangent: Tangent, values: Array) -> Array | None:
    """A state of lower energy along a direction of negative curvature, or None if none was found.

    To a quadratic model such a direction has no end: lengths are halved from a tenth of the body down, as long as Π
    falls. A little noise and a trust region, the simpler way, fall back onto the saddle point where Π is flat.

    Args:
        tangent: The problem's.
        values: A state nearly in balance.
    """
    problem = tangent.problem
    problem.set_state(values)
    direction = _most_negative(tangent)
    if direction is None:
        return None
    # The direction is zero where displacements are prescribed.
    if problem.dot(problem.residual_at(values), direction) > 0:
        direction = -direction

    def energy(length: float) -> float:
        return problem.energy_at(values + length * direction)

    length = _lowering(energy, FIRST * problem.extent, LEAST * problem.extent)
    return None if length is None else values + length * direction


def _lowering(energy: Callable[[float], float], first: float, least: float) -> float | None:
    """Halves a length until the energy is lower than at zero, and on while that lowers it further; or None."""
    length, lowest = first, energy(0.0)
    lowest -= 1e-14 * abs(lowest)
    found = None
    while length > least:
        value = energy(length)
        if value < lowest:
            found, lowest = length, value
        elif found is not None:
            break
        length /= 2
    return found


def _most_negative(tangent: Tangent) -> Array | None:
    """Eigenvector of the least eigenvalue of the raw tangent, its largest entry one; None if none is negative.

    By the generalised Davidson method (Morgan & Scott 1986, SIAM J. Sci. Stat. Comput. 7:817), preconditioned by
    the filtered tangent. Two digits are plenty for a direction.
    """
    # Few scenes come here, and SLEPc takes time to load.
    from slepc4py import SLEPc

    problem = tangent.problem
    preconditioner = tangent.create_matrix()
    tangent.assemble("shifted", preconditioner)
    tangent.assemble("none")
    eps = SLEPc.EPS().create(problem.comm)
    eps.setOperators(tangent.matrix)
    eps.setProblemType(SLEPc.EPS.ProblemType.HEP)
    eps.setWhichEigenpairs(SLEPc.EPS.Which.SMALLEST_REAL)
    eps.setType(SLEPc.EPS.Type.GD)
    eps.setDimensions(1)
    eps.setTolerances(1e-2, 100)
    st = eps.getST()
    st.setType(SLEPc.ST.Type.PRECOND)
    st.setPreconditionerMat(preconditioner)
    pc = st.getKSP().getPC()
    pc.setType("cholesky" if tangent.direct else "gamg")
    if tangent.direct:
        pc.setFactorSolverType("mumps")
    start = vector(problem)
    start.array[:] = np.where(problem.held, 0.0, problem.joined((2 * uniform(problem, 0) - 1).ravel()))[: problem.owned]
    eps.setInitialSpace(start)
    eps.solve()
    if eps.getConverged() < 1 or eps.getEigenvalue(0).real >= 0:
        return None
    found = vector(problem)
    eps.getEigenvector(0, found)
    direction = np.zeros_like(problem.u.x.array)
    direction[: problem.owned] = found.array_r / found.norm(PETSc.NormType.INFINITY)
    direction[problem.held] = 0.0
    return direction
