"""What a scene leaves, and where it sets out from."""

from typing import Annotated, Literal

from pydantic import Field

from elastune.app.scene.complaints import Table
from elastune.app.scene.schema.types import PositiveFloat, Vector

FieldName = Literal[
    "displacement",
    "J",
    "von_mises",
    "pressure",
    "stretches",
    "energy",
    "stress",
    "max_principal",
    "pk1",
    "log_strain",
    "region",
]


class Start(Table):
    """The shape from which the first load step sets out, instead of the body at rest.

    scramble: every node at random in the body's bounding box, enlarged about its centre to `volume` times its
    volume. plane, line, point: collapsed onto the plane through the centre across `axis`, the line along it, or
    the centre. inside-out: mirrored in that plane. pins: points of the body whose nodes stay where they are at
    rest, from start to end.
    """

    shape: Literal["scramble", "plane", "line", "point", "inside-out"] = Field(description="where the nodes are first")
    seed: Annotated[int, Field(ge=0)] = Field(default=0, description="of the random places of a scramble; –")
    volume: PositiveFloat = Field(default=2.0, description="of a scramble's box over that around the body; –")
    axis: Literal["x", "y", "z"] = Field(default="x", description="across the plane, or along the line")
    pins: list[Vector] = Field(default=[], description="points whose nodes stay where they are at rest; length")


class Output(Table):
    """What is written beside `summary.json` and `history.csv`."""

    fields: list[FieldName] = Field(default=["displacement"], description="what fields.xdmf holds")
    average: bool = Field(
        default=False, description="fields of cells at the nodes instead, as means of the cells around by volume"
    )
    points: dict[str, Vector] = Field(
        default={}, description="places at rest by name, whose displacements history.csv and summary.json tell; length"
    )
    picture: bool = Field(default=True, description="whether curve and deformed body are drawn")
