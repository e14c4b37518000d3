"""The body: its mesh."""

from typing import Annotated, Literal

from pydantic import Field

from elastune.app.scene.complaints import Table
from elastune.app.scene.schema.types import Count, PositiveFloat


class Mesh(Table):
    """The body: a shape made by gmsh, or a `.msh` file whose physical groups name the faces."""

    shape: Literal["cube", "box", "cylinder", "square", "rectangle", "file"] = "cube"
    size: PositiveFloat | list[PositiveFloat] = 1.0
    cells: Count | list[Count] = 10
    h: PositiveFloat | None = None
    cell: Literal["hexahedron", "tetrahedron", "quadrilateral", "triangle"] | None = None
    order: Literal[1, 2] = 1
    grade: dict[str, PositiveFloat] | None = None
    path: str | None = None
    refine: Annotated[int, Field(ge=0, le=10)] = 0

    @property
    def dimension(self) -> int | None:
        """2 or 3, or None where only the file tells."""
        return None if self.shape == "file" else 2 if self.shape in ("square", "rectangle") else 3
