"""One case of a study in a process of its own, so that its time and its memory are its own.

As a program, `python -m elastune.app.studies.worker JSON`, it prints what it measured as the last line, in JSON.
"""

import json
import os
import sys
import time
import traceback
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from elastune.app import interrupts
from elastune.app.errors import UserError
from elastune.app.results.machine import peak_memory_mb
from elastune.app.results.quantities import Probes, force, moment
from elastune.app.run import Run, start
from elastune.app.scene.build import options
from elastune.app.scene.read import parse
from elastune.app.scene.schema import Scene
from elastune.app.studies.schema import Quantity

Array = NDArray[np.float64]


@dataclass
class Measured:
    """What is recorded of a case.

    Attributes:
        status: "converged", "failed", or "timeout" (by the parent).
        message: Why it is not "converged".
        element: Name of the element.
        cells: Number of cells.
        dofs: Number of unknowns.
        newton: Newton steps.
        seconds: Mesh, forms and solution, without compilation.
        memory_mb: Most memory that the process had, in 10⁶ bytes, summed over ranks.
        values: Energy, volume_ratio and the study's quantities; with an exact solution the errors.
    """

    status: str = "converged"
    message: str = ""
    element: str = ""
    cells: int = 0
    dofs: int = 0
    newton: int = 0
    seconds: float = float("nan")
    memory_mb: float = float("nan")
    values: dict[str, float] = field(default_factory=dict)


def measure(scene: Scene, solver: str, manufactured: bool, quantities: dict[str, Quantity], comm: MPI.Comm) -> Measured:
    """Solves a scene and reads off what is asked; a failure is a result too."""
    solve = _tutorial if solver == "tutorial" else _manufactured if manufactured else _scene
    # Compiles the forms and loads the libraries, which is no part of what is measured.
    solve(_coarse(scene), {}, comm)
    comm.barrier()
    measured = solve(scene, quantities, comm)
    measured.memory_mb = peak_memory_mb(comm)
    return measured


def _coarse(scene: Scene) -> Scene:
    """The scene on as few cells as its shape has, in one step."""
    cells = 4 if scene.mesh.shape == "cylinder" else 1
    mesh = scene.mesh.model_copy(update={"cells": cells, "h": None, "grade": None, "refine": 0})
    solve = scene.solve.model_copy(update={"steps": 1, "smallest_step": 1.0})
    return scene.model_copy(update={"mesh": mesh, "solve": solve})


def _scene(scene: Scene, quantities: dict[str, Quantity], comm: MPI.Comm) -> Measured:
    began = time.perf_counter()
    run = start(scene, comm)
    measured, body = _solved(run, began), run.body
    if measured.status == "converged":
        forces = body.layout.nodal(body.assembly.residual(body.state))
        last = run.summary.steps[-1]
        measured.values = {"energy": last.energy, "volume_ratio": last.volume_ratio}
        measured.values |= _values(quantities, body.u, forces, body.constraints.faces)
    return measured


def _manufactured(scene: Scene, quantities: dict[str, Quantity], comm: MPI.Comm) -> Measured:
    from elastune.app.verify.exact import Manufactured

    began = time.perf_counter()
    problem = Manufactured(scene, comm)
    measured = _solved(Run(problem.body, options(scene)), began)
    if measured.status == "converged":
        measured.values = problem.errors()
    return measured


def _solved(run: Run, began: float) -> Measured:
    """What is recorded of a run, which ends here."""
    summary = run.finish().summary
    return Measured(
        summary.status,
        "" if summary.failure is None else summary.failure.message,
        summary.element,
        summary.cells,
        summary.dofs,
        sum(step.newton_iterations for step in summary.steps),
        time.perf_counter() - began,
    )


def _tutorial(scene: Scene, quantities: dict[str, Quantity], comm: MPI.Comm) -> Measured:
    from elastune.app.verify.tutorial import TutorialFailure, solve

    began = time.perf_counter()
    try:
        solution = solve(scene, comm)
    except TutorialFailure as failure:
        return Measured("failed", str(failure), element=scene.element)
    seconds = time.perf_counter() - began
    V = solution.u.function_space
    topology = V.mesh.topology
    return Measured(
        element=scene.element,
        cells=topology.index_map(topology.dim).size_global,
        dofs=V.dofmap.index_map.size_global * V.dofmap.index_map_bs,
        newton=solution.newton,
        seconds=seconds,
        values={
            "energy": solution.energy,
            "volume_ratio": solution.volume_ratio,
            **_values(quantities, solution.u, solution.forces, solution.faces),
        },
    )


def _values(
    quantities: dict[str, Quantity], u: fem.Function, forces: Array, faces: dict[str, NDArray[np.int32]]
) -> dict[str, float]:
    """Quantities of a displacement, from the nodal forces of shape (nodes, d)."""
    found = {}
    for name, quantity in quantities.items():
        axis = "xyz".index(quantity.along or quantity.about or "")
        if quantity.at is not None:
            found[name] = Probes(u, {name: quantity.at}, "quantities").displacements()[name][axis]
        else:
            total = force if quantity.along else moment
            found[name] = float(total(u, forces, faces[quantity.reaction or ""])[axis])
    return found


def main(request: dict[str, Any]) -> None:
    """Measures what the parent asks for and prints it on rank 0."""
    comm = MPI.COMM_WORLD
    quantities = {name: Quantity.model_validate(table) for name, table in request["quantities"].items()}
    scene = parse(request["scene"], Path(request["name"]))
    try:
        measured = measure(scene, request["solver"], request["manufactured"], quantities, comm)
    except UserError as error:
        measured = Measured("failed", str(error))
    if comm.rank == 0:
        print(json.dumps(asdict(measured)))


if __name__ == "__main__":
    # Who is given up in the middle of a compilation must not leave its lock behind.
    interrupts.listen(lambda: os._exit(128 + interrupts.came()))
    try:
        main(json.loads(sys.argv[1]))
    except Exception:
        # Without MPI's farewell, which would wait for the other ranks: mpirun then ends them.
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)
