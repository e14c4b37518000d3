"""Where terms are integrated: the body and its faces, with quadrature that is stated."""

from dataclasses import dataclass
from typing import Any

import dolfinx
import ufl


@dataclass(frozen=True)
class Domain:
    """A mesh with the rules of its integrals.

    Attributes:
        mesh: The body at rest.
        degree: Of the quadrature over the body.
        face_degree: Of the quadrature over faces, see `face_degree`.
        facet_tags: Numbers of the faces.
    """

    mesh: dolfinx.mesh.Mesh
    degree: int
    face_degree: int
    facet_tags: dolfinx.mesh.MeshTags | None = None

    def dx(self, cells: Any = None, degree: int | None = None) -> Any:
        """The measure dX, over all cells or some of this rank's."""
        metadata = {"quadrature_degree": self.degree if degree is None else degree}
        if cells is None:
            return ufl.Measure("dx", self.mesh, metadata=metadata)
        return ufl.Measure("dx", self.mesh, subdomain_data=[(1, cells)], metadata=metadata)(1)

    @property
    def ds(self) -> Any:
        """The measure dA, by number of a face."""
        metadata = {"quadrature_degree": self.face_degree}
        return ufl.Measure("ds", self.mesh, subdomain_data=self.facet_tags, metadata=metadata)


def face_degree(degree: int, geometry: int) -> int:
    """Exact for a constant times u on flat faces, and for the pressure on a deformed one.

    With nodes of degree q, of displacement or geometry, the deformed area vector ∂x/∂ξ × ∂x/∂η has degree 2q - 1
    along ξ and η each. dolfinx's own estimate counts the inverse of F too, and is far higher.

    Args:
        degree: Of the displacement.
        geometry: Of the cells' shape.
    """
    return max(2 * (degree + geometry - 1), 3 * max(degree, geometry) - 1)
