"""A hyperelasticity solver as tutorials write it: dolfinx's NewtonSolver, LU, load steps by hand.

Lagrange elements of order one, forms differentiated by UFL and integrated with degree 4, full Newton steps, the
increment as the measure of convergence. Better than in tutorials are MUMPS as LU and the material, which is the
scene's own.
"""

from dataclasses import dataclass
from typing import Any

import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.nls.petsc import NewtonSolver
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from elastune import geometry
from elastune.app.body.conditions.motions import Motion
from elastune.app.errors import SceneError
from elastune.app.scene.build import conditions as built
from elastune.app.scene.schema import Scene, material_energy, mesh_arguments
from elastune.app.scene.schema.conditions import Components
from elastune.forms.kinematics import GradientMeasures, deformation_gradient

# From dolfinx 0.10 on NonlinearProblem is another class, and what NewtonSolver takes has this name.
_NonlinearProblem: Any = getattr(dolfinx.fem.petsc, "NewtonSolverNonlinearProblem", dolfinx.fem.petsc.NonlinearProblem)


class TutorialFailure(Exception):
    """Newton's method has not converged."""


@dataclass
class Tutorial:
    """A solution.

    Attributes:
        u: Displacement.
        forces: Nodal forces of the body at full load, shape (owned and ghost nodes, d).
        faces: Nodes of the held faces.
        energy: Strain energy.
        volume_ratio: Deformed over reference volume.
        newton: Newton steps spent.
    """

    u: fem.Function
    forces: NDArray[np.float64]
    faces: dict[str, NDArray[np.int32]]
    energy: float
    volume_ratio: float
    newton: int


def solve(scene: Scene, comm: MPI.Comm) -> Tutorial:
    """Solves a scene whose faces are fixed, moved or turned, in `solve.steps` equal steps.

    Raises:
        SceneError: If the scene has other conditions, or another element than P1 and Q1.
        TutorialFailure: If a step does not converge; there is no cutting back.
    """
    _check(scene)
    body = geometry.build(comm, **mesh_arguments(scene))
    mesh = body.mesh
    d = mesh.geometry.dim
    V = fem.functionspace(mesh, ("Lagrange", 1, (d,)))
    u, v = fem.Function(V), ufl.TestFunction(V)

    faces, motions, conditions = {}, [], []
    for face, condition in scene.boundary.items():
        faces[face] = fem.locate_dofs_topological(V, d - 1, body.facets(face))
        motion = fem.Function(V)
        (prescribed,) = built(condition, d)
        assert isinstance(prescribed, Motion)
        motions.append((motion, prescribed))
        conditions.append(fem.dirichletbc(motion, faces[face]))

    energy = material_energy(scene)
    F = deformation_gradient(u)
    dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": 4})
    # As constants the parameters would stay out of the compiled code, which a tutorial does too.
    constants = fem.Constant(mesh, np.array(energy.constants()))
    named = energy.unpack([constants[i] for i in range(len(energy.constants()))])
    strain_energy = energy.density(GradientMeasures(F), named) * dx
    residual = ufl.derivative(strain_energy, u, v)

    problem = _NonlinearProblem(residual, u, conditions)
    solver = NewtonSolver(comm, problem)
    solver.atol = solver.rtol = 1e-8
    solver.convergence_criterion = "incremental"
    solver.error_on_nonconvergence = False
    solver.krylov_solver.setType(PETSc.KSP.Type.PREONLY)
    solver.krylov_solver.getPC().setType(PETSc.PC.Type.LU)
    solver.krylov_solver.getPC().setFactorSolverType("mumps")

    newton = 0
    for step in range(1, scene.solve.steps + 1):
        for motion, prescribed in motions:
            moved = prescribed.between([prescribed], [step / scene.solve.steps], V.tabulate_dof_coordinates())
            motion.x.array[:] = moved[:, :d].ravel()
        iterations, converged = solver.solve(u)
        newton += iterations
        if not converged or not np.isfinite(u.x.array).all():
            reached = f"load step {step} of {scene.solve.steps}"
            raise TutorialFailure(f"{reached}: not converged in {iterations} Newton steps")

    def total(form: object) -> float:
        return comm.allreduce(float(fem.assemble_scalar(fem.form(form))))

    forces = fem.assemble_vector(problem.L)
    forces.scatter_reverse(dolfinx.la.InsertMode.add)
    return Tutorial(
        u,
        forces.array.reshape(-1, d),
        faces,
        total(strain_energy),
        total(ufl.det(F) * dx) / total(fem.Constant(mesh, 1.0) * dx),
        newton,
    )


def _check(scene: Scene) -> None:
    for face, condition in scene.boundary.items():
        (kind, *more) = condition.kinds
        if more or kind not in ("fix", "move", "rotate") or isinstance(condition.move, Components):
            raise SceneError(f"boundary.{face}.{kind}: the tutorial's solver takes fix, move and rotate only")
    if scene.body is not None:
        raise SceneError("body: the tutorial's solver takes no body force")
    if scene.element not in ("P1", "Q1"):
        raise SceneError(f'solve.element = "{scene.element}": the tutorial\'s solver takes P1 and Q1 only')
