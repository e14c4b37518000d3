"""The scene: what is solved, read from TOML and checked before any mesh is built."""

import difflib
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from app.errors import SceneError
from forms.elements import ELEMENTS, MIXED_FROM, Choice, choose
from forms.materials import MaterialError
from forms.normalize import linearize
from forms.tuned import tuned_energy
from forms.volumetric import split
from geometry import GeometryError, face_names
from geometry.shapes import make_plan

SHIPPED = Path(__file__).parent / "scenes"

Finite = Annotated[float, Field(allow_inf_nan=False)]
PositiveFloat = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Vector = Annotated[list[Finite], Field(min_length=2, max_length=3)]
Count = Annotated[int, Field(ge=1)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Mesh(_Table):
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


class Solve(_Table):
    """How it is solved."""

    element: Literal[(*ELEMENTS, "auto")] = "auto"  # type: ignore[valid-type]
    steps: Count = 10
    tolerance: PositiveFloat = 1e-8
    max_iterations: Count = 60
    method: Literal["line-search", "trust-region"] = "line-search"
    filter: Literal["auto", "none", "clamp", "absolute"] = "auto"
    linear: Literal["auto", "direct", "iterative"] = "auto"
    assembly: Literal["auto", "ufl", "spectral"] = "auto"
    quadrature: Count | None = None
    smallest_step: PositiveFloat = 1e-4
    time_limit: PositiveFloat | None = None


class Material(_Table):
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


class Rotation(_Table):
    """Rotation by an angle in degrees about an axis through a point."""

    axis: Annotated[list[Finite], Field(min_length=3, max_length=3)]
    center: Vector
    angle: Finite


class Condition(_Table):
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


class Body(_Table):
    """Loads on the volume."""

    force: Vector


class Start(_Table):
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


class Output(_Table):
    """What is written beside `summary.json` and `history.csv`."""

    fields: list[Literal["displacement", "J", "von_mises", "pressure", "stretches", "energy", "stress"]] = [
        "displacement"
    ]
    picture: bool = True


class Scene(_Table):
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


def load(source: str, overrides: Iterable[str] = ()) -> Scene:
    """Reads a shipped scene by name, or a scene file, and checks it.

    Args:
        source: Path of a TOML file, or the name of a shipped scene.
        overrides: Assignments `key.key=value` with TOML values, applied before the check.

    Raises:
        SceneError: One line with file, key and what was expected.
    """
    path = Path(source)
    if path.suffix != ".toml" and not path.is_file():
        path = SHIPPED / f"{source}.toml"
        if not path.is_file():
            near = difflib.get_close_matches(source, shipped(), 1)
            hint = f"did you mean {near[0]}?" if near else f"shipped are {', '.join(shipped())}"
            raise SceneError(f"{source}: no scene of that name and no such file; {hint}")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SceneError(f"{path}: not TOML: {error}") from None
    for assignment in overrides:
        override(data, assignment)
    return parse(data, path)


def shipped() -> list[str]:
    """Names of the shipped scenes."""
    return sorted(path.stem for path in SHIPPED.glob("*.toml"))


def parse(data: dict[str, Any], path: Path) -> Scene:
    """Checks a scene given as nested tables.

    Args:
        data: Tables as TOML gives them.
        path: Where they come from: its name is the scene's, and mesh files are relative to it.

    Raises:
        SceneError: One line with file, key and what was expected.
    """
    try:
        scene = Scene.model_validate({**data, "name": path.stem} if "name" not in data else data)
    except ValidationError as error:
        raise SceneError(f"{path.name}: {_first(error, data)}") from None
    mesh = scene.mesh
    if mesh.path is not None and not Path(mesh.path).is_absolute():
        mesh = mesh.model_copy(update={"path": str(path.parent / mesh.path)})
        scene = scene.model_copy(update={"mesh": mesh})
    try:
        _check(scene)
    except SceneError as error:
        raise SceneError(f"{path.name}: {error}") from None
    return scene


def override(data: dict[str, Any], assignment: str) -> None:
    """Applies an assignment `key.key=value`, with a TOML value or a bare word, to nested tables.

    Raises:
        SceneError: If it is no assignment, or a key on the way is not a table.
    """
    key, equals, text = assignment.partition("=")
    names = [part.strip() for part in key.split(".")]
    if not equals or not all(names):
        raise SceneError(f"--set {assignment}: expected key.key=value")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        # A bare word is a string: --set material.name=hencky.
        value = text.strip()
    table = data
    for part in names[:-1]:
        table = table.setdefault(part, {})
        if not isinstance(table, dict):
            raise SceneError(f"--set {assignment}: {part} is not a table")
    table[names[-1]] = value


def _first(error: ValidationError, data: dict[str, Any]) -> str:
    """The first of pydantic's complaints in one line: key = value: what was expected."""
    problems = error.errors(include_url=False)
    # Of a union, the branch that got furthest says most.
    problem = max(problems, key=lambda p: len(p["loc"])) if _is_union(problems) else problems[0]
    location = [str(part) for part in problem["loc"] if _in_data(part)]
    key = ".".join(location) or "scene"
    kind, given = problem["type"], problem["input"]
    if kind == "extra_forbidden":
        return f"{key}: unknown key; {_expected_keys(problem['loc'])}"
    if kind == "missing":
        return f"{key}: missing; every scene needs it"
    message = problem["msg"].removeprefix("Value error, ")
    if kind in ("model_type", "dict_type"):
        message = "expected a table of keys"
    shown = "" if isinstance(given, dict) else f" = {given!r}"
    return f"{key}{shown}: {message[:1].lower()}{message[1:]}"


def _is_union(problems: list[Any]) -> bool:
    first = problems[0]["loc"]
    return all(problem["loc"][: len(first) - 1] == first[:-1] for problem in problems) and len(problems) > 1


def _in_data(part: object) -> bool:
    # Names of union branches, such as "list[constrained-float]", are pydantic's own.
    return isinstance(part, int) or (part.isidentifier() and part not in ("float", "int", "str"))  # type: ignore[attr-defined]


def _expected_keys(location: tuple[Any, ...]) -> str:
    model: Any = Scene
    for part in location[:-1]:
        field = getattr(model, "model_fields", {}).get(part)
        if field is None:
            model = Condition if model is Scene or model is dict else model
            continue
        candidates = [field.annotation, *getattr(field.annotation, "__args__", ())]
        model = next((c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel)), dict)
    names = [
        name for name in getattr(model, "model_fields", Condition.model_fields) if name != "name" or model is Material
    ]
    near = difflib.get_close_matches(str(location[-1]), names, 1)
    return f"did you mean {near[0]}?" if near else f"expected one of {', '.join(names)}"


