"""The fields of a body: displacement at the nodes, everything else one value a cell, or averaged to the nodes."""

import math
from collections.abc import Iterable, Iterator
from functools import cached_property, partial
from typing import Any

import numpy as np
from dolfinx import fem, la
from dolfinx.mesh import entities_to_geometry
from numpy.typing import NDArray

from elastune.app.body.body import Body
from elastune.app.results.fields.local import CELL_FIELDS, Samples
from elastune.forms import response
from elastune.forms.terms import mixed_response

Array = NDArray[Any]

# Points evaluated at once: bounds the memory that they take.
BLOCK = 2**15


class Fields:
    """Fields of a body; every method reads its present state.

    Cell values are averages over the quadrature points, weighted by rest volume. A displacement of another
    degree than the mesh is interpolated to the nodes of the mesh.
    """

    def __init__(self, body: Body) -> None:
        """Of a body."""
        self._body, self._mesh, self._u = body, body.geometry.mesh, body.u

    # ------------------------------------------------------------------ nodes

    def displacement(self) -> Array:
        """Displacement of the mesh's nodes that this rank owns, shape (n, 3); zero along z in 2D."""
        geometry, nodal = self._mesh.geometry, self._nodal
        if nodal is not self._u:
            nodal.interpolate(self._u)
        values = np.zeros((len(geometry.x), 3))
        if not len(self._body.quadrature_points.all):
            # dolfinx divides by the number of cells.
            return values
        at_dofs = nodal.x.array.reshape(-1, geometry.dim)
        values[self._nodes, : geometry.dim] = at_dofs[nodal.function_space.dofmap.list]
        return values[: geometry.index_map().size_local]

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
            names: Keys of `CELL_FIELDS`, or "region".

        Returns:
            Arrays of shape (cells,), (cells, 3) or (cells, 3, 3).
        """
        asked = list(names)
        functions = {name: CELL_FIELDS[name] for name in asked if name != "region"}
        regions = {"region": self._regions()} if "region" in asked else {}
        if not functions:
            return regions
        parts: dict[str, list[Array]] = {name: [] for name in functions}
        # An inverted or collapsed cell may have no finite stress: the file then says NaN.
        with np.errstate(all="ignore"):
            for samples, volumes in self._blocks():
                shares = volumes / volumes.sum(axis=1, keepdims=True)
                for name, function in functions.items():
                    values = function(samples)
                    values = values.reshape(*volumes.shape, *values.shape[1:])
                    parts[name].append(np.einsum("cp,cp...->c...", shares, values))
        return {name: np.concatenate(blocks) for name, blocks in parts.items()} | regions

    def averages(self, names: Iterable[str]) -> dict[str, Array]:
        """Fields of the cells at the mesh's nodes that this rank owns: means of the cells around, by volume at rest.

        Where materials meet, over the cells of both. Collective.

        Args:
            names: Keys of `CELL_FIELDS`.

        Returns:
            Arrays of shape (nodes,), (nodes, 3) or (nodes, 3, 3).
        """
        points, geometry = self._body.quadrature_points, self._mesh.geometry
        nodes, volumes = geometry.dofmap[points.owned], points.volumes().reshape(-1, points.count).sum(axis=1)
        found = {}
        for name, values in self.cells(names).items():
            rows = np.column_stack([np.ones(len(values)), values.reshape(len(values), math.prod(values.shape[1:]))])
            sums = la.vector(geometry.index_map(), rows.shape[1])
            totals = sums.array.reshape(-1, rows.shape[1])
            np.add.at(totals, nodes, (volumes[:, None] * rows)[:, None, :])
            sums.scatter_reverse(la.InsertMode.add)
            owned = totals[: geometry.index_map().size_local]
            found[name] = (owned[:, 1:] / owned[:, :1]).reshape(-1, *values.shape[1:])
        return found

    def _regions(self) -> NDArray[np.int32]:
        """Of each cell the place of its region among those with a material of their own, from one; zero without."""
        body, cells = self._body, self._body.quadrature_points.owned
        numbers = {name: k for k, name in enumerate((name for name in body.solids if name is not None), start=1)}
        found: NDArray[np.int32] = np.zeros(len(cells), dtype=np.int32)
        for part, own in body.parts.of(cells):
            found[own] = numbers.get(part.name or "", 0)
        return found

    def _blocks(self) -> Iterator[tuple[Samples, Array]]:
        """Samples of some cells at a time, and the volumes of their points, shape (cells, points)."""
        points = self._body.quadrature_points
        size = max(1, BLOCK // points.count)
        # A rank without cells still gives one empty block, which carries the shapes.
        for start in range(0, max(len(points.owned), 1), size):
            cells = points.owned[start : start + size]
            H = points.gradient(self._u, cells)
            yield (
                Samples(H, partial(self._respond, cells=cells)),
                points.volumes(cells).reshape(len(cells), points.count),
            )

    def _respond(self, H: Array, cells: NDArray[np.int32]) -> tuple[Array, Array]:
        body, shape = self._body, (len(cells), self._body.quadrature_points.count)
        psi, P = np.empty(shape), np.empty((*shape, 3, 3))
        p = None if body.p is None else body.quadrature_points.evaluate(body.p, cells).reshape(shape)
        for part, own in body.parts.of(cells):
            gradients = H.reshape(*shape, 3, 3)[own].reshape(-1, 3, 3)
            if part.split is None or p is None:
                found = response.first(part.energy, gradients, part.extension)
            else:
                found = mixed_response(part.split, gradients, p[own].ravel())
            psi[own], P[own] = found[0].reshape(-1, shape[1]), found[1].reshape(-1, shape[1], 3, 3)
        return psi.reshape(-1), P.reshape(-1, 3, 3)
