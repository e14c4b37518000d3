"""Fields at the quadrature points of cells."""

import math
from typing import Any

import basix
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import Mesh
from numpy.typing import NDArray

Array = NDArray[np.float64]
Cells = NDArray[np.int32]


class Points:
    """The quadrature points of a mesh, cell by cell in the order of a quadrature element's values.

    Every method takes some cells of this rank, none or all that it owns by default, and returns one row a point.

    Attributes:
        mesh: The body at rest.
        owned: Cells that this rank owns.
        count: Points of a cell.
    """

    def __init__(self, mesh: Mesh, degree: int) -> None:
        """The rule that forms use at this degree."""
        self.mesh = mesh
        self._points, self._weights = basix.make_quadrature(mesh.basix_cell(), degree)
        self._compiled: dict[Any, fem.Expression] = {}
        cells = mesh.topology.index_map(mesh.topology.dim)
        self.owned = np.arange(cells.size_local, dtype=np.int32)
        self.all = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
        self.count = len(self._weights)

    def evaluate(self, expression: Any, cells: Cells | None = None) -> Array:
        """A UFL expression, shape (points, components)."""
        cells = self.owned if cells is None else cells
        if expression not in self._compiled:
            self._compiled[expression] = fem.Expression(expression, self._points, comm=self.mesh.comm)
        values = np.asarray(self._compiled[expression].eval(self.mesh, cells))
        return values.reshape(len(cells) * self.count, math.prod(expression.ufl_shape))

    def coordinates(self, cells: Cells | None = None) -> Array:
        """Places at rest, shape (points, 3)."""
        return _padded(self.evaluate(ufl.SpatialCoordinate(self.mesh), cells))

    def volumes(self, cells: Cells | None = None) -> Array:
        """The volume at rest that a point stands for, shape (points,)."""
        jacobian = abs(self.evaluate(ufl.JacobianDeterminant(self.mesh), cells)[:, 0])
        return jacobian * np.tile(self._weights, len(jacobian) // self.count)

    def values(self, u: fem.Function, cells: Cells | None = None) -> Array:
        """A vector field, shape (points, 3)."""
        return _padded(self.evaluate(u, cells))

    def gradient(self, u: fem.Function, cells: Cells | None = None) -> Array:
        """F - I of a displacement, shape (points, 3, 3); zero along the third axis in plane strain."""
        d = self.mesh.geometry.dim
        values = self.evaluate(ufl.grad(u), cells)
        H = np.zeros((len(values), 3, 3))
        H[:, :d, :d] = values.reshape(-1, d, d)
        return H


def _padded(values: Array) -> Array:
    padded = np.zeros((len(values), 3))
    padded[:, : values.shape[1]] = values
    return padded
