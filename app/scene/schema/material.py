"""What a body is made of."""

from typing import Annotated, Any

from pydantic import Field

from elastune.app.scene.complaints import Table
from elastune.app.scene.schema.types import Finite
from elastune.forms.tuned import tuned_energy
from elastune.forms.volumetric import split


class Material(Table):
    """The energy, calibrated to E and ν before the run; without them the parameters stand as given."""

    name: str
    E: Finite | None = None
    nu: Finite | None = None
    alpha: Finite | None = None
    alpha_lambda: Finite | None = None
    alpha_mu: Finite | None = None
    volume: str | None = None
    parameters: dict[str, Any] = {}
    calibrate: str | list[str] | None = None
    extension: Annotated[float, Field(gt=0, le=0.9)] | None = None


class Region(Table):
    """A part of the body with a material of its own: a group of cells of the mesh."""

    material: Material | None = Field(default=None, description="what it is made of; [material] unless given")


def energy_of(material: Material, mixed: bool) -> Any:
    """The energy, calibrated and tuned.

    Args:
        material: The table.
        mixed: Whether a mixed element is to take it.

    Raises:
        MaterialError: If it cannot be what is asked for.
    """
    energy = tuned_energy(**material.model_dump(exclude={"extension"}), mixed=mixed)
    if mixed:
        split(energy)
    return energy