def _check(scene: Scene) -> None:
    """What one key alone cannot tell."""
    mesh, element = scene.mesh, ELEMENTS[scene.element]
    if mesh.shape == "file" and mesh.path is None:
        raise SceneError('mesh.path: missing; shape = "file" needs the path of a .msh file')
    if mesh.shape != "file" and mesh.path is not None:
        raise SceneError(f'mesh.path = {mesh.path!r}: expected shape = "file" with it, got shape = "{mesh.shape}"')
    if mesh.shape != "file" and mesh.refine:
        raise SceneError(f'mesh.refine = {mesh.refine}: expected shape = "file" with it; use cells')
    if mesh.shape == "file" and not Path(mesh.path or "").is_file():
        raise SceneError(f"mesh.path = {mesh.path!r}: no such file")
    if mesh.shape != "file" and scene.cell not in element.cells:
        raise SceneError(
            f'solve.element = "{scene.element}": lives on {" or ".join(element.cells)}, got mesh.cell = "{scene.cell}"'
        )
    _check_conditions(scene)
    energy = material_energy(scene)
    _check_start(scene, energy)
    for key, value, only in _unmixed(scene):
        if element.pressure is not None and value != only:
            raise SceneError(f'{key} = {value!r}: not for mixed elements, got solve.element = "{scene.element}"')
    if scene.material.extension is not None and not energy.objective:
        raise SceneError(f"material.extension: {energy.name} has no singularity to continue")
    if scene.material.extension is not None and scene.solve.assembly == "ufl":
        raise SceneError('material.extension: expected solve.assembly = "auto" or "spectral" with it, got "ufl"')
    if mesh.shape != "file":
        try:
            arguments = mesh_arguments(scene)
            arguments.pop("path")
            arguments.pop("refine")
            make_plan(**arguments)
        except GeometryError as error:
            raise SceneError(f"mesh: {error}") from None


