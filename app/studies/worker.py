"""One case of a study in a process of its own, so that its time and its memory are its own.

As a program, `python -m elastune.app.studies.worker JSON`, it prints what it measured as the last line, in JSON.
"""

import json
import os
import resource
import sys
import time
import traceback
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from elastune.app.body.body import Problem
from elastune.app.errors import UserError
from elastune.app.path.follow import LoadFailure, follow
from elastune.app.results.measures import Measures
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
    with suppress(LoadFailure):
        # Compiles the forms and loads the libraries, which is no part of what is measured.
        solve(_coarse(scene), {}, comm)
    comm.barrier()
    try:
        measured = solve(scene, quantities, comm)
    except LoadFailure as failure:
        measured = Measured("failed", str(failure))
    measured.memory_mb = comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6)
    return measured


def _coarse(scene: Scene) -> Scene:
    """The scene on as few cells as its shape has, in one step."""
    cells = 4 if scene.mesh.shape == "cylinder" else 1
    mesh = scene.mesh.model_copy(update={"cells": cells, "h": None, "grade": None, "refine": 0})
    solve = scene.solve.model_copy(update={"steps": 1, "smallest_step": 1.0})
    return scene.model_copy(update={"mesh": mesh, "solve": solve})


def _scene(scene: Scene, quantities: dict[str, Quantity], comm: MPI.Comm) -> Measured:
    began = time.perf_counter()
    problem = Problem(scene, comm)
    newton = sum(state.newton for state in follow(problem))
    seconds = time.perf_counter() - began
    measured = _record(problem, newton, seconds)
    state = problem.state
    forces = problem.displacements(problem.residual_at(state)).reshape(-1, problem.dimension)
    measured.values = {
        "energy": problem.energy_at(state),
        "volume_ratio": Measures(problem).volume_ratio(),
        **_values(quantities, problem.u, forces, problem.faces),
    }
    return measured


def _manufactured(scene: Scene, quantities: dict[str, Quantity], comm: MPI.Comm) -> Measured:
    from elastune.app.verify.exact import Manufactured

    began = time.perf_counter()
    problem = Manufactured(scene, comm)
    newton = sum(state.newton for state in follow(problem))
    measured = _record(problem, newton, time.perf_counter() - began)
    measured.values = problem.errors()
    return measured


def _record(problem: Problem, newton: int, seconds: float) -> Measured:
    return Measured(
        element=problem.element,
        cells=problem.geometry.cells_count,
        dofs=problem.size,
        newton=newton,
        seconds=seconds,
    )


def _tutorial(scene: Scene, quantities: dict[str, Quantity], comm: MPI.Comm) -> Measured:
    from elastune.app.bench.tutorial import TutorialFailure, solve

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
    V = u.function_space
    owned, d = V.dofmap.index_map.size_local, V.dofmap.index_map_bs
    comm, X = V.mesh.comm, V.tabulate_dof_coordinates()[:owned]
    moved = X.copy()
    moved[:, :d] += u.x.array.reshape(-1, d)[:owned]
    found = {}
    for name, quantity in quantities.items():
        axis = "xyz".index(quantity.along or quantity.about or "")
        if quantity.at is not None:
            distance = np.linalg.norm(X - np.pad(quantity.at, (0, 3 - len(quantity.at))), axis=1)
            nearest = int(distance.argmin()) if owned else None
            own = (float(distance[nearest]), float((moved - X)[nearest, axis])) if owned else (np.inf, 0.0)
            found[name] = min(comm.allgather(own))[1]
            continue
        nodes = faces[quantity.reaction or ""]
        nodes = nodes[nodes < owned]
        force = np.zeros((len(nodes), 3))
        force[:, :d] = forces[nodes]
        part = force if quantity.along else np.cross(moved[nodes], force)
        found[name] = comm.allreduce(float(part[:, axis].sum()))
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
    try:
        main(json.loads(sys.argv[1]))
    except Exception:
        # Without MPI's farewell, which would wait for the other ranks: mpirun then ends them.
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)
