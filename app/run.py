"""One scene from start to end: solve, record, write."""

import time
from collections.abc import Sequence
from pathlib import Path

from mpi4py import MPI

from elastune.app.body.body import Problem
from elastune.app.errors import SceneError
from elastune.app.path.follow import LoadFailure, State, follow
from elastune.app.results.diagnose import diagnose
from elastune.app.results.folder import Output
from elastune.app.results.measures import Measures
from elastune.app.results.record import Failure, Step, Summary
from elastune.app.scene.schema import Scene
from elastune.forms.normalize import linearize


class Progress:
    """Who is told how a run goes: nobody, unless a subclass listens."""

    def start(self, problem: Problem) -> None:
        """The problem is about to be solved."""

    def increment(self, load: float, newton: int) -> None:
        """A load increment has converged, after so many Newton steps of its load step."""

    def step(self, step: Step) -> None:
        """A load step has been recorded."""


def run(
    scene: Scene,
    folder: Path,
    comm: MPI.Comm = MPI.COMM_WORLD,
    progress: Progress | None = None,
    options: Sequence[str] = (),
) -> tuple[Summary, list[Path]]:
    """Solves a scene and writes its results.

    Args:
        scene: What to solve.
        folder: Where the results go; made if needed.
        comm: All ranks of it take part.
        progress: Told how it goes.
        options: PETSc's options, as on a command line.

    Returns:
        What `summary.json` says, and the files written (on rank 0).

    Raises:
        UserError: If the scene or the folder is impossible; nothing has been written then.
    """
    began = time.perf_counter()
    progress = progress or Progress()
    output = Output(folder, scene, comm)
    _set_petsc_options(options)
    try:
        problem = Problem(scene, comm)
    except SceneError as error:
        raise SceneError(f"{scene.name}.toml: {error}") from None
    measures = Measures(problem)
    progress.start(problem)
    summary = _summary(problem)
    output.start(problem.u, problem.energy, scene.material.extension, problem.quadrature, problem.mixed)
    last = time.perf_counter()
    try:
        for state in follow(problem, progress.increment):
            now = time.perf_counter()
            step = _record(problem, measures, state, now - last)
            last = now
            summary.steps.append(step)
            output.step(step)
            progress.step(step)
    except LoadFailure as failure:
        summary.status = "failed"
        found = diagnose(problem, failure.values, failure.kind)
        summary.failure = Failure(failure.kind, str(failure), failure.load, found)
    summary.wall_s = time.perf_counter() - began
    return summary, output.finish(summary)


def _record(problem: Problem, measures: Measures, state: State, seconds: float) -> Step:
    return Step(
        load=state.load,
        energy=problem.energy_at(state.values),
        reaction=measures.reactions(),
        volume_ratio=measures.volume_ratio(),
        min_J=measures.min_J(),
        newton_iterations=state.newton,
        linear_iterations=state.linear,
        wall_s=seconds,
    )


def _summary(problem: Problem) -> Summary:
    scene = problem.scene
    at_rest = linearize(problem.energy)
    return Summary(
        scene=scene.name,
        status="converged",
        failure=None,
        material={
            "name": scene.material.name,
            "parameters": dict(problem.energy.values),
            "E": at_rest.youngs_modulus,
            "nu": at_rest.poissons_ratio,
            "alpha": 1.0 if scene.material.alpha is None else scene.material.alpha,
        },
        element=problem.element,
        cells=problem.geometry.cells_count,
        dofs=problem.size,
        ranks=problem.comm.size,
    )


def _set_petsc_options(options: Sequence[str]) -> None:
    """Puts `-name value` pairs into PETSc's database, before any object reads it."""
    if not options:
        return
    from petsc4py import PETSc

    PETSc.Options().insertString(" ".join(options))
