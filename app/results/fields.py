"""The fields a scene may ask for: displacement at the nodes, everything else one value a cell."""

from collections.abc import Callable, Iterable, Iterator
from functools import cached_property, partial
from typing import Any

import basix
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import entities_to_geometry
from numpy.typing import NDArray

from elastune.forms.elements import ELEMENTS
from elastune.forms.energy import Energy
from elastune.forms.kinematics import GradientMeasures, deformation_gradient
from elastune.forms.spectral import pointwise
from elastune.forms.terms.mixed import mixed_response
from elastune.forms.volumetric import Split

Array = NDArray[Any]

# Points evaluated at once: bounds the memory of the kernel's second derivatives, 81 numbers a point.
BLOCK = 2**15


class Samples:
    """The state at n points; what is derived from it is computed when first asked for.

    Attributes:
        H: Displacement gradients, shape (n, 3, 3).
    """

    def __init__(self, H: Array, respond: Callable[[Array], tuple[Array, Array]]) -> None:
        """Takes the state.

        Args:
            H: Displacement gradients, shape (n, 3, 3).
            respond: ψ, shape (n,), and P, shape (n, 3, 3), from H.
        """
        self.H = H
        self._respond = respond

    @cached_property
    def F(self) -> Array:
        """Deformation gradient, shape (n, 3, 3)."""
        return np.eye(3) + self.H

    @cached_property
    def J(self) -> Array:
        """Volume ratio, shape (n,)."""
        return np.linalg.det(self.F)

    @cached_property
    def response(self) -> tuple[Array, Array]:
        """ψ, shape (n,), and the first Piola-Kirchhoff stress, shape (n, 3, 3)."""
        return self._respond(self.H)

    @cached_property
    def cauchy(self) -> Array:
        """Cauchy stress P Fᵀ / J, shape (n, 3, 3)."""
        return self.response[1] @ self.F.transpose(0, 2, 1) / self.J[:, None, None]


CELL_FIELDS: dict[str, Callable[[Samples], Array]] = {}


def _cell_field(function: Callable[[Samples], Array]) -> Callable[[Samples], Array]:
    CELL_FIELDS[function.__name__] = function
    return function


@_cell_field
def J(at: Samples) -> Array:
    """Volume ratio; the average over a cell is its deformed over its rest volume."""
    return at.J


@_cell_field
def von_mises(at: Samples) -> Array:
    """Von Mises stress of the Cauchy stress."""
    mean = np.trace(at.cauchy, axis1=1, axis2=2) / 3
    deviator = at.cauchy - mean[:, None, None] * np.eye(3)
    return np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))


@_cell_field
def pressure(at: Samples) -> Array:
    """Minus the mean of the Cauchy stress's diagonal."""
    return -np.trace(at.cauchy, axis1=1, axis2=2) / 3


@_cell_field
def stretches(at: Samples) -> Array:
    """Principal stretches, largest first; the last is negative where the cell is inverted."""
    values = np.linalg.svd(at.F, compute_uv=False)
    values[:, 2] = np.copysign(values[:, 2], at.J)
    return values


@_cell_field
def energy(at: Samples) -> Array:
    """Strain energy per rest volume."""
    return at.response[0]


@_cell_field
def stress(at: Samples) -> Array:
    """Cauchy stress, 3 by 3."""
    return at.cauchy


