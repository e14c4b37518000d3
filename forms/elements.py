"""Finite elements by name: what a scene may ask for."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Element:
    """A displacement element.

    Attributes:
        degree: Polynomial degree.
        cells: Cell types it lives on.
        quadrature: Degree of the volume quadrature.
    """

    degree: int
    cells: tuple[str, ...]
    quadrature: int


_SIMPLEX = ("tetrahedron", "triangle")
_TENSOR = ("hexahedron", "quadrilateral")

# On simplices the rule integrates the stiffness at rest exactly; on tensor cells it is the Gauss rule with
# one point more than the degree along each axis.
ELEMENTS = {
    "P1": Element(1, _SIMPLEX, 1),
    "P2": Element(2, _SIMPLEX, 2),
    "P3": Element(3, _SIMPLEX, 4),
    "Q1": Element(1, _TENSOR, 2),
    "Q2": Element(2, _TENSOR, 4),
    "Q3": Element(3, _TENSOR, 6),
}
