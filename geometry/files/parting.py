"""Groups of single elements: gmsh knows groups of whole entities, so elements with the same groups become an entity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elastune.geometry.arrays.content import Group
from elastune.geometry.pieces import pieces

Index = NDArray[np.int64]


class Label(NamedTuple):
    """What `Group` says of a group beside its entities."""

    dim: int
    number: int
    name: str
    physical: bool = True


def part(sets: Mapping[Label, Index], dims: Sequence[int] | Index) -> tuple[NDArray[np.int32], list[Group]]:
    """Part elements into entities.

    Args:
        sets: Places of the elements of each group; elements of one dimension.
        dims: Dimension of each element.

    Returns:
        The entity of each element, from 1 on in each dimension; the groups.
    """
    of_elements = np.asarray(dims)
    entities = np.zeros(len(of_elements), dtype=np.int32)
    groups = []
    for dim in np.unique(of_elements).tolist():
        labels = [label for label in sets if label.dim == dim]
        members = {str(k): np.unique(sets[label]).astype(np.int32) for k, label in enumerate(labels)}
        places, values, tags = pieces(members, {key: int(key) + 1 for key in members})
        entities[places] = values
        rest = (entities == 0) & (of_elements == dim)
        entities[rest] = max(values.max(initial=0), len(labels)) + 1
        for label, tag in zip(labels, tags.values(), strict=True):
            groups.append(
                Group(dim, label.number, label.name, tag if isinstance(tag, tuple) else (tag,), label.physical)
            )
    return entities, groups


class Elements:
    """All elements of a model.

    Attributes:
        numbers: Of the elements.
        dims: Of each, its dimension.
        entities: Of each, its entity.
    """

    def __init__(self, model: Any) -> None:
        """Takes them from the model."""
        self._model = model
        self._blocks: list[tuple[int, NDArray[np.uint64]]] = []
        numbers: list[Any] = []
        dims, entities = [], []
        for dim, entity in model.getEntities():
            for kind, elements, nodes in zip(*model.mesh.getElements(dim, entity), strict=True):
                self._blocks.append((kind, nodes.reshape(len(elements), -1)))
                numbers.append(elements.astype(np.int64))
                dims.append(np.full(len(elements), dim))
                entities.append(np.full(len(elements), entity))
        none = np.empty(0, dtype=np.int64)
        self.numbers = np.concatenate([none, *numbers])
        self.dims, self.entities = np.concatenate([none, *dims]), np.concatenate([none, *entities])

    def regroup(self, sets: Mapping[Label, Index]) -> list[Group]:
        """Make the entities of the model of elements with the same groups, and the same entity before.

        Args:
            sets: Places of the elements of each group in these arrays.

        Returns:
            The groups, and the former entities.
        """
        mesh, former = self._model.mesh, dict(sets)
        for dim, entity in np.unique(np.stack([self.dims, self.entities], axis=1), axis=0).tolist():
            former[Label(dim, entity, "", False)] = np.flatnonzero((self.dims == dim) & (self.entities == entity))
        values, groups = part(former, self.dims)
        nodes, places, _ = mesh.getNodes()
        mesh.clear()
        self._model.removePhysicalGroups()
        self._model.removeEntities(self._model.getEntities(), True)
        start = 0
        for kind, block in self._blocks:
            here = slice(start, start + len(block))
            start += len(block)
            for value in map(int, np.unique(values[here])):
                dim, own = int(self.dims[here.start]), values[here] == value
                if (dim, value) not in self._model.getEntities(dim):
                    self._model.addDiscreteEntity(dim, value)
                    if len(nodes):
                        mesh.addNodes(dim, value, nodes, places)
                        nodes = []
                mesh.addElementsByType(value, kind, self.numbers[here][own], block[own].ravel())
        return groups
