"""The scene: what is solved, its schema."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from elastune.app.errors import SceneError
from elastune.app.scene.complaints import Table
from elastune.app.solvers.options import Options
from elastune.forms.elements import ELEMENTS, MIXED_FROM, Choice, choose
from elastune.forms.materials import MaterialError
from elastune.forms.normalize import linearize
from elastune.forms.tuned import tuned_energy
from elastune.forms.volumetric import split

Finite = Annotated[float, Field(allow_inf_nan=False)]
PositiveFloat = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Vector = Annotated[list[Finite], Field(min_length=2, max_length=3)]
Count = Annotated[int, Field(ge=1)]


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


class Solve(Table):
    """How it is solved."""

    element: Literal[(*ELEMENTS, "auto")] = "auto"  # type: ignore[valid-type]
    steps: Count = Options.steps
    tolerance: PositiveFloat = Options.tolerance
    max_iterations: Count = Options.max_iterations
    method: Literal["line-search", "trust-region"] = "line-search"
    filter: Literal["auto", "none", "clamp", "absolute"] = "auto"
    linear: Literal["auto", "direct", "iterative"] = "auto"
    assembly: Literal["auto", "ufl", "spectral"] = "auto"
    quadrature: Count | None = None
    smallest_step: PositiveFloat = Options.smallest_step
    time_limit: PositiveFloat | None = None


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


class Start(Table):
    """The shape from which the first load step sets out, instead of the body at rest.

    scramble: every node at random in the body's bounding box, enlarged about its centre to `volume` times its
    volume. plane, line, point: collapsed onto the plane through the centre across `axis`, the line along it, or
    the centre. inside-out: mirrored in that plane. pins: points of the body whose nodes stay where they are at
    rest, from start to end.
    """

    shape: Literal["scramble", "plane", "line", "point", "inside-out"]
    seed: Annotated[int, Field(ge=0)] = 0
    volume: PositiveFloat = 2.0
    axis: Literal["x", "y", "z"] = "x"
    pins: list[Vector] = []


class Output(Table):
    """What is written beside `summary.json` and `history.csv`."""

    fields: list[Literal["displacement", "J", "von_mises", "pressure", "stretches", "energy", "stress"]] = [
        "displacement"
    ]
    picture: bool = True


class Scene(Table):
    """One file, one run."""

    title: str = ""
    mesh: Mesh = Mesh()
    solve: Solve = Solve()
    material: Material
    boundary: dict[str, Condition] = {}
    body: Body | None = None
    start: Start | None = None
    output: Output = Output()
    name: str = Field(default="scene", exclude=True)

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
        return _energy(scene.material, mixed=ELEMENTS[scene.element].pressure is not None)
    except MaterialError as error:
        raise SceneError(f"material: {error}") from None


def _energy(material: Material, mixed: bool) -> Any:
    energy = tuned_energy(**material.model_dump(exclude={"extension"}), mixed=mixed)
    if mixed:
        split(energy)
    return energy


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
        energy = _energy(scene.material, mixed=True)
    except MaterialError:
        return False
    return linearize(energy).poissons_ratio >= MIXED_FROM


def mesh_arguments(scene: Scene) -> dict[str, Any]:
    """The arguments of `elastune.geometry.build` but the communicator."""
    return {**scene.mesh.model_dump(), "cell": scene.cell}
