"""How a scene is solved."""

from typing import Literal

from pydantic import Field

from elastune.app.scene.complaints import Table
from elastune.app.scene.schema.types import Count, PositiveFloat
from elastune.app.solvers.options import Options
from elastune.forms.elements import ELEMENTS


class Solve(Table):
    """How it is solved."""

    element: Literal[(*ELEMENTS, "auto")] = Field(  # type: ignore[valid-type]
        default="auto", description="finite element; the second letters stand for pressures of mixed ones"
    )
    steps: Count = Field(default=Options.steps, description="recorded steps to full load, of each stage; –")
    tolerance: PositiveFloat = Field(
        default=Options.tolerance, description="out-of-balance force over the largest force on the way; –"
    )
    max_iterations: Count = Field(default=Options.max_iterations, description="Newton steps of one load step; –")
    method: Literal["line-search", "trust-region"] = Field(
        default="line-search", description="what keeps Newton's steps from going too far"
    )
    filter: Literal["auto", "none", "clamp", "absolute"] = Field(
        default="auto", description="what is done with negative eigenvalues of the stiffness at a point"
    )
    linear: Literal["auto", "direct", "iterative"] = Field(
        default="auto", description="linear solver: factorisation, or conjugate gradients with multigrid"
    )
    assembly: Literal["auto", "ufl", "spectral"] = Field(
        default="auto", description="forms that UFL differentiates, or the kernel of stretches"
    )
    quadrature: Count | None = Field(
        default=None, description="degree that the quadrature is exact for; the element's own unless given; –"
    )
    smallest_step: PositiveFloat = Field(
        default=Options.smallest_step, description="how far load steps are cut back before a run gives up; –"
    )
    follow: Literal["minimum", "path", "arc"] = Field(
        default="minimum",
        description='states of least energy; or the branch that begins at rest, stable or not: "path" as far as the '
        'load rises, "arc" through its limits',
    )
    arc_steps: Count = Field(default=Options.arc_steps, description='recorded steps of follow = "arc", at most; –')
    free: bool = Field(
        default=False, description="whether rigid motions may be left that nothing holds and no load works on"
    )
    time_limit: PositiveFloat | None = Field(default=None, description="when a run gives up; s")
