"""What one key of a scene alone cannot tell: whether the keys go together."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from elastune.app.errors import SceneError
from elastune.app.scene.check_conditions import check_conditions
from elastune.app.scene.schema import Scene, material_energies, material_key, mesh_arguments, unmixed_keys
from elastune.forms.elements import ELEMENTS
from elastune.geometry import GeometryError
from elastune.geometry.select.asked import selectors
from elastune.geometry.shapes import make_plan


def check(scene: Scene) -> None:
    """Checks a scene before any mesh is built.

    Raises:
        SceneError: One line with key and what was expected.
    """
    mesh, element = scene.mesh, ELEMENTS[scene.element]
    _check_mesh(scene)
    if mesh.shape != "file" and scene.cell not in element.cells:
        raise SceneError(
            f'solve.element = "{scene.element}": lives on {" or ".join(element.cells)}, got mesh.cell = "{scene.cell}"'
        )
    check_conditions(scene)
    if scene.material is None and not scene.region:
        raise SceneError("material: missing; every scene needs it")
    for name, region in scene.region.items():
        if region.material is None and scene.material is None:
            raise SceneError(f"region.{name}.material: missing; there is no [material] that it could be of")
    energies = material_energies(scene)
    _check_start(scene, energies)
    for key, value, only in unmixed_keys(scene):
        if element.pressure is not None and value != only:
            raise SceneError(f'{key} = {value!r}: not for mixed elements, got solve.element = "{scene.element}"')
    for where, material in scene.materials.items():
        key = f"{material_key(where)}.extension"
        if material.extension is not None and not energies[where].objective:
            raise SceneError(f"{key}: {energies[where].name} has no singularity to continue")
        if material.extension is not None and scene.solve.assembly == "ufl":
            raise SceneError(f'{key}: expected solve.assembly = "auto" or "spectral" with it, got "ufl"')


def _check_mesh(scene: Scene) -> None:
    mesh, arguments = scene.mesh, mesh_arguments(scene)
    if mesh.shape == "file" and mesh.path is None:
        raise SceneError('mesh.path: missing; shape = "file" needs the path of a mesh file')
    if mesh.shape != "file" and mesh.path is not None:
        raise SceneError(f'mesh.path = {mesh.path!r}: expected shape = "file" with it, got shape = "{mesh.shape}"')
    if mesh.shape != "file" and mesh.refine:
        raise SceneError(f'mesh.refine = {mesh.refine}: expected shape = "file" with it; use cells')
    if mesh.shape == "file" and not Path(mesh.path or "").is_file():
        raise SceneError(f"mesh.path = {mesh.path!r}: no such file")
    try:
        for table in ("faces", "regions"):
            selectors(table, arguments.pop(table), mesh.dimension)
        if mesh.shape != "file":
            arguments.pop("path")
            arguments.pop("refine")
            make_plan(**arguments)
    except GeometryError as error:
        raise SceneError(of_mesh(error)) from None


def of_mesh(error: GeometryError) -> str:
    """What is wrong with a mesh, after the key where it stands."""
    return f"mesh.{error}" if str(error).startswith(("faces.", "regions.")) else f"mesh: {error}"


def _check_start(scene: Scene, energies: Mapping[str | None, Any]) -> None:
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
    for name, energy in energies.items():
        if not energy.inverts and scene.materials[name].extension is None:
            key = f"{material_key(name)}.extension"
            raise SceneError(f"start.shape: {energy.name} is undefined for J <= 0; give {key}, e.g. 0.25")
