"""A scene: what is solved, from all its tables."""

from typing import Any

from pydantic import Field

from elastune.app.errors import SceneError
from elastune.app.scene.complaints import Table
from elastune.app.scene.schema.conditions import Body, Condition, Curve, End, Point, Stage, ends
from elastune.app.scene.schema.material import Material, energy_of
from elastune.app.scene.schema.mesh import Mesh
from elastune.app.scene.schema.output import Output, Start
from elastune.app.scene.schema.solve import Solve
from elastune.forms.elements import ELEMENTS, MIXED_FROM, Choice, choose
from elastune.forms.materials import MaterialError
from elastune.forms.normalize import linearize


class Scene(Table):
    """One file, one run."""

    title: str = ""
    mesh: Mesh = Mesh()
    solve: Solve = Solve()
    material: Material
    boundary: dict[str, Condition] = Field(default={}, description="what happens on faces, by name")
    curve: dict[str, Curve] = Field(default={}, description="what happens on curves that the mesh file names")
    point: dict[str, Point] = Field(
        default={}, description="what happens at points, by a name of your own or of the mesh file"
    )
    body: Body | None = Field(default=None, description="loads on the volume")
    stage: list[Stage] = Field(
        default=[], description="parts of the load path, one after the other; load counts on, 1, 2, …"
    )
    start: Start | None = None
    output: Output = Output()
    name: str = Field(default="scene", exclude=True)

    @property
    def ends(self) -> list[End]:
        """What there is at the end of each stage."""
        return ends(self)

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


def material_energy(scene: Scene) -> Any:
    """The scene's energy, calibrated and tuned.

    Raises:
        SceneError: If the material cannot be what the scene asks for.
    """
    try:
        return energy_of(scene.material, mixed=ELEMENTS[scene.element].pressure is not None)
    except MaterialError as error:
        raise SceneError(f"material: {error}") from None


def unmixed_keys(scene: Scene) -> tuple[tuple[str, Any, Any], ...]:
    """Keys that mixed elements know one value of: key, the scene's value, and that one."""
    return (
        ("material.extension", scene.material.extension, None),
        ("solve.filter", scene.solve.filter, "auto"),
        ("solve.method", scene.solve.method, "line-search"),
    )


def _near_incompressible(scene: Scene) -> bool:
    """Whether "auto" is to take a mixed element: never where one would be refused."""
    nu = scene.material.nu
    if scene.start is not None or any(value != only for _, value, only in unmixed_keys(scene)):
        return False
    if nu is not None and nu < MIXED_FROM:
        return False
    try:
        energy = energy_of(scene.material, mixed=True)
    except MaterialError:
        return False
    return linearize(energy).poissons_ratio >= MIXED_FROM


def mesh_arguments(scene: Scene) -> dict[str, Any]:
    """The arguments of `elastune.geometry.build` but the communicator."""
    return {**scene.mesh.model_dump(), "cell": scene.cell}
