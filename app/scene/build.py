"""From a scene to the body that it describes, and to how it is solved."""

from collections.abc import Callable
from typing import Any

from mpi4py import MPI

from elastune import geometry
from elastune.app.body.body import Body
from elastune.app.body.loads import BodyForce, Pressure, Pull
from elastune.app.body.motions import Clamp, Condition, Roller, Rotation, Translation
from elastune.app.body.regions.solids import Solid
from elastune.app.body.shapes import Start
from elastune.app.errors import SceneError, UserError
from elastune.app.scene import schema
from elastune.app.scene.schema import Scene, energy_of, material_energies, mesh_arguments
from elastune.app.solvers.options import Options
from elastune.forms.elements import ELEMENTS, Choice
from elastune.forms.energy import Energy, MaterialError

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
        return Body(mesh, solids, choice.element, **_arguments(scene, choice.element) | changes), choice.reason
    except geometry.GeometryError as error:
        raise SceneError(f"{scene.name}.toml: mesh: {error}") from None
    except (UserError, MaterialError) as error:
        raise SceneError(f"{scene.name}.toml: {error}") from None


def _arguments(scene: Scene, element: str) -> dict[str, Any]:
    """Those of `Body` beside mesh, solids and element."""
    kind = ELEMENTS[element]
    return {
        "conditions": {face: condition(given) for face, given in scene.boundary.items()},
        "force": None if scene.body is None else BodyForce(tuple(scene.body.force)),
        "pins": [] if scene.start is None else scene.start.pins,
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


# What a scene says of a face, by key.
_CONDITIONS: dict[str, Callable[[Any], Condition]] = {
    "fix": lambda value: Clamp(),
    "move": lambda value: Translation(tuple(value)),
    "rotate": lambda value: Rotation(tuple(value.axis), tuple(value.center), value.angle),
    "roller": lambda value: Roller(tuple("xyz".index(axis) for axis in value)),
    "pull": lambda value: Pull(tuple(value)),
    "pressure": Pressure,
}


def condition(given: schema.Condition) -> Condition:
    """What happens to a face."""
    return _CONDITIONS[given.kind](getattr(given, given.kind))


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
