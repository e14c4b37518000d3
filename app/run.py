"""The one runner: a scene, or a body, from start to end."""

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from elastune.app import interrupts
from elastune.app.body.body import Body
from elastune.app.body.shapes import Start
from elastune.app.errors import SceneError, UserError, meant
from elastune.app.path.follow import check_follow, follow
from elastune.app.path.steps import PathFailure, Reached, Step
from elastune.app.results.advice.advise import locked
from elastune.app.results.diagnose import diagnose
from elastune.app.results.fields import CELL_FIELDS, Fields
from elastune.app.results.folder import Outputs, RunFolder
from elastune.app.results.measures import Measures
from elastune.app.results.pictures import curve
from elastune.app.results.progress import Progress
from elastune.app.results.quantities import Probes
from elastune.app.results.record import Failure, Record, Summary, begun
from elastune.app.scene import build
from elastune.app.scene.schema import Scene
from elastune.app.scene.write import text
from elastune.app.solvers.options import Options
from elastune.app.solvers.outcome import Event, Stopped

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


class Run:
    """A body under load that is solved as it is iterated, record by record.

    Attributes:
        body: Holds the state of the record that was yielded last.
        options: How it is solved.
        summary: What is known of the run so far; its `failure` says why it ended early.
        reason: Why the element was chosen, or nothing.
    """

    def __init__(
        self,
        body: Body,
        options: Options | None = None,
        start: Start | None = None,
        steps: Sequence[Step] | None = None,
        name: str = "body",
        reason: str = "",
        progress: Progress | None = None,
        points: Mapping[str, Sequence[float]] | None = None,
    ) -> None:
        """Solves nothing yet.

        Args:
            body: At rest.
            options: How it is solved; the defaults unless given.
            start: A shape to set out from.
            steps: Parts of the load path; one to full load by default.
            name: What people call it.
            reason: Why the element was chosen.
            progress: Told how it goes.
            points: Places at rest by name, whose displacements are recorded.

        Raises:
            UserError: If a point lies outside the body, or a branch cannot be followed.
        """
        self.body, self.options = body, options or Options()
        check_follow(self.options, start is not None, 1 if steps is None else len(steps))
        self._start, self._steps, self.reason = start, steps, reason
        self.progress = progress or Progress()
        self.summary = begun(body, name)
        self._probes = Probes(body.u, points or {}, "output.points")
        self._records, self._begun = self._solve(), False

    def __iter__(self) -> Iterator[Record]:
        """What is not solved yet, record by record; a failure ends it."""
        return self._records

    def finish(self) -> "Run":
        """Solves what is left."""
        for _ in self:
            pass
        return self

    # ------------------------------------------------------------------ results

    @property
    def history(self) -> dict[str, Array]:
        """The records so far as arrays by quantity, shape (n,); of a run that was not iterated, all of them.

        `reaction_FACE`, the force of a face that holds, is of shape (n, d), `moment_FACE` (n, 3), or (n, 1) in 2D,
        `displacement_POINT` (n, d).
        """
        records = self._reached().summary.steps
        places = {
            **dict.fromkeys(("reaction", "moment"), self._measures.places),
            "displacement": self._probes.names,
        }
        names = [name for name in Record.__dataclass_fields__ if name not in places]
        columns = {name: np.array([getattr(record, name) for record in records]) for name in names}
        for name in places:
            for place in places[name]:
                columns[f"{name}_{place}"] = np.array([getattr(record, name)[place] for record in records])
        return columns

    def fields(self, *names: str) -> dict[str, Array]:
        """Fields of the last state so far; of a run that was not iterated, those at its end.

        Args:
            names: "displacement", of the mesh's nodes that this rank owns, shape (n, 3), "region", or names of
                `CELL_FIELDS`, averages over the cells that it owns, shape (cells,), (cells, 3) or (cells, 3, 3).

        Raises:
            UserError: If there is no field of a name.
        """
        known = ("displacement", "region", *CELL_FIELDS)
        for name in names:
            if name not in known:
                raise UserError(f"field {name!r}: {meant(name, known)}")
        fields = Fields(self._reached().body)
        nodal = {"displacement": fields.displacement()} if "displacement" in names else {}
        return nodal | fields.cells([name for name in names if name != "displacement"])

    def plot(self) -> "Figure":
        """The curve of the run: what the body does over what is done to it; not shown, and unknown to pyplot."""
        labels, points = curve.points(self.body.acting(), self._reached().summary.steps, len(self.body.stages))
        return curve.draw(points, labels, self.summary.scene)

    def _reached(self) -> "Run":
        """Who asks for results without an iteration wants those of the whole run."""
        return self if self._begun else self.finish()

    # ------------------------------------------------------------------ solution

    @cached_property
    def _measures(self) -> Measures:
        return Measures(self.body)

    def _solve(self) -> Iterator[Record]:
        self._begun = True
        began = last = time.perf_counter()
        self.progress.start(self)
        try:
            for reached in follow(self.body, self.options, self._start, self._steps, self.progress.increment):
                now = time.perf_counter()
                record = self._record(reached, now - last)
                last = now
                self.summary.steps.append(record)
                self._tell(reached.events)
                self.summary.wall_s = now - began
                yield record
        except PathFailure as failure:
            self._tell(failure.events)
            interrupted = failure.kind == Stopped.kind
            self.summary.status = "interrupted" if interrupted else "failed"
            found = {}
            if not interrupted:
                found = diagnose(self.body, self.options, failure.state, failure.kind, self._start is not None)
            self.summary.failure = Failure(failure.kind, str(failure), failure.load, found)
        else:
            self.summary.locking = locked(self.body, self.options, self._start is not None)
        self.summary.wall_s = time.perf_counter() - began

    def _tell(self, events: Iterable[Event]) -> None:
        for event in events:
            self.summary.events.append(event)
            self.progress.event(event)

    def _record(self, reached: Reached, seconds: float) -> Record:
        measures = self._measures
        return Record(
            load=reached.load,
            energy=self.body.assembly.energy(reached.state),
            reaction=measures.reactions(),
            volume_ratio=measures.volume_ratio(),
            min_J=measures.min_J(),
            newton_iterations=reached.newton,
            linear_iterations=reached.linear,
            wall_s=seconds,
            number=reached.number,
            name=reached.name,
            max_displacement=measures.largest_displacement(),
            moment=measures.moments(),
            displacement=self._probes.displacements(),
            stable=reached.stable,
        )


