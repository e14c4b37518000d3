"""Function spaces of the elements on a mesh."""

from typing import Any

import basix
import basix.ufl
import dolfinx
import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from elastune.forms.elements import Element, Pressure
from elastune.forms.torn import torn


def displacement_space(mesh: dolfinx.mesh.Mesh, element: Element) -> fem.FunctionSpace:
    """Vectors, continuous, with as many components as the mesh has dimensions; all values at nodes."""
    shape = (mesh.geometry.dim,)
    if element.bubble:
        return fem.functionspace(mesh, basix.ufl.blocked_element(_with_bubble(mesh.basix_cell()), shape=shape))
    return fem.functionspace(mesh, basix.ufl.element("Lagrange", mesh.basix_cell(), element.degree, shape=shape))


def pressure_space(
    mesh: dolfinx.mesh.Mesh, pressure: Pressure, groups: NDArray[np.int32] | None = None
) -> fem.FunctionSpace:
    """Scalars; on tensor cells the discontinuous ones have total, not coordinate-wise, degree.

    Args:
        mesh: The body at rest.
        pressure: The kind.
        groups: Number of the material of each cell of this rank, owned and ghost, if there are several: where two meet
            the pressure jumps, and continuous ones have a value on each side.
    """
    family = "Lagrange" if pressure.continuous else "DG" if pressure.degree == 0 else "DPC"
    space = fem.functionspace(mesh, basix.ufl.element(family, mesh.basix_cell(), pressure.degree))
    return space if groups is None or not pressure.continuous else torn(space, groups)


def _with_bubble(cell: Any) -> Any:
    """Linear polynomials and the product of the barycentric coordinates, by values at vertices and centre.

    basix's own enriched element has integrals for degrees of freedom, which have no place in the body.
    """
    vertices = basix.geometry(cell)
    d = vertices.shape[1]
    centre = vertices.mean(axis=0, keepdims=True)
    points, weights = basix.make_quadrature(cell, 2 * (d + 1))
    barycentric = np.column_stack([1 - points.sum(axis=1), points])
    functions = np.vstack([barycentric.T, barycentric.prod(axis=1)])
    orthonormal = basix.tabulate_polynomials(basix.PolynomialType.legendre, cell, d + 1, points)
    coefficients = (functions * weights) @ orthonormal.T
    one = np.ones((1, 1, 1, 1))
    nodes: list[list[Any]] = [[] for _ in range(4)]
    values: list[list[Any]] = [[] for _ in range(4)]
    for dimension, entities in enumerate(basix.topology(cell)):
        for i in range(len(entities)):
            at = vertices[i : i + 1] if dimension == 0 else centre if dimension == d else np.zeros((0, d))
            nodes[dimension].append(at)
            values[dimension].append(one if len(at) else np.zeros((0, 1, 0, 1)))
    return basix.ufl.custom_element(
        cell,
        (),
        coefficients,
        nodes,
        values,
        0,
        basix.MapType.identity,
        basix.SobolevSpace.H1,
        False,
        1,
        d + 1,
    )
