"""The body: its mesh."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from elastune.app.scene.complaints import Table
from elastune.app.scene.schema.types import Count, Finite, PositiveFloat, Vector


class Plane(Table):
    """A plane of any direction."""

    normal: Vector = Field(description="direction across the plane, of any length; –")
    point: Vector = Field(description="a point in the plane; length")


class Sphere(Table):
    """A sphere, in 2D a disc."""

    center: Vector = Field(description="its center; length")
    radius: PositiveFloat = Field(description="its radius; length")


class Cylinder(Table):
    """A cylinder without ends."""

    axis: Literal["x", "y", "z"] | Vector = Field(description="direction of the axis; –")
    center: Vector = Field(description="a point on the axis; length")
    radius: PositiveFloat = Field(description="its radius; length")


class Solid(Table):
    """What selects a part of a mesh; exactly one, beside `tolerance`."""

    tag: Count | None = Field(default=None, description="number of a physical group, or else of a geometric entity; –")
    box: Annotated[list[Vector], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="within a box: its lower and its upper corner; length"
    )
    sphere: Sphere | None = Field(default=None, description="within a sphere: center, radius; length")
    cylinder: Cylinder | None = Field(default=None, description="within a cylinder: axis, center, radius; length")
    all: Literal[True] | None = Field(default=None, description="the whole skin; the whole body for regions")
    tolerance: Annotated[float, Field(ge=0, lt=1)] | None = Field(
        default=None, description="how far outside still counts, over the body's largest extent; 1e-6; –"
    )


class Face(Solid):
    """A selector of facets."""

    plane: Literal["x", "y", "z"] | Plane | None = Field(
        default=None, description="in a plane: the axis across it with `at`, or normal and point; inner facets too; –"
    )
    at: Finite | None = Field(default=None, description="place of the plane along its axis; length")


class Mesh(Table):
    """The body: a shape made by gmsh, or a file with a mesh, whose groups name faces and regions, or with a body."""

    shape: Literal["cube", "box", "cylinder", "square", "rectangle", "file"] = Field(
        default="cube", description="the body at rest; squares and rectangles are of plane strain"
    )
    size: PositiveFloat | list[PositiveFloat] = Field(
        default=1.0, description="edge of a cube or square, [x, y, z] of a box, [radius, height] of a cylinder; length"
    )
    cells: Count | list[Count] = Field(default=10, description="cells along the longest edge, or along each; –")
    h: PositiveFloat | None = Field(default=None, description="size of the cells, instead of their number; length")
    cell: Literal["hexahedron", "tetrahedron", "quadrilateral", "triangle"] | None = Field(
        default=None, description="cell type; what the element needs unless given"
    )
    order: Literal[1, 2] = Field(default=1, description="degree of the cells' own shape, 2 for curved ones; –")
    grade: dict[str, PositiveFloat] | None = Field(
        default=None, description="finer towards faces: size of the cells there over the size elsewhere, by face; –"
    )
    path: str | None = Field(default=None, description="mesh or body of another program, relative to the scene file")
    refine: Annotated[int, Field(ge=0, le=10)] = Field(
        default=0, description="how often the cells of a file are halved along every edge; –"
    )
    faces: dict[str, Face] = Field(default={}, description="further faces, a selector by name")
    regions: dict[str, Solid] = Field(default={}, description="further regions, a selector by name")

    @model_validator(mode="before")
    @classmethod
    def _a_path_is_of_a_file(cls, given: Any) -> Any:
        if isinstance(given, dict) and "path" in given:
            return {"shape": "file", **given}
        return given

    @property
    def dimension(self) -> int | None:
        """2 or 3, or None where only the file tells."""
        return None if self.shape == "file" else 2 if self.shape in ("square", "rectangle") else 3