def start(scene: Scene, comm: MPI.Comm = MPI.COMM_WORLD, progress: Progress | None = None) -> Run:
    """A run of a scene.

    Raises:
        UserError: If the scene is impossible.
    """
    body, reason = build.build(scene, comm)
    way = build.options(scene), build.start(scene), build.steps(scene)
    try:
        run = Run(body, *way, scene.name, reason, progress, scene.output.points)
    except UserError as error:
        raise SceneError(f"{scene.name}.toml: {error}") from None
    for region, given in scene.materials.items():
        entry = run.summary.material if region is None else run.summary.materials[region]
        entry |= {"name": given.name, "alpha": 1.0 if given.alpha is None else given.alpha}
    return run


def run(
    scene: Scene, folder: Path, comm: MPI.Comm = MPI.COMM_WORLD, progress: Progress | None = None
) -> tuple[Summary, list[Path]]:
    """Solves a scene and writes its results.

    Args:
        scene: What to solve.
        folder: Where the results go; made if needed.
        comm: All ranks of it take part.
        progress: Told how it goes.

    Returns:
        What `summary.json` says, and the files written (on rank 0).

    Raises:
        UserError: If the scene or the folder is impossible; nothing has been written then.
    """
    began = time.perf_counter()
    outputs = Outputs(scene.title or scene.name, tuple(scene.output.fields), scene.output.average, scene.output.picture)
    results = RunFolder(folder, outputs, comm)
    solving = start(scene, comm, progress)
    # What is begun is brought to a whole end, whatever signal comes; it begins on all ranks or on none.
    with interrupts.held():
        if interrupts.asked(comm):
            raise interrupts.Interrupted
        results.start(solving.body, text(scene, solving.body.element))
        for record in solving:
            results.step(record)
            solving.progress.step(record)
        solving.summary.wall_s = time.perf_counter() - began
        return solving.summary, results.finish(solving.summary)
