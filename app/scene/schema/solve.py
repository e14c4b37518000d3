"""How a scene is solved."""

from typing import Literal

from pydantic import Field

from elastune.app.scene.complaints import Table
from elastune.app.scene.schema.types import Count, PositiveFloat
from elastune.app.solvers.options import Options
from elastune.forms.elements import ELEMENTS


class Solve(Table):
    """How it is solved."""

    element: Literal[(*ELEMENTS, "auto")] = "auto"  # type: ignore[valid-type]
    steps: Count = Options.steps
    tolerance: PositiveFloat = Options.tolerance
    max_iterations: Count = Options.max_iterations
    method: Literal["line-search", "trust-region"] = "line-search"
    filter: Literal["auto", "none", "clamp", "absolute"] = "auto"
    linear: Literal["auto", "direct", "iterative"] = "auto"
    assembly: Literal["auto", "ufl", "spectral"] = "auto"
    quadrature: Count | None = None
    smallest_step: PositiveFloat = Options.smallest_step
    free: bool = Field(
        default=False, description="whether rigid motions may be left that nothing holds and no load works on"
    )
    time_limit: PositiveFloat | None = None
