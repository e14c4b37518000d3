"""What a run leaves: one record a load step, and how it ended."""

from dataclasses import asdict, dataclass, field
from typing import Any


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


@dataclass(frozen=True)
class Failure:
    """Why a run stopped.

    Attributes:
        kind: One word.
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

    def as_dict(self) -> dict[str, Any]:
        """Nested tables for JSON."""
        return asdict(self)
