"""What happens to a body: on its faces and in its volume."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from elastune.app.scene.complaints import Table
from elastune.app.scene.schema.types import Finite, Vector


class Rotation(Table):
    """Rotation by an angle in degrees about an axis through a point."""

    axis: Annotated[list[Finite], Field(min_length=3, max_length=3)]
    center: Vector
    angle: Finite


class Condition(Table):
    """What happens to one face; exactly one of these.

    fix: no displacement. move: prescribed displacement. rotate: prescribed rotation. roller: no displacement
    along the named axes. pull: dead traction, force per reference area. pressure: follower pressure, positive
    into the body.
    """

    fix: Literal[True] | None = None
    move: Vector | None = None
    rotate: Rotation | None = None
    roller: Annotated[list[Literal["x", "y", "z"]], Field(min_length=1)] | None = None
    pull: Vector | None = None
    pressure: Finite | None = None

    @model_validator(mode="after")
    def _one(self) -> "Condition":
        kinds = [name for name in type(self).model_fields if name in self.model_fields_set]
        if len(kinds) != 1:
            known = ", ".join(type(self).model_fields)
            raise ValueError(f"expected exactly one of {known}, got {' and '.join(kinds) or 'nothing'}")
        return self

    @property
    def kind(self) -> str:
        """The name of the condition."""
        return next(iter(self.model_fields_set))

    @property
    def holds(self) -> bool:
        """Whether displacements are prescribed."""
        return self.kind in ("fix", "move", "rotate", "roller")

    @property
    def loads(self) -> bool:
        """Whether anything happens to the body."""
        value = getattr(self, self.kind)
        if self.kind == "rotate":
            return value.angle != 0
        return (self.kind in ("move", "pull") and any(value)) or (self.kind == "pressure" and value != 0)


class Body(Table):
    """Loads on the volume."""

    force: Vector
