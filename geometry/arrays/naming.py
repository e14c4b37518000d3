"""What people may call the groups of a file: by name, or by number where there is none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike

from elastune.geometry.arrays.content import KINDS, Group
from elastune.geometry.errors import GeometryError


def names_of(
    path: str | PathLike[str], dim: int, groups: Sequence[Group], asked: Mapping[str, int], table: str
) -> dict[str, tuple[int, Group]]:
    """Names of the groups of one dimension, each with a number of its own.

    A physical group without a name is called by its number, and so is, of faces and regions, a geometric entity that
    lies in no physical group, unless a physical group has this number.

    Args:
        path: For messages.
        dim: Dimension.
        groups: All of this dimension.
        asked: Further names, of the physical groups, or else the entities, of these numbers.
        table: "faces" or "regions", whose entities are called by their numbers; nothing for others.

    Raises:
        GeometryError: Two groups have one name, or no group has a number that is asked for.
    """
    physical = [group for group in groups if group.physical]
    grouped = {entity for group in physical for entity in group.entities}
    numbers = {group.number for group in physical}
    found: dict[str, Group] = {}
    for group in physical:
        name = group.name or str(group.number)
        if name in found:
            raise GeometryError(f"{path}: expected one physical group {name!r} of {KINDS[dim]}, got two")
        found[name] = group
    for group in groups:
        if table and not group.physical and group.number not in numbers and not grouped.issuperset(group.entities):
            found.setdefault(str(group.number), group)

    known: dict[str, tuple[int, Group]] = {}
    taken = {group.number for group in found.values()}
    free = max([0, *taken, *(group.number for group in groups)]) + 1
    for name, group in found.items():
        own = 0 < group.number and group.number not in {number for number, _ in known.values()}
        known[name] = (group.number if own else free, group)
        free += not own
    for name, number in asked.items():
        matching = [group for group in groups if group.number == number]
        if not matching:
            raise GeometryError(_missing(path, dim, f"{table}.{name} = {{tag = {number}}}", groups))
        group = max(matching, key=lambda group: group.physical)
        if name in known and set(known[name][1].entities) != set(group.entities):
            what = f"{table}.{name} = {{tag = {number}}}"
            raise GeometryError(f"{what}: {path} has another {name!r}; expected a name of its own")
        known.setdefault(name, (free, group))
        free += 1
    return known


def _missing(path: str | PathLike[str], dim: int, what: str, groups: Sequence[Group]) -> str:
    numbers = sorted({group.number for group in groups if group.number})
    there = ", ".join(map(str, numbers[:20])) + (", …" if len(numbers) > 20 else "") if numbers else "none"
    return f"{what}: no group of {KINDS[dim]} of {path} has this number; there are {there}"
