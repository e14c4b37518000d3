"""What one key of a scene alone cannot tell: whether the keys go together."""

from pathlib import Path
from typing import Any

from elastune.app.errors import SceneError, meant
from elastune.app.scene.schema import Scene, material_energy, mesh_arguments, unmixed_keys
from elastune.forms.elements import ELEMENTS
from elastune.geometry import GeometryError, face_names
from elastune.geometry.shapes import make_plan


def check(scene: Scene) -> None:
    """Checks a scene before any mesh is built.

    Raises:
        SceneError: One line with key and what was expected.
    """
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
    for key, value, only in unmixed_keys(scene):
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
            raise SceneError(f"boundary.{face}: unknown face; {meant(face, known, f'a {scene.mesh.shape} has')}")
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
