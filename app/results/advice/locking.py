"""Whether a solution is too stiff because its cells cannot keep their volume, and by how much."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from dolfinx import la
from mpi4py import MPI
from numpy.typing import NDArray

from elastune.app.body.body import Body
from elastune.app.body.regions.parts import Part
from elastune.forms.elements import ELEMENTS

Array = NDArray[np.float64]
Cells = NDArray[np.int32]

# Poisson's ratio from which on it is looked for, and the factor from which on it is told.
FROM, TOLD = 0.4, 1.1

# Energy of alternating pressures on the scale of μ, over all other: from here on first-order cells are locked outright.
OUTRIGHT = 200.0

# Quadrature points at once: bounds the memory that they take.
BLOCK = 2**15


@dataclass(frozen=True)
class Locking:
    """What was seen of it.

    Attributes:
        factor: How much too stiff it makes the body: forces under prescribed motions are so much too large, motions
            under loads so much too small.
        share: Of the strain energy that is in volume changes which neighbouring cells undo; –.
        nu: Poisson's ratio of the part that has most of it.
        region: Of that part, or None.
        element: Name of the element.
    """

    factor: float
    share: float
    nu: float
    region: str | None
    element: str

    def __str__(self) -> str:
        where = "" if self.region is None else f" in region {self.region}"
        return (
            f"{self.element} at nu = {self.nu:.4g}{where} locks: its cells cannot keep their volume, which makes "
            f"the body about {self.factor:.2g} times too stiff"
        )


def locking(body: Body) -> Locking | None:
    """Looks for it in the body's state; collective.

    A body that locks changes the volume of its cells back and forth about the mean around them. Let s be the share of
    that in the strain energy. Under given loads the compliance C has d log C / d log λ = -s, so that from λ = μ, where
    nothing locks, to the λ of the material it has fallen by exp ∫ s d log λ, with s growing from zero: about
    exp(s/2 log(λ/μ)). Where first-order cells have no motions left s falls again, and alternating pressures tell: the
    cube root of their energy on the scale of μ, over all other energy, is about the factor.

    Seen against mixed elements on the same meshes of cubes, pads, rods and beams it is between half and twice as large
    where that is below two, of the right order below thirty, and too small beyond; what first-order cells lack in
    bending at any ν is not in it. A smooth change of volume, however confined, is none.

    Returns:
        None if there is none to speak of, on mixed elements, and below ν = 0.4, where it is not looked for.
    """
    if body.p is not None or max(part.at_rest.poissons_ratio for part in body.parts) < FROM:
        return None
    comm, found = body.comm, []
    for part, cells in _parts(body):
        with np.errstate(all="ignore"):
            alternating, other = _energies(body, part, cells)
        found.append((comm.allreduce(alternating, op=MPI.SUM), comm.allreduce(other, op=MPI.SUM)))
    total = sum(map(sum, found))
    if not (np.isfinite(total) and total > 0):
        return None
    ratios = np.array([max(part.at_rest.lame_lambda / part.at_rest.lame_mu, 1.0) for part in body.parts])
    alternating = np.array([own for own, _ in found])
    shares = alternating / total
    factor = float(np.exp(shares @ np.log(ratios) / 2))
    pressures = float(ratios @ alternating) / max(total - float(alternating.sum()), 1e-300)
    if ELEMENTS[body.element].degree == 1 and pressures > OUTRIGHT:
        factor = max(factor, float(np.cbrt(1 + pressures)))
    if factor < TOLD:
        return None
    worst = body.parts[int(np.argmax(shares * np.log(ratios)))]
    return Locking(factor, float(shares.sum()), worst.at_rest.poissons_ratio, worst.name, body.element)


def _parts(body: Body) -> Iterator[tuple[Part, Cells]]:
    """Each part with the cells of it that this rank owns."""
    for part in body.parts:
        yield part, body.quadrature_points.owned if part.cells is None else part.cells


def _energies(body: Body, part: Part, cells: Cells) -> tuple[float, float]:
    """Of the volume changes about the mean around each cell, and all other strain energy, on this rank.

    As in a neo-Hookean body of the same moduli, μ/2 (J^(-2/3) I₁ - 3) + K/2 log²J.
    """
    points, rest = body.quadrature_points, part.at_rest
    bulk = rest.lame_lambda + 2 / 3 * rest.lame_mu
    volumes = points.volumes(cells).reshape(len(cells), points.count)
    strains, shape = np.empty_like(volumes), 0.0
    size = max(1, BLOCK // points.count)
    for start in range(0, len(cells), size):
        some = slice(start, start + size)
        F = np.eye(3) + points.gradient(body.u, cells[some])
        J = np.linalg.det(F)
        # Cells that are turned inside out have no logarithm, and other faults than locking.
        J = np.where(J > 0, J, 1.0)
        I1 = np.einsum("qij,qij->q", F, F)
        shape += rest.lame_mu / 2 * float(volumes[some].ravel() @ (J ** (-2 / 3) * I1 - 3))
        strains[some] = np.log(J).reshape(-1, points.count)
    around = _around(body, cells, volumes, strains)
    alternating = bulk / 2 * float(np.sum(volumes * (strains - around[:, None]) ** 2))
    return alternating, shape + bulk / 2 * float(np.sum(volumes * strains**2)) - alternating


def _around(body: Body, cells: Cells, volumes: Array, strains: Array) -> Array:
    """For each cell the mean of its nodes' means over the cells around them, in this part; collective."""
    geometry = body.geometry.mesh.geometry
    nodes = geometry.dofmap[cells]
    sums = la.vector(geometry.index_map(), 2)
    totals = sums.array.reshape(-1, 2)
    own = np.column_stack([volumes.sum(axis=1), np.sum(volumes * strains, axis=1)])
    np.add.at(totals, nodes, own[:, None, :])
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    means = totals[:, 1] / np.where(totals[:, 0] > 0, totals[:, 0], 1.0)
    return np.asarray(means[nodes].mean(axis=1)) if len(nodes) else np.empty(0)
