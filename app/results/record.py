"""What a run leaves: one record a load step, and how it ended."""

from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True)
class Record:
    """One recorded step.

    Attributes:
        load: Load factor, from 0 to 1.
        energy: Strain energy less the work of the loads.
        reaction: Force of each held face on the body, by face, along x, y, z.
        volume_ratio: Deformed over reference volume.
        min_J: Least volume ratio at any quadrature point.
        newton_iterations: Newton steps spent, rejected attempts included.
        linear_iterations: Iterations of the linear solver; one a direct solve.
        wall_s: Seconds.
        number: Of the recorded step, from one on.
        name: Of the part of the load path.
        max_displacement: Largest displacement of a node.
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

    def as_dict(self) -> dict[str, Any]:
        """Nested tables for JSON."""
        return asdict(self)
