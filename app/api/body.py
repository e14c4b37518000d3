"""Bodies in Python: any mesh with named faces, a material, and what happens to the faces."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from elastune.app.api.material import Material
from elastune.app.body.body import Body
from elastune.app.body.conditions.loads import BodyForce, Spring
from elastune.app.body.conditions.motions import Motion
from elastune.app.body.conditions.places import Everywhere, Face
from elastune.app.body.conditions.stages import Given, staged
from elastune.app.body.regions.solids import Solid, Solids
from elastune.app.errors import UserError
from elastune.forms.elements import ELEMENTS, MIXED_FROM, choose
from elastune.forms.energy import MaterialError
from elastune.forms.volumetric import split
from elastune.geometry import Geometry


def body(
    geometry: Geometry,
    material: Material | Mapping[Any, Material],
    conditions: Given,
    *,
    element: str = "auto",
    force: BodyForce | None = None,
    stages: Sequence[Given] = (),
) -> Body:
    """A body at rest, which `elastune.solve` takes.

    Args:
        geometry: Mesh and named faces: of `elastune.geometry.build(comm, ...)`, or around any dolfinx mesh,
            `elastune.Geometry(mesh, facet_tags, {"left": 1, "right": 2})`; with regions,
            `elastune.Geometry(mesh, facet_tags, faces, cell_tags, {"soft": 1, "hard": 2})`.
        material: Its energy; or that of each region by name, and by None that of all other cells.
        conditions: What happens, one condition or several by name of a face, or by place: `elastune.Point("tip", at)`,
            `elastune.Curve(name)`; what has none is free.
        element: Name of an element that lives on the mesh's cells; chosen by material and mesh unless given.
        force: Load on the volume.
        stages: What is other at the ends of stages that follow; `elastune.solve` then takes `steps`.

    Raises:
        UserError: If mesh, faces, conditions and element do not go together.
        MaterialError: If the element cannot take the material.
    """
    mesh = geometry.mesh
    faces, cell = mesh.topology.dim - 1, mesh.topology.cell_name()
    if mesh.geometry.dim != mesh.topology.dim or mesh.geometry.dim not in (2, 3):
        raise UserError(f"mesh: expected one of 2 or 3 dimensions, got {mesh.topology.dim} in {mesh.geometry.dim}")
    if geometry.facet_tags.dim != faces:
        raise UserError(f"facet_tags: expected tags of facets, of dimension {faces}, got {geometry.facet_tags.dim}")
    materials: dict[Any, Material] = {None: material} if isinstance(material, Material) else dict(material)
    if not materials:
        raise UserError("material: expected one, or one a region, got none")
    name = _chosen(materials.values(), cell, geometry.cells_count) if element == "auto" else element
    if name not in ELEMENTS or cell not in ELEMENTS[name].cells:
        fitting = [key for key, kind in ELEMENTS.items() if cell in kind.cells]
        raise UserError(f'element = "{name}": expected one of {", ".join(fitting)} on {cell} cells')
    for each in materials.values():
        if each.energy.incompressible and ELEMENTS[name].pressure is None:
            raise MaterialError(f"{each.energy.name}: nu = 0.5 needs a mixed element, got {name}")
    (first,) = staged(conditions)
    if not any(isinstance(condition, Motion | Spring) for several in first.values() for condition in several):
        raise UserError(
            "conditions: nothing holds the body; expected Clamp, Translation, Rotation or Roller on some face"
        )
    for place in first:
        face = place.name
        if isinstance(place, Face) and face in geometry.faces and not mesh.comm.allreduce(len(geometry.facets(face))):
            raise UserError(f"faces: {face!r}: no facet has its tag, {geometry.faces[face]}")
    # A mesh that another program made may know its facets only.
    mesh.topology.create_connectivity(faces, faces + 1)
    whole = first if force is None else first | {Everywhere(): (force,)}
    solids: Solids = {region: Solid(each.energy) for region, each in materials.items()}
    return Body(geometry, solids, name, whole, stages=stages)


def _chosen(materials: Collection[Material], cell: str, cells: int) -> str:
    """The element that reaches a given error in the least time; a mixed one only where it can be."""
    mixed = any(material.nu >= MIXED_FROM for material in materials)
    try:
        for material in materials:
            split(material.energy)
    except MaterialError:
        mixed = False
    return choose(cell, mixed, cells).element
