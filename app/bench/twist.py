"""The twist by a quarter turn: one load step here against ten by a tutorial's solver, the same energy for both."""

import time
from dataclasses import dataclass
from functools import partial
from typing import Any

from mpi4py import MPI

from elastune.app.run import start
from elastune.app.scene.read import load
from elastune.app.scene.schema import Scene
from elastune.app.verify import tutorial

# Fewer equal steps make the tutorial's solver fail.
TUTORIAL_STEPS = 10


@dataclass(frozen=True)
class Twist:
    """Both solvers on one mesh in one run.

    Attributes:
        ours: Seconds for mesh, forms and one load step, without compilation.
        theirs: The same for ten steps of the tutorial's solver.
        ours_newton: Newton steps.
        theirs_newton: Newton steps.
        energies: Strain energy of both, ours first; the tutorial integrates with degree 4, and so do both here.
    """

    ours: float
    theirs: float
    ours_newton: int
    theirs_newton: int
    energies: tuple[float, float]


def twist(cells: int = 15) -> Twist:
    """Times both; log neo-Hookean, ν = 0.49."""
    # What is compiled in the first call is found in a cache by the second.
    for n in (2, cells):
        ours_time, (energy, newton) = _timed(partial(_ours, _scene(n, 1)))
        theirs_time, theirs = _timed(partial(tutorial.solve, _scene(n, TUTORIAL_STEPS), MPI.COMM_SELF))
    return Twist(ours_time, theirs_time, newton, theirs.newton, (energy, theirs.energy))


def _scene(cells: int, steps: int) -> Scene:
    turn = "boundary.right.rotate={axis=[1.0,0.0,0.0], center=[0.5,0.5,0.5], angle=90.0}"
    settings = [f"mesh.cells={cells}", f"solve.steps={steps}", "solve.quadrature=4", "material.name=neo-hookean", turn]
    return load("cube-twist", settings)


def _ours(scene: Scene) -> tuple[float, int]:
    (record,) = start(scene, MPI.COMM_SELF)
    return record.energy, record.newton_iterations


def _timed(task: Any) -> tuple[float, Any]:
    began = time.perf_counter()
    result = task()
    return time.perf_counter() - began, result
