"""From a meshed gmsh model to plain arrays."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from elastune.geometry.arrays.content import Content, Elements, Group, Name
from elastune.geometry.arrays.family import SAVE_ALL, Family, cell_type
from elastune.geometry.arrays.naming import names_of
from elastune.geometry.arrays.reduce import to_second_order
from elastune.geometry.compat import gmsh_order
from elastune.geometry.errors import GeometryError
from elastune.geometry.pieces import pieces

Index = NDArray[np.int64]

# Whose selectors may ask for groups by number: those of cells, and of facets.
_TABLES = ("regions", "faces")


def extract(
    model: Any, path: str | PathLike[str], dim: int, groups: Sequence[Group], asked: Mapping[int, Mapping[str, int]]
) -> Content:
    """Take cells, and the elements that have names, out of a model.

    Args:
        model: A `gmsh.model` with a mesh.
        path: Where it comes from, for messages.
        dim: Dimension of the cells.
        groups: Of its elements.
        asked: Further names, by codimension: of the groups, or else the entities, of these numbers.

    Raises:
        GeometryError: The cells are of no one supported type, or the elements of a named face are no facets.
    """
    kind, family = cell_type(model, path, dim)
    tags, places, _ = model.mesh.getNodes()
    order = np.argsort(tags)
    tags, points = np.asarray(tags)[order], np.reshape(places, (-1, 3))[order]

    entities = [entity for _, entity in model.getEntities(dim)]
    cells = _nodes(model, dim, entities, tags)
    # A file may hold a cell once for each of its groups.
    cells = cells[np.sort(_different(cells)[0])]
    # Only the nodes of cells are kept.
    rows = np.full(len(points), -1, dtype=np.int64)
    if kind in (family.first, family.second):
        used = np.unique(cells)
        rows[used] = np.arange(len(used))
        points, cells = points[used], rows[cells]
    else:
        corners = cells[:, : family.corners]
        name = model.mesh.getElementProperties(kind)[0]
        kind, points, cells = to_second_order(model, kind, family, points, cells)
        rows[corners] = cells[:, : family.corners]
        logging.getLogger("elastune").warning("%s: cells %s become those of second order", path, name)

    if dim == 2 and np.ptp(points[:, 2]) > 1e-9 * np.ptp(points, axis=0).max():
        raise GeometryError(f"{path}: expected volume cells; got surface cells, not flat in z {SAVE_ALL}")

    source, elements = _Source(model, path, family, tags, rows), {}
    for each in range(dim + 1):
        own = [group for group in groups if group.dim == each]
        known = names_of(path, each, own, asked.get(dim - each, {}), _TABLES[dim - each] if dim - each < 2 else "")
        if known:
            elements[each] = source.named(each, known)
    return Content(
        dim,
        family.cell,
        1 if kind == family.first else 2,
        np.ascontiguousarray(points[:, :dim]),
        cells[:, gmsh_order(family.cell, cells.shape[1])],
        {each: found for each, found in elements.items() if found.names},
    )


def _nodes(model: Any, dim: int, entities: Sequence[int], tags: Index) -> Index:
    """Nodes of the elements of entities, all of one type, as places in `tags`."""
    found = []
    for entity in entities:
        for _, elements, nodes in zip(*model.mesh.getElements(dim, entity), strict=True):
            found.append(_places(tags, nodes).reshape(len(elements), -1))
    return np.concatenate(found)


def _places(tags: Index, nodes: Index) -> Index:
    """Places of nodes in the ascending tags."""
    return np.searchsorted(tags, nodes).astype(np.int64)


def _different(elements: Index) -> tuple[Index, Index]:
    """The first of each set of elements with the same nodes, and for each element the place of its first there."""
    # Sums of numbers at random that are all different tell at once, and surely, that no two elements are the same.
    numbers = np.random.default_rng(0).integers(0, 2**63, elements.max(initial=0) + 1, dtype=np.uint64)
    if len(np.unique(numbers[elements].sum(axis=1))) == len(elements):
        return np.arange(len(elements)), np.arange(len(elements))
    _, first, which = np.unique(np.sort(elements, axis=1), axis=0, return_index=True, return_inverse=True)
    return first, which.ravel()


@dataclass(frozen=True)
class _Source:
    """Where the elements of a dimension come from: a model, and the rows of its nodes among those of the cells."""

    model: Any
    path: str | PathLike[str]
    family: Family
    tags: Index
    rows: Index

    def named(self, dim: int, known: dict[str, tuple[int, Group]]) -> Elements:
        """The elements of groups with names, each once, in pieces.

        Raises:
            GeometryError: A face that the file names has elements that cannot be facets.
        """
        every: dict[int, Index] = {}
        lost: dict[int, str] = {}
        for entity in {entity: None for _, group in known.values() for entity in group.entities}:
            every[entity], lost[entity] = self._parts(dim, entity)
        exact = {
            name: dim == self.family.dim - 1 and group.physical and bool(group.name)
            for name, (_, group) in known.items()
        }
        for name, (_, group) in known.items():
            reason = next((lost[entity] for entity in group.entities if lost[entity]), None)
            if exact[name] and reason:
                raise GeometryError(f"{self.path}: face {name!r}: expected facets of cells, got {reason}")
        owners = list(every)
        corners = np.concatenate(list(every.values()))
        places = np.repeat(np.arange(len(owners)), [len(every[owner]) for owner in owners])
        # The same element may lie in several entities, or be there once for each of its groups.
        first, which = _different(corners)
        where = {owner: np.unique(which[places == k]).astype(np.int32) for k, owner in enumerate(owners)}
        members = {
            name: np.unique(np.concatenate([where[owner] for owner in group.entities]))
            for name, (_, group) in known.items()
            if group.entities
        }
        members = {name: found for name, found in members.items() if len(found)}
        _, values, tagged = pieces(members, {name: known[name][0] for name in members})
        names = {}
        for name, found in members.items():
            tag = tagged[name]
            names[name] = Name(known[name][0], tag if isinstance(tag, tuple) else (tag,), len(found), exact[name])
        return Elements(corners[first], values, names)

    def _parts(self, dim: int, entity: int) -> tuple[Index, str]:
        """Corners of the elements of an entity that can be parts of cells; why others cannot."""
        family = self.family
        width = {family.dim: family.corners, family.dim - 1: family.facet}.get(dim, dim + 1)
        found: list[Index] = [np.empty((0, width), dtype=np.int64)]
        lost = ""
        for kind, elements, nodes in zip(*self.model.mesh.getElements(dim, entity), strict=True):
            title, *_, corners = self.model.mesh.getElementProperties(kind)
            if corners != width:
                lost = f"elements {title} on {family.cell} cells"
                continue
            of_cells = self.rows[_places(self.tags, nodes).reshape(len(elements), -1)[:, :width]]
            inside = (of_cells >= 0).all(axis=1)
            if not inside.all():
                lost = f"nodes of no cell {SAVE_ALL}"
            found.append(of_cells[inside])
        return np.concatenate(found), lost
