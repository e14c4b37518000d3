"""Vectors of a body's unknowns, and the states that they describe."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import count
from typing import Any

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

Array = NDArray[np.float64]

_stamps: Iterator[int] = count()


@dataclass(frozen=True)
class State:
    """The unknowns of a body at a load; never changed, so that what was computed of it stays true.

    Attributes:
        values: A vector, see `Layout`.
        load: The load factor.
        stamp: Tells states apart.
    """

    values: Array
    load: float = 0.0
    stamp: int = field(default_factory=_stamps.__next__, compare=False)

    def __post_init__(self) -> None:
        self.values.flags.writeable = False


class Layout:
    """The vectors of a body: displacements, then pressures, of the nodes that this rank owns.

    Only mixed elements have pressures.

    Attributes:
        displacements: Number of displacements of this rank.
        pressures: Number of pressures of this rank.
        size: Number of unknowns of all ranks.
        dimension: Components of a displacement.
    """

    def __init__(self, u: fem.Function, p: fem.Function | None) -> None:
        """Of the spaces of two fields."""
        dofs = u.function_space.dofmap
        self.comm, self.dimension = u.function_space.mesh.comm, dofs.index_map_bs
        self.displacements = dofs.index_map.size_local * self.dimension
        self.size = dofs.index_map.size_global * self.dimension
        self.pressures, self.total_pressures = 0, 0
        if p is not None:
            dofs = p.function_space.dofmap
            self.pressures, self.total_pressures = dofs.index_map.size_local, dofs.index_map.size_global
            self.size += self.total_pressures

    @cached_property
    def owned(self) -> int:
        """Number of unknowns of this rank."""
        return self.displacements + self.pressures

    def joined(self, displacements: Array, pressures: Array | None = None) -> Array:
        """A new vector of displacements and pressures, whose ghosts are left out; zero pressures unless given."""
        vector = np.zeros(self.owned, dtype=displacements.dtype)
        vector[: self.displacements] = displacements[: self.displacements]
        if pressures is not None:
            vector[self.displacements :] = pressures[: self.pressures]
        return vector

    def split(self, vector: Array) -> tuple[Array, Array]:
        """Views of the displacements and of the pressures of a vector."""
        return vector[: self.displacements], vector[self.displacements :]

    def nodal(self, vector: Array) -> Array:
        """A view of the displacements by node, shape (nodes, d)."""
        return vector[: self.displacements].reshape(-1, self.dimension)

    def total(self, own: Any) -> float:
        """Sum of a number over all ranks."""
        return self.comm.allreduce(float(own))

    def dot(self, a: Array, b: Array) -> float:
        """Inner product over all ranks."""
        return self.total(a @ b)

    def norm(self, vector: Array) -> float:
        """Euclidean norm over all ranks."""
        return float(np.sqrt(self.dot(vector, vector)))
