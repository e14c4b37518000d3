"""Reference tables of an element as C: gradients of basis and geometry at quadrature points, and weights."""

from dataclasses import dataclass
from typing import Any

import basix
import numpy as np


@dataclass(frozen=True)
class ElementTables:
    """What the element kernel needs to know of an element.

    Attributes:
        gradients: Reference gradients of the scalar basis, shape (dim, points, dofs).
        geometry: The same of the geometry's basis, shape (dim, points, nodes).
        weights: Quadrature weights, shape (points,).
        affine: Whether the geometry is a simplex of order one.
        linear: Whether the element is.
    """

    gradients: np.ndarray
    geometry: np.ndarray
    weights: np.ndarray
    affine: bool
    linear: bool

    def code(self) -> str:
        """Macros and arrays for kernel/element.c."""
        dim, points, dofs = self.gradients.shape
        lanes, row = lane_count(points), _row(dofs)
        batches, width = -(-points // lanes), -(-dofs // row) * row
        macros = {
            "LANES": lanes,
            "DIM": dim,
            "POINTS": points,
            "BATCHES": batches,
            "DOFS": dofs,
            "NODES": self.geometry.shape[2],
            "ROW": row,
            "WIDTH": width,
            "AFFINE": int(self.affine),
            "LINEAR": int(self.linear),
        }
        weights = np.zeros(batches * lanes)
        weights[:points] = self.weights
        by_dof = np.zeros((points, dim, width))
        by_dof[:, :, :dofs] = self.gradients.transpose(1, 0, 2)
        return "\n".join(
            [
                *(f"#define {name} {value}" for name, value in macros.items()),
                '#include "lanes.h"',
                f"typedef double row __attribute__((vector_size({8 * row})));",
                _array("lanes weights", weights.reshape(batches, lanes), lanes),
                _array("lanes gradient_by_point", _by_point(self.gradients, lanes), lanes),
                _array("lanes geometry_by_point", _by_point(self.geometry, lanes), lanes),
                _array("row gradient_by_dof", by_dof.reshape(points, dim, width // row, row), row),
            ]
        )


def element_tables(V: Any, quadrature_degree: int) -> ElementTables:
    """Tables of a space's element on its mesh, for the quadrature that FFCx takes for that degree."""
    mesh = V.mesh
    cell = getattr(basix.CellType, mesh.basix_cell().name)
    points, weights = basix.make_quadrature(cell, quadrature_degree)
    domain = mesh.ufl_domain()
    geometry = _gradients(domain.ufl_coordinate_element(), points)
    simplex = cell in (basix.CellType.triangle, basix.CellType.tetrahedron)
    affine, linear = (
        simplex and element.embedded_superdegree == 1 for element in (domain.ufl_coordinate_element(), V.ufl_element())
    )
    return ElementTables(_gradients(V.ufl_element(), points), geometry, weights, affine, linear)


def default_quadrature_degree(V: Any) -> int:
    """Exact for the volume of an affine simplex's tangent at constant F, and full integration on tensor cells."""
    order = int(V.ufl_element().basix_element.degree)
    simplex = V.mesh.basix_cell().name in ("triangle", "tetrahedron")
    return max(2 * (order - 1), 1) if simplex else 2 * order


def lane_count(points: int) -> int:
    """Points side by side: no more than there are, and no more than a vector register of today holds."""
    return 1 if points == 1 else 2 if points == 2 else 4 if points <= 4 else 8


def _row(dofs: int) -> int:
    """Basis functions side by side: eight unless four waste less."""
    return 8 if -(-dofs // 8) * 8 <= -(-dofs // 4) * 4 else 4


def _gradients(element: Any, points: np.ndarray) -> np.ndarray:
    scalar = element.sub_elements[0]
    return np.asarray(scalar.tabulate(1, points))[1:]


def _by_point(table: np.ndarray, lanes: int) -> np.ndarray:
    """From (dim, points, functions) to (batches, dim, functions, lanes); the last point fills the last batch."""
    dim, points, functions = table.shape
    batches = -(-points // lanes)
    padded = table[:, np.minimum(np.arange(batches * lanes), points - 1)]
    return padded.reshape(dim, batches, lanes, functions).transpose(1, 0, 3, 2)


def _array(declaration: str, values: np.ndarray, vector: int) -> str:
    """A constant C array; its last axis is one SIMD vector, or a scalar."""
    shape = values.shape[:-1]

    def braces(part: np.ndarray) -> str:
        if part.ndim == 0:
            return float(part).hex()
        if part.ndim == 1 and vector == 1 and part.shape == (1,):
            return float(part[0]).hex()
        return "{" + ", ".join(braces(entry) for entry in part) + "}"

    dimensions = "".join(f"[{n}]" for n in shape)
    return f"static const {declaration}{dimensions} = {braces(values)};"
