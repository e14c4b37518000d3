"""A scene: what is solved, from all its tables."""

from typing import Any

from pydantic import Field

from elastune.app.errors import SceneError
from elastune.app.scene.complaints import Table
from elastune.app.scene.schema.conditions import Body, Condition, Curve, End, Point, Stage, ends
from elastune.app.scene.schema.material import Material, Region, energy_of
from elastune.app.scene.schema.mesh import Mesh
from elastune.app.scene.schema.output import Output, Start
from elastune.app.scene.schema.solve import Solve
from elastune.forms.elements import ELEMENTS, MIXED_FROM, Choice, choose
from elastune.forms.materials import MaterialError
from elastune.forms.normalize import linearize


class Scene(Table):
    """One file, one run."""

    title: str = Field(default="", description="what lists and pictures call it")
    mesh: Mesh = Field(default=Mesh(), description="the body at rest")
    solve: Solve = Field(default=Solve(), description="how it is solved")
    material: Material | None = Field(
        default=None, description="of the body, and of regions without one; needed unless every cell lies in one with"
    )
    region: dict[str, Region] = Field(default={}, description="parts of other materials, by name of a group of cells")
    boundary: dict[str, Condition] = Field(default={}, description="what happens on faces, by name")
    curve: dict[str, Curve] = Field(default={}, description="what happens on curves that the mesh file names")
    point: dict[str, Point] = Field(
        default={}, description="what happens at points, by a name of your own or of the mesh file"
    )
    body: Body | None = Field(default=None, description="loads on the volume")
    stage: list[Stage] = Field(
        default=[], description="parts of the load path, one after the other; load counts on, 1, 2, …"
    )
    start: Start | None = Field(default=None, description="a shape to set out from, instead of the body at rest")
    output: Output = Field(default=Output(), description="what is written beside summary.json and history.csv")
    name: str = Field(default="scene", exclude=True)

    @property
    def ends(self) -> list[End]:
        """What there is at the end of each stage."""
        return ends(self)

    @property
    def materials(self) -> dict[str | None, Material]:
        """What the body is made of, by region; None stands for all other cells."""
        body = {} if self.material is None else {None: self.material}
        own = {name: region.material or self.material for name, region in self.region.items()}
        return body | {name: material for name, material in own.items() if material is not None}

    @property
    def cell(self) -> str:
        """Cell type; hexahedra and quadrilaterals unless a simplex element or cell is asked for."""
        if self.mesh.cell is not None:
            return self.mesh.cell
        simplex = self.solve.element.startswith("P")
        if self.mesh.dimension == 2:
            return "triangle" if simplex else "quadrilateral"
        return "tetrahedron" if simplex else "hexahedron"

    @property
    def element(self) -> str:
        """Element name; for "auto" the one on a mesh not too large."""
        return self.chosen(self.cell).element if self.solve.element == "auto" else self.solve.element

    def chosen(self, cell: str, cells: int = 0) -> Choice:
        """What "auto" stands for on so many cells of a type."""
        return choose(cell, _near_incompressible(self), cells)


def material_key(region: str | None) -> str:
    """The table that says what a region is made of, or the rest of the body."""
    return "material" if region is None else f"region.{region}.material"


def material_energies(scene: Scene) -> dict[str | None, Any]:
    """The energies of a scene, calibrated and tuned, by region; None stands for all other cells.

    Raises:
        SceneError: If a material cannot be what the scene asks for.
    """
    mixed, energies = ELEMENTS[scene.element].pressure is not None, {}
    for region, material in scene.materials.items():
        try:
            energies[region] = energy_of(material, mixed)
        except MaterialError as error:
            raise SceneError(f"{material_key(region)}: {_reason(scene, material, error)}") from None
    return energies


def _reason(scene: Scene, material: Material, error: MaterialError) -> MaterialError | str:
    """What a material lacks; where "auto" could not take a mixed element, the reason why not."""
    if scene.solve.element != "auto" or material.nu != 0.5:
        return error
    try:
        energy_of(material, mixed=True)
    except MaterialError as first:
        return first
    keys = _unmixed(scene)
    return f"nu: must be below 0.5 with {keys[0]}, which mixed elements do not have, got 0.5" if keys else error


def material_energy(scene: Scene) -> Any:
    """The energy of a scene of one material.

    Raises:
        SceneError: If it has several, or its material cannot be what it asks for.
    """
    if scene.region:
        raise SceneError(f"region.{next(iter(scene.region))}: expected one material in the whole body")
    return material_energies(scene)[None]


def unmixed_keys(scene: Scene) -> tuple[tuple[str, Any, Any], ...]:
    """Keys that mixed elements know one value of: key, the scene's value, and that one."""
    return (
        *((f"{material_key(region)}.extension", given.extension, None) for region, given in scene.materials.items()),
        ("solve.filter", scene.solve.filter, "auto"),
        ("solve.method", scene.solve.method, "line-search"),
    )


def _unmixed(scene: Scene) -> list[str]:
    """What a scene says that mixed elements do not have."""
    start = [] if scene.start is None else ["start"]
    return start + [key for key, value, only in unmixed_keys(scene) if value != only]


def _near_incompressible(scene: Scene) -> bool:
    """Whether "auto" is to take a mixed element: where a material needs one, and all can be had with one."""
    given = list(scene.materials.values())
    if _unmixed(scene):
        return False
    if all(material.nu is not None and material.nu < MIXED_FROM for material in given):
        return False
    try:
        energies = [energy_of(material, mixed=True) for material in given]
    except MaterialError:
        return False
    return any(linearize(energy).poissons_ratio >= MIXED_FROM for energy in energies)


def mesh_arguments(scene: Scene) -> dict[str, Any]:
    """The arguments of `elastune.geometry.build` but the communicator."""
    return {**scene.mesh.model_dump(), "cell": scene.cell}
