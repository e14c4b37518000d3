"""How a body is solved."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Options:
    """What may be chosen of the solvers and of the load path.

    Attributes:
        steps: Recorded steps to full load; a first guess of the increments, which are cut back where needed.
        tolerance: Forces out of balance relative to the forces in the body.
        max_iterations: Newton steps of one increment.
        method: "line-search", or "trust-region" to begin with a trust region.
        filter: What becomes of negative eigenvalues of the tangent; "auto" filters where the raw tangent fails.
        linear: "direct", "iterative", or "auto" by size.
        smallest_step: Of an increment, relative to a recorded step.
        follow: "minimum", or the branch of equilibria that begins at rest, stable or not: "path" as far as the load
            rises, "arc" also where it falls.
        arc_steps: Recorded steps of "arc", at most.
        time_limit: Seconds, or None.
        prefix: Of PETSc's options for these solvers.
    """

    steps: int = 10
    tolerance: float = 1e-8
    max_iterations: int = 60
    method: Literal["line-search", "trust-region"] = "line-search"
    filter: Literal["auto", "none", "clamp", "absolute"] = "auto"
    linear: Literal["auto", "direct", "iterative"] = "auto"
    smallest_step: float = 1e-4
    follow: Literal["minimum", "path", "arc"] = "minimum"
    arc_steps: int = 50
    time_limit: float | None = None
    prefix: str = ""
