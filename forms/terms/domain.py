"""Where terms are integrated: the body and its faces, with quadrature that is stated."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import dolfinx
import numpy as np
import ufl
from numpy.typing import NDArray

_FACETS = {"triangle": 3, "quadrilateral": 4, "tetrahedron": 4, "hexahedron": 6}


@dataclass(frozen=True)
class Domain:
    """A mesh with the rules of its integrals.

    Attributes:
        mesh: The body at rest.
        degree: Of the quadrature over the body.
        face_degree: Of the quadrature over faces, see `face_degree`.
        faces: Facets on this rank, owned and ghost, by name of the face; faces may overlap, and lie inside.
    """

    mesh: dolfinx.mesh.Mesh
    degree: int
    face_degree: int
    faces: Mapping[str, NDArray[np.int32]] = field(default_factory=dict)

    def dx(self, cells: Any = None, degree: int | None = None) -> Any:
        """The measure dX, over all cells or some of this rank's."""
        metadata = {"quadrature_degree": self.degree if degree is None else degree}
        if cells is None:
            return ufl.Measure("dx", self.mesh, metadata=metadata)
        return ufl.Measure("dx", self.mesh, subdomain_data=[(1, cells)], metadata=metadata)(1)

    def ds(self, face: str) -> Any:
        """The measure dA of a face; inside the body over one side of it, which is enough where u is continuous."""
        return self._ds(list(self.faces).index(face) + 1)

    @cached_property
    def _ds(self) -> Any:
        # Of several forms that are summed, UFL wants one list of facets.
        data = [(k, self._sides(facets)) for k, facets in enumerate(self.faces.values(), start=1)]
        return ufl.Measure("ds", self.mesh, subdomain_data=data, metadata={"quadrature_degree": self.face_degree})

    def _sides(self, facets: NDArray[np.int32]) -> NDArray[np.int32]:
        """Cell and number in it of each facet that this rank owns, one after the other."""
        topology = self.mesh.topology
        d = topology.dim
        topology.create_connectivity(d - 1, d)
        topology.create_connectivity(d, d - 1)
        to_cells, to_facets = topology.connectivity(d - 1, d), topology.connectivity(d, d - 1)
        own = facets[facets < topology.index_map(d - 1).size_local]
        # The first cell of a facet: owned cells come before ghosts.
        cells = to_cells.array[to_cells.offsets[own]]
        of_cells = [to_facets.array[to_facets.offsets[cells] + k] == own for k in range(_FACETS[topology.cell_name()])]
        places = np.argmax(of_cells, axis=0)
        return np.stack([cells, places], axis=1).astype(np.int32).ravel()


def face_degree(degree: int, geometry: int) -> int:
    """Exact for a constant times u on flat faces, and for the pressure on a deformed one.

    With nodes of degree q, of displacement or geometry, the deformed area vector ∂x/∂ξ × ∂x/∂η has degree 2q - 1
    along ξ and η each. dolfinx's own estimate counts the inverse of F too, and is far higher.

    Args:
        degree: Of the displacement.
        geometry: Of the cells' shape.
    """
    return max(2 * (degree + geometry - 1), 3 * max(degree, geometry) - 1)
