"""What a body is made of."""

from typing import Annotated, Any

from pydantic import Field

from elastune.app.scene.complaints import Table
from elastune.app.scene.schema.types import Finite
from elastune.forms.tuned import tuned_energy
from elastune.forms.volumetric import split


class Material(Table):
    """The energy, calibrated to E and ν before the run; without them the parameters stand as given."""

    name: str = Field(description="of the catalogue: elastune materials")
    E: Finite | None = Field(default=None, description="Young's modulus at rest; stress")
    nu: Finite | None = Field(default=None, description="Poisson's ratio at rest; –")
    alpha: Finite | None = Field(default=None, description="nonlinearity: the same at rest, stiffer when stretched; –")
    alpha_lambda: Finite | None = Field(default=None, description="nonlinearity of the λ part alone; –")
    alpha_mu: Finite | None = Field(default=None, description="nonlinearity of the μ part alone; –")
    volume: str | None = Field(default=None, description="material whose λ part is taken instead")
    parameters: dict[str, Any] = Field(
        default={}, description="parameters and options of the formula; moduli follow from E and nu; stress or –"
    )
    calibrate: str | list[str] | None = Field(
        default=None, description='the two parameters that E and nu determine, or "least" change of all'
    )
    extension: Annotated[float, Field(gt=0, le=0.9)] | None = Field(
        default=None, description="stretch below which the energy goes on as a polynomial, to survive inversion; –"
    )


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
