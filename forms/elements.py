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

    @property
    def tangled_quadrature(self) -> int:
        """Degree for states that are tangled within a cell, which a rule for the state at rest may not see.

        It integrates an energy of fourth degree in F exactly on straight simplices.
        """
        return max(self.quadrature, 4 * (self.degree - 1))


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


class Choice(NamedTuple):
    """An element that was chosen, and why in a few words."""

    element: str
    reason: str


# Seconds on one core to 1 % of the reaction of a cube clamped and pulled to twice its length, stable neo-Hookean:
#   ν       Q2     Q2-P1d   P2     P2-P1   Q1-P0   Q1, P1
#   0.3     0.21   0.19     0.14   0.26    0.4     0.9, 2.5
#   0.45    0.66   0.47     1.0    0.59    1.6     over 4
#   0.49    0.86   0.54     1.2    0.69    2.1     over 100
#   0.499   1.6    0.54     9      0.71    2.1     over 100
# First-order elements serve where the mesh given leaves nothing better. Mixed elements keep the volume of a cell on
# average only: at clamped edges under large strains a part of one may fold (a cube twisted by half a turn, Q2-P1d,
# P2-P1) where a penalty at every point, as long as it does not lock, prevents that. So they wait until it does.
MIXED_FROM = 0.495
MOST_UNKNOWNS = 1_000_000
_UNKNOWNS_PER_CELL = {"hexahedron": 24, "tetrahedron": 4.2, "quadrilateral": 8, "triangle": 4}


def choose(cell: str, mixed: bool, cells: int = 0) -> Choice:
    """The element that reaches a given error in the least time.

    Args:
        cell: Cell type.
        mixed: Whether ν is at least `MIXED_FROM` and the material one that mixed elements take.
        cells: Number of cells.
    """
    large = cells * _UNKNOWNS_PER_CELL[cell] > MOST_UNKNOWNS
    first, second = ("Q1-P0", "Q2-P1d") if mixed else ("Q1", "Q2")
    if cell in _SIMPLEX:
        first, second = ("P1-bubble", "P2-P1") if mixed else ("P1", "P2")
    reason = f"nu from {MIXED_FROM:g} up" if mixed else f"nu below {MIXED_FROM:g}, or no pressure possible"
    return Choice(first, f"{reason}; many cells") if large else Choice(second, reason)
