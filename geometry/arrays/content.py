"""What a mesh holds, in plain arrays on rank 0, before dolfinx distributes it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

KINDS = {0: "points", 1: "curves", 2: "surfaces", 3: "volumes"}


@dataclass(frozen=True)
class Group:
    """Elements of one dimension that belong together.

    Attributes:
        dim: Their dimension.
        number: Of the physical group, or of the geometric entity; 0 for none.
        name: Empty for a group without one.
        entities: Of the gmsh model, which hold the elements.
        physical: Whether the file groups them; if not, they lie on one geometric entity.
    """

    dim: int
    number: int
    name: str
    entities: tuple[int, ...]
    physical: bool = True


@dataclass(frozen=True)
class Name:
    """A group by the name that people reach it by.

    Attributes:
        number: Positive, unlike those of the other names of its dimension.
        pieces: Values of `Elements.pieces` that it has.
        count: Number of its elements.
        exact: Whether all of them are to be facets of cells: those of a face that the file names.
    """

    number: int
    pieces: tuple[int, ...]
    count: int
    exact: bool


@dataclass(frozen=True)
class Elements:
    """The elements of one dimension that have names.

    Attributes:
        corners: Nodes, shape (n, k).
        pieces: Of each, shape (n,); elements of one piece have the same names.
        names: What they are called.
    """

    corners: NDArray[np.int64]
    pieces: NDArray[np.int32]
    names: dict[str, Name]


@dataclass(frozen=True)
class Content:
    """A mesh of cells of one type.

    Attributes:
        dim: Dimension of cells and space.
        cell: dolfinx's name of their type.
        degree: Of their geometry.
        points: Places of the nodes, shape (n, dim).
        cells: Nodes of the cells in dolfinx's order, shape (m, k).
        elements: Those with names, by dimension.
    """

    dim: int
    cell: str
    degree: int
    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    elements: dict[int, Elements]
