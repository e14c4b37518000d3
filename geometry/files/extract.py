"""From a meshed gmsh model to plain arrays."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from elastune.geometry.compat import gmsh_order
from elastune.geometry.errors import GeometryError
from elastune.geometry.files.content import KINDS, Content, Elements, Group, Name
from elastune.geometry.files.family import SAVE_ALL, Family, cell_type
from elastune.geometry.files.naming import names_of
from elastune.geometry.files.reduce import to_second_order
from elastune.geometry.pieces import pieces

Index = NDArray[np.int64]


def extract(
    model: Any, path: str | PathLike[str], dim: int, groups: Sequence[Group], asked: dict[int, dict[str, int]]
) -> Content:
    """Take cells, and the elements that have names, out of a model.

    Args:
        model: A `gmsh.model` with a mesh.
        path: Where it comes from, for messages.
        dim: Dimension of the cells.
        groups: Of its elements.
        asked: Further names, by dimension: of the groups, or else the entities, of these numbers.

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
        logging.getLogger("elastune").info("%s: cells %s become those of second order", path, name)

    if dim == 2 and np.ptp(points[:, 2]) > 1e-9 * np.ptp(points, axis=0).max():
        raise GeometryError(f"{path}: expected volume cells; got surface cells, not flat in z {SAVE_ALL}")

    elements = {}
    for each in range(dim + 1):
        known = names_of(path, each, [group for group in groups if group.dim == each], asked.get(each, {}))
        if known:
            elements[each] = _named(model, path, each, family, known, tags, rows)
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


def _named(
    model: Any,
    path: str | PathLike[str],
    dim: int,
    family: Family,
    known: dict[str, tuple[int, Group]],
    tags: Index,
    rows: Index,
) -> Elements:
    """The elements of the named groups, each once, in pieces."""
    width = family.corners if dim == family.dim else family.facet if dim == family.dim - 1 else dim + 1
    every: dict[int, Index] = {}
    for name, (_, group) in known.items():
        for entity in group.entities:
            if entity not in every:
                every[entity] = _corners(model, path, dim, entity, width, tags, rows, name if _exact(group, dim) else "")
    owners = list(every)
    corners = np.concatenate([np.empty((0, width), dtype=np.int64), *every.values()])
    entity = np.repeat(np.arange(len(owners)), [len(every[owner]) for owner in owners])
    # The same element may lie in several entities, or be there once for each of its groups.
    first, which = _different(corners)
    where = {str(owner): np.unique(which[entity == k]).astype(np.int32) for k, owner in enumerate(owners)}
    members = {
        name: np.unique(np.concatenate([where[str(owner)] for owner in group.entities]))
        for name, (_, group) in known.items()
    }
    members = {name: found for name, found in members.items() if len(found)}
    _, values, tagged = pieces(members, {name: known[name][0] for name in members})
    names = {}
    for name, found in members.items():
        tag = tagged[name]
        number, group = known[name]
        names[name] = Name(number, tag if isinstance(tag, tuple) else (tag,), len(found), _exact(group, dim))
    return Elements(corners[first], values, names)


def _exact(group: Group, dim: int) -> bool:
    return bool(group.name) and group.physical


def _corners(
    model: Any, path: str | PathLike[str], dim: int, entity: int, width: int, tags: Index, rows: Index, name: str
) -> Index:
    """Corners of the elements of an entity that can be parts of cells; a group with a name may have no others."""
    found = [np.empty((0, width), dtype=np.int64)]
    for kind, elements, nodes in zip(*model.mesh.getElements(dim, entity), strict=True):
        title, _, _, count, _, corners = model.mesh.getElementProperties(kind)
        if corners != width:
            if name:
                raise GeometryError(
                    f"{path}: {KINDS[dim][:-1]} group {name!r}: expected elements of {width} corners, parts of the "
                    f"cells; got {title}"
                )
            continue
        of_cells = rows[_places(tags, nodes).reshape(len(elements), count)[:, :width]]
        inside = (of_cells >= 0).all(axis=1)
        if name and not inside.all():
            raise GeometryError(
                f"{path}: {KINDS[dim][:-1]} group {name!r}: expected parts of cells, got nodes of no cell {SAVE_ALL}"
            )
        found.append(of_cells[inside])
    return np.concatenate(found)