class Fields:
    """Fields of a displacement that changes; every method reads its present values.

    Cell values are averages over the quadrature points, weighted by rest volume. A displacement of another
    degree than the mesh is interpolated to the nodes of the mesh.
    """

    def __init__(
        self,
        u: fem.Function,
        energy: Energy,
        extension: float | None,
        quadrature: int | None,
        mixed: tuple[Split, fem.Function] | None = None,
    ) -> None:
        """Compiles the gradient of u, the only form that all fields share.

        Args:
            u: Displacement, vector Lagrange, 3D or 2D for plane strain.
            energy: Strain-energy density.
            extension: Stretch below which a singular energy is continued.
            quadrature: Degree of the points; the element's own unless given.
            mixed: Of a mixed element, the energy as it sees it and the pressure.
        """
        self._u, self._energy, self._extension = u, energy, extension
        self._mesh = u.function_space.mesh
        self._mixed = mixed
        self._quadrature = quadrature or _quadrature_degree(u)

    # ------------------------------------------------------------------ nodes

    def displacement(self) -> Array:
        """Displacement of the mesh's nodes that this rank owns, shape (n, 3); zero along z in 2D."""
        geometry, nodal = self._mesh.geometry, self._nodal
        if nodal is not self._u:
            nodal.interpolate(self._u)
        values = np.zeros((len(geometry.x), 3))
        at_dofs = nodal.x.array.reshape(-1, geometry.dim)
        values[self._nodes, : geometry.dim] = at_dofs[nodal.function_space.dofmap.list]
        return values[: geometry.index_map().size_local]

    def largest_displacement(self) -> float:
        """Largest displacement of any of u's own nodes on this rank."""
        values = self._u.x.array.reshape(-1, self._mesh.geometry.dim)
        return float(np.sqrt(np.max(np.sum(values**2, axis=1), initial=0.0)))

    @cached_property
    def _nodal(self) -> fem.Function:
        """The displacement in the space of the mesh's coordinates, whose degrees of freedom are its nodes."""
        space = fem.functionspace(self._mesh, self._mesh.ufl_domain().ufl_coordinate_element())
        same = space.element.basix_element == self._u.function_space.element.basix_element
        return self._u if same else fem.Function(space)

    @cached_property
    def _nodes(self) -> Array:
        """Nodes of each cell, ghosts included, in the order of that space."""
        dimension, cells = self._mesh.topology.dim, len(self._nodal.function_space.dofmap.list)
        return entities_to_geometry(self._mesh, dimension, np.arange(cells, dtype=np.int32))

    # ------------------------------------------------------------------ cells

    def cells(self, names: Iterable[str]) -> dict[str, Array]:
        """Averages over the cells that this rank owns, by field.

        Args:
            names: Keys of `CELL_FIELDS`.

        Returns:
            Arrays of shape (cells,), (cells, 3) or (cells, 3, 3).
        """
        functions = {name: CELL_FIELDS[name] for name in names}
        if not functions:
            return {}
        parts: dict[str, list[Array]] = {name: [] for name in functions}
        # An inverted or collapsed cell may have no finite stress: the file then says NaN.
        with np.errstate(all="ignore"):
            for samples, volumes in self._blocks():
                shares = volumes / volumes.sum(axis=1, keepdims=True)
                for name, function in functions.items():
                    values = function(samples)
                    values = values.reshape(*volumes.shape, *values.shape[1:])
                    parts[name].append(np.einsum("cp,cp...->c...", shares, values))
        return {name: np.concatenate(blocks) for name, blocks in parts.items()}

    def _blocks(self) -> Iterator[tuple[Samples, Array]]:
        """Samples of some cells at a time, and the volumes of their points, shape (cells, points)."""
        points, d = len(self._weights), self._mesh.geometry.dim
        owned = self._mesh.topology.index_map(self._mesh.topology.dim).size_local
        size = max(1, BLOCK // points)
        # A rank without cells still gives one empty block, which carries the shapes.
        for start in range(0, max(owned, 1), size):
            cells = np.arange(start, min(start + size, owned), dtype=np.int32)
            values = self._evaluate(self._gradient, cells).reshape(len(cells), points, d * d + 1)
            H = np.zeros((len(cells) * points, 3, 3))
            H[:, :d, :d] = values[..., :-1].reshape(-1, d, d)
            yield Samples(H, partial(self._respond, cells=cells)), values[..., -1] * self._weights

    def _respond(self, H: Array, cells: NDArray[np.int32]) -> tuple[Array, Array]:
        if self._mixed is not None:
            return mixed_response(self._mixed[0], H, self._evaluate(self._pressure, cells).ravel())
        if self._energy.objective:
            psi, P, _ = pointwise(self._energy, H, extension=self._extension)
            return psi, P
        values = self._evaluate(self._small_strain_response, cells).reshape(-1, 10)
        return values[:, 0], values[:, 1:].reshape(-1, 3, 3)

    def _evaluate(self, expression: fem.Expression, cells: NDArray[np.int32]) -> Array:
        return np.asarray(expression.eval(self._mesh, cells))

    @cached_property
    def _rule(self) -> tuple[Array, Array]:
        points, weights = basix.make_quadrature(self._mesh.basix_cell(), self._quadrature)
        return np.asarray(points), np.asarray(weights)

    @property
    def _weights(self) -> Array:
        return self._rule[1]

    @cached_property
    def _gradient(self) -> fem.Expression:
        """The gradient of u, row by row, and the volume of the reference map."""
        grad, d = ufl.grad(self._u), self._mesh.geometry.dim
        volume = abs(ufl.JacobianDeterminant(self._mesh))
        return self._expression([grad[i, j] for i in range(d) for j in range(d)] + [volume])

    @cached_property
    def _small_strain_response(self) -> fem.Expression:
        """ψ and P of an energy that is no function of stretches, by UFL."""
        F = ufl.variable(deformation_gradient(self._u))
        psi = self._energy.density(GradientMeasures(F))
        P = ufl.diff(psi, F)
        return self._expression([psi] + [P[i, j] for i in range(3) for j in range(3)])

    @cached_property
    def _pressure(self) -> fem.Expression:
        return self._expression([] if self._mixed is None else [self._mixed[1]])

    def _expression(self, components: list[Any]) -> fem.Expression:
        return fem.Expression(ufl.as_vector(components), self._rule[0], comm=self._mesh.comm)


def _quadrature_degree(u: fem.Function) -> int:
    degree, cell = u.function_space.element.basix_element.degree, u.function_space.mesh.topology.cell_name()
    return next(e.quadrature for e in ELEMENTS.values() if e.degree == degree and cell in e.cells)
