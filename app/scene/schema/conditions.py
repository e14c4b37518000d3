"""What happens to a body: on its faces, curves and points, in its volume, and stage by stage."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from elastune.app.scene.complaints import Table
from elastune.app.scene.schema.types import Count, Entry, Finite, PositiveFloat, Vector

Axes = Annotated[list[Literal["x", "y", "z"]], Field(min_length=1)]
Direction = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Stiffnesses = Annotated[list[Annotated[float, Field(ge=0, allow_inf_nan=False)]], Field(min_length=2, max_length=3)]
Entries = Annotated[list[Entry], Field(min_length=2, max_length=3)]


class Components(Table):
    """A displacement along some axes; the others stay free."""

    x: Entry | None = Field(
        default=None, description="displacement along x: a number or an expression of x, y, z; length"
    )
    y: Entry | None = Field(default=None, description="displacement along y, likewise; length")
    z: Entry | None = Field(default=None, description="displacement along z, likewise; length")

    @model_validator(mode="after")
    def _some(self) -> "Components":
        if not self.model_fields_set:
            raise ValueError("expected x, y or z")
        return self


class Rotation(Table):
    """Rotation by an angle about an axis through a point."""

    axis: Direction = Field(description="direction of the axis; –")
    center: Vector = Field(description="a point of the axis; length")
    angle: Finite = Field(description="angle at the end of the stage; degrees")


class Normal(Table):
    """A dead traction along the outward normal of the face at rest."""

    normal: Entry = Field(description="traction along the outward normal at rest, a number or an expression; stress")


class Moment(Table):
    """A dead couple, spread over the face."""

    axis: Direction = Field(default=[0.0, 0.0, 1.0], description="direction of the axis; –")
    center: Vector = Field(description="a point of the axis; length")
    value: Finite = Field(description="torque about the axis; force × length")


class Spring(Table):
    """An elastic foundation."""

    stiffness: (
        PositiveFloat | Annotated[list[Annotated[float, Field(ge=0, allow_inf_nan=False)]], Field(min_length=2)]
    ) = Field(description="force per area and displacement, one number or one along each axis; stress/length")


class Motions(Table):
    """What holds a place: it stays, or moves as prescribed."""

    fix: Literal[True] | None = Field(default=None, description="no displacement")
    move: Entries | Components | None = Field(
        default=None,
        description="prescribed displacement, all of it or { x = … }: numbers or expressions; length",
    )
    roller: Axes | None = Field(default=None, description="axes along which it does not move")

    @model_validator(mode="after")
    def _some(self) -> Self:
        if not self.kinds:
            known = ", ".join(name for name in type(self).model_fields if name != "at")
            raise ValueError(f"expected one or several of {known}, got nothing")
        return self

    def then(self, later: Self) -> Self:
        """What there is after a stage that changes some of it."""
        changes = {kind: getattr(later, kind) for kind in later.kinds}
        if isinstance(self.move, Components) and isinstance(later.move, Components):
            changes["move"] = self.move.model_copy(update=later.move.model_dump(exclude_unset=True))
        return self.model_copy(update=changes)

    @property
    def kinds(self) -> list[str]:
        """The names of the conditions given."""
        return [name for name in type(self).model_fields if name in self.model_fields_set and name != "at"]

    def held(self, dimension: int = 3) -> dict[str, list[int]]:
        """The components that are prescribed, by what prescribes them."""
        found = {}
        for kind in self.kinds:
            value = getattr(self, kind)
            if kind in ("fix", "rotate") or (kind == "move" and isinstance(value, list)):
                found[kind] = list(range(dimension))
            elif kind == "move":
                found[kind] = ["xyz".index(axis) for axis in sorted(value.model_fields_set)]
            elif kind == "roller":
                found[kind] = sorted({"xyz".index(axis) for axis in value})
        return found


class Condition(Motions):
    """What happens on one face; several stand together unless a component is both held and loaded."""

    rotate: Rotation | None = Field(default=None, description="prescribed rotation of the face")
    pull: Entries | Normal | None = Field(
        default=None,
        description="dead traction, force per area at rest, or { normal = … }; numbers or expressions; stress",
    )
    pressure: Finite | None = Field(
        default=None, description="pressure on the deformed face, positive into the body; stress"
    )
    moment: Moment | None = Field(default=None, description="dead couple spread over the face")
    spring: Spring | None = Field(default=None, description="elastic foundation")
    force: Vector | None = Field(default=None, description="dead force, spread evenly over the face; force")


class Point(Motions):
    """What happens at a point: a node of the mesh."""

    at: Vector | None = Field(
        default=None, description="place at rest; without it the mesh file names the point; length"
    )
    force: Vector | None = Field(default=None, description="dead force; force")


class Curve(Motions):
    """What happens on a curve that the mesh file names."""

    force: Vector | None = Field(default=None, description="dead force, spread evenly over the curve; force")


class Body(Table):
    """Loads on the volume."""

    force: Entries = Field(description="dead load, force per volume at rest, numbers or expressions; force/length³")


class Stage(Table):
    """A part of the load path: what is other at its end than at the end of the one before."""

    name: str = Field(default="", description="what results call it")
    steps: Count | None = Field(default=None, description="recorded steps; solve.steps unless given; –")
    boundary: dict[str, Condition] = Field(default={}, description="conditions of faces at its end")
    point: dict[str, Point] = Field(default={}, description="conditions of points at its end")
    curve: dict[str, Curve] = Field(default={}, description="conditions of curves at its end")
    body: Body | None = Field(default=None, description="loads on the volume at its end")


Places = dict[tuple[str, str], Motions]


def places(table: Any) -> Places:
    """The conditions of a scene or a stage, by group and name of their places."""
    groups = ("boundary", "curve", "point")
    return {(group, name): condition for group in groups for name, condition in getattr(table, group).items()}


@dataclass(frozen=True)
class End:
    """All that there is at the end of a stage.

    Attributes:
        name: Of the stage.
        steps: Recorded steps, or None.
        places: By group and name.
        force: On the volume, or None.
    """

    name: str
    steps: int | None
    places: Places
    force: Body | None


def ends(scene: Any) -> list[End]:
    """Of all stages of a scene, the first of which sets out from rest; without stages there is one."""
    found: list[End] = []
    now, force = places(scene), scene.body
    for stage in scene.stage or [Stage()]:
        changed = dict(now)
        for place, later in places(stage).items():
            changed[place] = changed[place].then(later) if place in changed else later
        now, force = changed, stage.body or force
        found.append(End(stage.name, stage.steps, now, force))
    return found
