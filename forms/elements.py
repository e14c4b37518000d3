"""Finite elements by name: what a scene may ask for."""

from dataclasses import dataclass
from typing import NamedTuple


class Pressure(NamedTuple):
    """A space of pressures: polynomials of a degree, continuous or not from cell to cell."""

    degree: int
    continuous: bool


@dataclass(frozen=True)
class Element:
    """A displacement element, or a pair with pressures.

    Attributes:
        degree: Polynomial degree of the displacement.
        cells: Cell types it lives on.
        quadrature: Degree of the volume quadrature.
        pressure: Of a mixed element.
        bubble: Whether the displacement has a bubble in each cell beside its polynomials.
    """

    degree: int
    cells: tuple[str, ...]
    quadrature: int
    pressure: Pressure | None = None
    bubble: bool = False


_SIMPLEX = ("tetrahedron", "triangle")
_TENSOR = ("hexahedron", "quadrilateral")

# On simplices the rule integrates the stiffness at rest exactly; on tensor cells it is the Gauss rule with
# one point more than the degree along each axis. Mixed elements:
# Q1-P0 is the mean-dilatation element: its pressure is λ times the cell's mean volume strain. Reduced
# integration of the volume part, its alternative, samples the centre only, and has no limit at ν = 0.5.
# It may show pressures that alternate from cell to cell; the other three satisfy the inf-sup condition.
# On Q2-P1d the linear pressures are discontinuous, so that each cell keeps its own volume.
# P1-bubble is the MINI element; its rule integrates the pressure's work on the bubble exactly.
ELEMENTS = {
    "P1": Element(1, _SIMPLEX, 1),
    "P2": Element(2, _SIMPLEX, 2),
    "P3": Element(3, _SIMPLEX, 4),
    "Q1": Element(1, _TENSOR, 2),
    "Q2": Element(2, _TENSOR, 4),
    "Q3": Element(3, _TENSOR, 6),
    "P2-P1": Element(2, _SIMPLEX, 2, Pressure(1, True)),
    "P1-bubble": Element(1, _SIMPLEX, 4, Pressure(1, True), bubble=True),
    "Q1-P0": Element(1, _TENSOR, 2, Pressure(0, False)),
    "Q2-P1d": Element(2, _TENSOR, 4, Pressure(1, False)),
}
