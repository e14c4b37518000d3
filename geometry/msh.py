"""The user's own mesh: a Gmsh `.msh` file read on rank 0, checked, its physical groups put in order.

dolfinx stops on rank 0 alone when a model does not suit it, and the other ranks wait for ever: what it
expects of a model is checked or made true here.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from elastune.geometry.errors import GeometryError

# gmsh's number of a cell type -> that of its facets. Incomplete cells (20-node hexahedra) are left out.
FACET_TYPES = {2: 1, 9: 8, 3: 1, 10: 8, 4: 2, 11: 9, 5: 3, 12: 10}
# The line a .msh file of any version starts with. gmsh runs any other text as a script, commands and all.
HEADERS = (b"$MeshFormat", b"$Comments", b"$NOD")
KINDS = {1: "curves", 2: "surfaces", 3: "volumes"}


@dataclass(frozen=True)
class Content:
    """What a file holds.

    Attributes:
        dim: Dimension of its cells.
        faces: Tag of each face, by name.
        facets: Number of facets of each face, by name.
        regions: Tag of each named group of cells, by name.
        grouped: Whether the file has groups of cells.
    """

    dim: int
    faces: dict[str, int]
    facets: dict[str, int]
    regions: dict[str, int]
    grouped: bool


@dataclass(frozen=True)
class Group:
    """A physical group: its tag, its name (which may be empty), its entities that have elements."""

    tag: int
    name: str
    entities: list[int]


def load(model: Any, path: str | PathLike[str], order: int, refine: int = 0) -> Content:
    """Read a file into the current gmsh model and keep of its physical groups those that matter.

    Args:
        model: An empty `gmsh.model`.
        path: The file.
        order: Cells of a lower order are raised to this one.
        refine: How often each cell is split into equal parts, 2 along each edge.

    Returns:
        What the file holds; each cell is in exactly one group of the model afterwards.

    Raises:
        GeometryError: The file cannot be read, or holds no mesh of one supported type with named faces.
    """
    _read(Path(path))
    dim = _dimension(model, path)
    given = model.mesh.getElementProperties(model.mesh.getElementTypes(dim)[0])[2]
    if refine and given > 1:
        raise GeometryError(f"{path}: refine = {refine}: expected straight cells, of order 1, got order {given}")
    for _ in range(refine):
        model.mesh.refine()
    if order > given:
        model.mesh.setOrder(order)
    cell_type = _cell_type(model, path, dim)

    cells = _groups(model, path, dim)
    faces = [group for group in _groups(model, path, dim - 1) if group.name]
    if not faces:
        unnamed = len(model.getPhysicalGroups(dim - 1))
        found = f"{unnamed} without a name" if unnamed else "none"
        wanted = f"named physical groups of {KINDS[dim - 1]}, the faces"
        raise GeometryError(f"{path}: expected {wanted}; got {found}")
    facets = _count_facets(model, path, dim, cell_type, faces)

    # dolfinx keeps only the cells of physical groups: the others get one of their own.
    grouped = {entity for group in cells for entity in group.entities}
    rest = _meshed(model, dim, (tag for _, tag in model.getEntities(dim) if tag not in grouped))
    groups = [(dim, group) for group in cells] + [(dim - 1, group) for group in faces]
    if rest:
        groups.append((dim, Group(max([group.tag for group in cells], default=0) + 1, "", rest)))
    model.removePhysicalGroups()
    for group_dim, group in groups:
        model.addPhysicalGroup(group_dim, group.entities, group.tag)
    model.mesh.renumberNodes()
    regions = {group.name: group.tag for group in cells if group.name}
    return Content(dim, {group.name: group.tag for group in faces}, facets, regions, bool(cells))


def _read(path: Path) -> None:
    import gmsh

    if path.suffix.lower() != ".msh":
        raise GeometryError(f"{path}: expected a .msh file (gmsh -3 makes one of a .geo or .step)")
    try:
        with path.open("rb") as file:
            start = file.read(64).lstrip()
    except OSError as error:
        raise GeometryError(f"{path}: expected a readable .msh file, got: {error.strerror}") from error
    if not start.startswith(HEADERS):
        raise GeometryError(f"{path}: expected a .msh file, starting with $MeshFormat; got {start[:20]!r}")
    try:
        gmsh.merge(str(path))
    except Exception as error:  # the only type gmsh raises
        reason = " ".join(str(error).split())
        raise GeometryError(f"{path}: expected a complete .msh file; gmsh stopped with: {reason}") from error


def _dimension(model: Any, path: str | PathLike[str]) -> int:
    if len(model.mesh.getElementTypes(3)):
        return 3
    hint = "(gmsh writes the cells of physical groups only, or all with Mesh.SaveAll = 1)"
    if not len(model.mesh.getElementTypes(2)):
        raise GeometryError(f"{path}: expected volume cells, or surface cells in 2D; got neither {hint}")
    x = model.mesh.getNodes()[1].reshape(-1, 3)
    if np.ptp(x[:, 2]) > 1e-9 * np.ptp(x, axis=0).max():
        raise GeometryError(f"{path}: expected volume cells; got surface cells, not flat in z {hint}")
    return 2


def _cell_type(model: Any, path: str | PathLike[str], dim: int) -> int:
    types = model.mesh.getElementTypes(dim)
    if len(types) != 1 or types[0] not in FACET_TYPES:
        supported = "tetrahedra or hexahedra" if dim == 3 else "triangles or quadrilaterals"
        names = ", ".join(model.mesh.getElementProperties(kind)[0] for kind in types)
        raise GeometryError(f"{path}: expected all cells {supported}, complete of order 1 or 2; got {names}")
    return int(types[0])


def _meshed(model: Any, dim: int, entities: Iterable[int]) -> list[int]:
    """Keep the entities that have elements."""
    return [int(tag) for tag in entities if len(model.mesh.getElements(dim, tag)[0])]


def _groups(model: Any, path: str | PathLike[str], dim: int) -> list[Group]:
    """Return the physical groups of one dimension, disjoint, none empty, no name twice."""
    groups: list[Group] = []
    owner: dict[int, str] = {}
    for _, tag in model.getPhysicalGroups(dim):
        name = model.getPhysicalName(dim, tag)
        entities = _meshed(model, dim, model.getEntitiesForPhysicalGroup(dim, tag))
        if name and name in (group.name for group in groups):
            raise GeometryError(f"{path}: expected one physical group {name!r} of {KINDS[dim]}, got two")
        if name and not entities:
            raise GeometryError(f"{path}: expected elements in the physical group {name!r}, got none")
        for entity in entities:
            if entity in owner:
                raise GeometryError(
                    f"{path}: expected disjoint physical groups of {KINDS[dim]}; "
                    f"{owner[entity]} and {name or tag} share number {entity}"
                )
            owner[entity] = name or str(tag)
        if entities:
            groups.append(Group(int(tag), name, entities))
    return groups


def _count_facets(
    model: Any, path: str | PathLike[str], dim: int, cell_type: int, faces: list[Group]
) -> dict[str, int]:
    """Count the facets of each face; refuse elements that no cell can have as a facet."""
    expected = FACET_TYPES[cell_type]
    cell_nodes = np.unique(model.mesh.getElementsByType(cell_type)[1])
    counts: dict[str, int] = {}
    for group in faces:
        counts[group.name] = 0
        for entity in group.entities:
            types, elements, nodes = model.mesh.getElements(dim - 1, entity)
            if list(types) != [expected]:
                want, *got = (model.mesh.getElementProperties(kind)[0] for kind in (expected, *types))
                raise GeometryError(
                    f"{path}: face {group.name!r}: expected elements {want}, the facets of the cells; "
                    f"got {', '.join(got)}"
                )
            if not np.isin(nodes[0], cell_nodes).all():
                raise GeometryError(
                    f"{path}: face {group.name!r}: expected facets of cells, got nodes of no cell "
                    "(gmsh writes the cells of physical groups only, or all with Mesh.SaveAll = 1)"
                )
            counts[group.name] += len(elements[0])
    return counts