def _check_conditions(scene: Scene) -> None:
    dimension = scene.mesh.dimension
    known = face_names(scene.mesh.shape) if dimension else None
    for face, condition in scene.boundary.items():
        if known is not None and face not in known:
            raise SceneError(f"boundary.{face}: unknown face; a {scene.mesh.shape} has {', '.join(known)}")
        value = getattr(condition, condition.kind)
        if dimension and isinstance(value, list) and condition.kind != "roller" and len(value) != dimension:
            raise SceneError(f"boundary.{face}.{condition.kind} = {value}: expected {dimension} components")
        if condition.kind == "roller" and dimension == 2 and "z" in value:
            raise SceneError(f"boundary.{face}.roller = {value}: expected axes x or y in 2D")
        if condition.kind == "rotate" and not any(value.axis):
            raise SceneError(f"boundary.{face}.rotate.axis = {value.axis}: expected a vector other than zero")
    if dimension and scene.body and len(scene.body.force) != dimension:
        raise SceneError(f"body.force = {scene.body.force}: expected {dimension} components")
    pinned = scene.start is not None and bool(scene.start.pins)
    if not pinned and not any(condition.holds for condition in scene.boundary.values()):
        raise SceneError("boundary: nothing holds the body; expected fix, move, rotate or roller on some face")
    loaded = scene.body is not None and any(scene.body.force)
    if scene.start is None and not loaded and not any(condition.loads for condition in scene.boundary.values()):
        raise SceneError("boundary: nothing loads the body; expected move, rotate, pull or pressure on some face")


def _check_start(scene: Scene, energy: Any) -> None:
    start = scene.start
    if start is None:
        return
    for pin in start.pins:
        if scene.mesh.dimension and len(pin) != scene.mesh.dimension:
            raise SceneError(f"start.pins: expected points of {scene.mesh.dimension} coordinates, got {pin}")
    if scene.mesh.dimension == 2 and start.axis == "z":
        raise SceneError('start.axis = "z": expected x or y in 2D')
    if ELEMENTS[scene.element].pressure is not None:
        raise SceneError(f'start: not for mixed elements, got solve.element = "{scene.element}"')
    if not energy.inverts and scene.material.extension is None:
        raise SceneError(f"start.shape: {energy.name} is undefined for J <= 0; give material.extension, e.g. 0.25")


def material_energy(scene: Scene) -> Any:
    """The scene's energy, calibrated and tuned.

    Raises:
        SceneError: If the material cannot be what the scene asks for.
    """
    try:
        mixed = ELEMENTS[scene.element].pressure is not None
        energy = tuned_energy(**scene.material.model_dump(exclude={"extension"}), mixed=mixed)
        if mixed:
            split(energy)
        return energy
    except MaterialError as error:
        raise SceneError(f"material: {error}") from None


def _unmixed(scene: Scene) -> tuple[tuple[str, Any, Any], ...]:
    """Keys that mixed elements know one value of: key, the scene's value, and that one."""
    return (
        ("material.extension", scene.material.extension, None),
        ("solve.filter", scene.solve.filter, "auto"),
        ("solve.method", scene.solve.method, "line-search"),
    )


def _near_incompressible(scene: Scene) -> bool:
    """Whether "auto" is to take a mixed element: never where one would be refused."""
    if scene.start is not None or any(value != only for _, value, only in _unmixed(scene)):
        return False
    try:
        energy = tuned_energy(**scene.material.model_dump(exclude={"extension"}), mixed=True)
        split(energy)
    except MaterialError:
        return False
    return linearize(energy).poissons_ratio >= MIXED_FROM


def mesh_arguments(scene: Scene) -> dict[str, Any]:
    """The arguments of `geometry.build` but the communicator."""
    return {**scene.mesh.model_dump(), "cell": scene.cell}
