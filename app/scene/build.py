"""From a scene to the body that it describes, and to how it is solved."""

from collections.abc import Callable
from typing import Any

from mpi4py import MPI

from elastune import geometry
from elastune.app.body.body import Body
from elastune.app.body.conditions.loads import BodyForce, Force, Moment, NormalPull, Pressure, Pull, Spring
from elastune.app.body.conditions.motions import Clamp, Condition, Roller, Rotation, Translation
from elastune.app.body.conditions.places import Curve, Everywhere, Face, Pin, Place, Point
from elastune.app.body.regions.solids import Solid
from elastune.app.body.shapes import Start
from elastune.app.errors import SceneError, UserError
from elastune.app.path.steps import Step
from elastune.app.scene import schema
from elastune.app.scene.check import of_mesh
from elastune.app.scene.schema import Scene, energy_of, material_energies, mesh_arguments
from elastune.app.solvers.options import Options
from elastune.forms.elements import ELEMENTS, Choice
from elastune.forms.energy import Energy, MaterialError
from elastune.forms.expressions import Entry, Expression

# Poisson's ratio at which tangled bodies untangle, see `path.recover`.
SOFT = 0.3


def build(scene: Scene, comm: MPI.Comm, **changes: Any) -> tuple[Body, str]:
    """The body of a scene, and why "auto" chose its element, or nothing.

    Args:
        scene: Checked.
        comm: Of the mesh.
        changes: Arguments of `Body` that differ from what the scene says.

    Raises:
        UserError: If the mesh, or the scene on this mesh, is impossible.
    """
    try:
        solids = _solids(scene)
        mesh = geometry.build(comm, **mesh_arguments(scene))
        choice = _element(scene, mesh.mesh.topology.cell_name(), mesh.cells_count)
        arguments = _arguments(scene, choice.element, mesh.mesh.geometry.dim) | changes
        return Body(mesh, solids, choice.element, **arguments), choice.reason
    except geometry.GeometryError as error:
        raise SceneError(f"{scene.name}.toml: {of_mesh(error)}") from None
    except (UserError, MaterialError) as error:
        raise SceneError(f"{scene.name}.toml: {error}") from None


def _arguments(scene: Scene, element: str, dimension: int) -> dict[str, Any]:
    """Those of `Body` beside mesh, solids and element."""
    kind = ELEMENTS[element]
    first, *others = (_stage(end, dimension) for end in scene.ends)
    pins = [] if scene.start is None else scene.start.pins
    return {
        "conditions": first | {Pin(f"pin{k}", tuple(at)): (Clamp(),) for k, at in enumerate(pins, start=1)},
        "stages": others,
        "free": scene.solve.free,
        # A rule for the state at rest may not see cells that are folded within.
        "quadrature": scene.solve.quadrature or (kind.tangled_quadrature if scene.start else kind.quadrature),
        "assembly": scene.solve.assembly,
    }


def options(scene: Scene) -> Options:
    """How a scene is solved."""
    return Options(**{name: getattr(scene.solve, name) for name in Options.__dataclass_fields__ if name != "prefix"})


def start(scene: Scene) -> Start | None:
    """The shape that a scene sets out from, None for the body at rest."""
    given = scene.start
    return None if given is None else Start(given.shape, given.seed, given.volume, "xyz".index(given.axis))


def steps(scene: Scene) -> list[Step]:
    """The parts of the load path."""
    return [
        Step(float(k), k + 1.0, end.steps or scene.solve.steps, end.name or (f"stage {k + 1}" if scene.stage else ""))
        for k, end in enumerate(scene.ends)
    ]


def _stage(end: schema.End, dimension: int) -> dict[Place, tuple[Condition, ...]]:
    """What there is at the end of a stage."""
    found = {_place(*place, given): conditions(given, dimension) for place, given in end.places.items()}
    if end.force is not None:
        found[Everywhere()] = (BodyForce(entries(end.force.force)),)
    return found


def _place(group: str, name: str, given: schema.Motions) -> Place:
    if isinstance(given, schema.Point):
        return Point(name, None if given.at is None else tuple(given.at))
    return Curve(name) if group == "curve" else Face(name)


# What a scene says of a place, by key; of the value, and of the number of axes.
_CONDITIONS: dict[str, Callable[[Any, int], Condition]] = {
    "fix": lambda value, d: Clamp(),
    "move": lambda value, d: Translation(_components(value, d)),
    "rotate": lambda value, d: Rotation(tuple(value.axis), tuple(value.center), value.angle),
    "roller": lambda value, d: Roller(tuple("xyz".index(axis) for axis in value)),
    "pull": lambda value, d: Pull(entries(value)) if isinstance(value, list) else NormalPull(entry(value.normal)),
    "pressure": lambda value, d: Pressure(value),
    "moment": lambda value, d: Moment(value.value, tuple(value.axis), tuple(value.center)),
    "spring": lambda value, d: Spring(_each(value.stiffness, d)),
    "force": lambda value, d: Force(tuple(value)),
}


def conditions(given: schema.Motions, dimension: int) -> tuple[Condition, ...]:
    """What happens at a place."""
    return tuple(_CONDITIONS[kind](getattr(given, kind), dimension) for kind in given.kinds)


def _components(value: Any, dimension: int) -> tuple[Entry | None, ...]:
    if isinstance(value, list):
        return entries(value)
    if dimension == 2 and value.z is not None:
        raise SceneError("move.z: expected x or y in 2D")
    return tuple(None if (given := getattr(value, axis)) is None else entry(given) for axis in "xyz"[:dimension])


def _each(value: float | list[float], dimension: int) -> tuple[float, ...]:
    return tuple(value) if isinstance(value, list) else (value,) * dimension


def entry(value: float | str) -> Entry:
    """A number, or an expression."""
    return Expression(value) if isinstance(value, str) else value


def entries(values: list[float | str]) -> tuple[Entry, ...]:
    """Numbers and expressions."""
    return tuple(map(entry, values))


def _element(scene: Scene, cell: str, cells: int) -> Choice:
    """Element, checked against the cell type that the mesh turned out to have."""
    if scene.solve.element == "auto":
        return scene.chosen(cell, cells)
    name = scene.solve.element
    if cell not in ELEMENTS[name].cells:
        lives = " or ".join(ELEMENTS[name].cells)
        raise SceneError(f'solve.element = "{name}": lives on {lives}, got a mesh of {cell} cells')
    return Choice(name, "")


def _solids(scene: Scene) -> dict[str | None, Solid]:
    """What the body is made of, by region."""
    solids = {}
    for region, energy in material_energies(scene).items():
        material = scene.materials[region]
        solids[region] = Solid(energy, material.extension, None if scene.start is None else _softened(material))
    return solids


def _softened(material: schema.Material) -> Energy | None:
    """The material with another ν, where that helps."""
    if material.nu is None or material.nu <= SOFT:
        return None
    return energy_of(material.model_copy(update={"nu": SOFT}), mixed=False)
