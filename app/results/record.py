"""What a run leaves: one record a load step, and how it ended."""

import math
from dataclasses import asdict, dataclass, field
from typing import Any

from elastune.app.body.body import Body
from elastune.app.solvers.outcome import Event
from elastune.forms.energy import Energy
from elastune.forms.normalize import linearize


@dataclass(frozen=True)
class Record:
    """One recorded step.

    Attributes:
        load: Load factor, from 0 to 1.
        energy: Strain energy less the work of the loads.
        reaction: Force of each face that holds on the body, by face, along x, y, z; all are in balance with the loads.
        volume_ratio: Deformed over reference volume.
        min_J: Least volume ratio at any quadrature point.
        newton_iterations: Newton steps spent, rejected attempts included.
        linear_iterations: Iterations of the linear solver; one a direct solve.
        wall_s: Seconds.
        number: Of the recorded step, from one on.
        name: Of the part of the load path.
        max_displacement: Largest displacement of a node.
        stable: Whether the state is a minimum of Π; None where nobody tells.
        displacement: Of each point that was asked for, by its name, along x, y, z.
        moment: Moment of each of these forces about the centroid of its face at rest, about x, y, z; in 2D about z.
    """

    load: float
    energy: float
    reaction: dict[str, list[float]]
    volume_ratio: float
    min_J: float
    newton_iterations: int
    linear_iterations: int
    wall_s: float
    number: int = 0
    name: str = ""
    max_displacement: float = 0.0
    moment: dict[str, list[float]] = field(default_factory=dict)
    displacement: dict[str, list[float]] = field(default_factory=dict)
    stable: bool | None = None

    def row(self) -> dict[str, Any]:
        """As columns: reaction_FACE_x, moment_FACE_x, displacement_POINT_x and so on."""
        row: dict[str, Any] = {}
        for name in Record.__dataclass_fields__:
            value = getattr(self, name)
            if isinstance(value, dict):
                for face, parts in value.items():
                    # In 2D a moment is about z.
                    axes = "z" if name == "moment" and len(parts) == 1 else "xyz"
                    row |= {f"{name}_{face}_{axis}": part for axis, part in zip(axes, parts, strict=False)}
            else:
                row[name] = value
        return row


@dataclass(frozen=True)
class Failure:
    """Why a run stopped.

    Attributes:
        kind: One word; "interrupted" by a signal.
        message: One line.
        load: The load factor that was not reached.
        diagnosis: What the state looks like where the last attempt ended, and advice: see `results.diagnose`.
    """

    kind: str
    message: str
    load: float
    diagnosis: dict[str, Any] = field(default_factory=dict)


@dataclass
class Summary:
    """What `summary.json` says; scripts rely on its keys.

    `materials` are those of regions, by name; `material` is the body's, or of the first region.
    `events` are what happened on the way: see `path.steps.Event`.
    `locking` says how much too stiff the mesh makes the body, and what to do `instead`; see `results.advice`.
    Its status is "converged", "failed" or "interrupted".
    """

    scene: str
    status: str
    failure: Failure | None
    material: dict[str, Any]
    element: str
    cells: int
    dofs: int
    ranks: int
    steps: list[Record] = field(default_factory=list)
    wall_s: float = 0.0
    peak_memory_mb: float = 0.0
    versions: dict[str, str] = field(default_factory=dict)
    materials: dict[str, dict[str, Any]] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    locking: dict[str, Any] | None = None

    def as_dict(self) -> dict[str, Any]:
        """Nested tables for JSON, which has no infinity and no NaN: null."""
        return _finite(asdict(self))


def _finite(value: Any) -> Any:
    """JSON has no infinity and no NaN: null."""
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def begun(body: Body, name: str) -> Summary:
    """The summary of a run that has begun."""
    materials = {region: _material(solid.energy) for region, solid in body.solids.items()}
    first = next(iter(materials))
    return Summary(
        scene=name,
        status="converged",
        failure=None,
        material=materials.get(None, materials[first]),
        element=body.element,
        cells=body.geometry.cells_count,
        dofs=body.size,
        ranks=body.comm.size,
        materials={region: entry for region, entry in materials.items() if region is not None},
    )


def _material(energy: Energy) -> dict[str, Any]:
    """What a summary says of a material."""
    at_rest = linearize(energy)
    return {
        "name": energy.name,
        "parameters": dict(energy.values),
        "E": at_rest.youngs_modulus,
        "nu": at_rest.poissons_ratio,
        "alpha": 1.0,
    }
