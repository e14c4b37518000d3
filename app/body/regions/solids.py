"""Solids by region of the mesh, and the cells that are made of each."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from dolfinx import la
from mpi4py import MPI
from numpy.typing import NDArray

from elastune.app.errors import UserError
from elastune.forms.energy import Energy
from elastune.forms.spectral.density import signature
from elastune.geometry import Geometry

Cells = NDArray[np.int32]


@dataclass(frozen=True)
class Solid:
    """What cells may be made of.

    Attributes:
        energy: Strain-energy density, calibrated and tuned or not.
        extension: Stretch below which a singular energy is continued, or None.
        softened: The same energy with a Poisson's ratio at which tangled bodies untangle, or None.
    """

    energy: Energy
    extension: float | None = None
    softened: Energy | None = None

    def same(self, other: "Solid") -> bool:
        """Whether cells of both are alike."""
        mine, others = (
            (signature(solid.energy, solid.extension is not None), solid.energy.constants(), solid.extension)
            for solid in (self, other)
        )
        return mine == others


# By name of the region; None stands for the cells that lie in no region with a solid of its own.
Solids = Mapping[str | None, Solid]


def filled(geometry: Geometry, solids: Solids) -> dict[str | None, Cells | None]:
    """The cells of each solid that some rank has cells of; collective.

    Args:
        geometry: With the regions.
        solids: By region. Regions with cells in common share a solid, and the first of them has the cells.

    Returns:
        Cells that this rank owns, ascending, by region; None for all.

    Raises:
        UserError: If a region is unknown, empty or at odds with another one, or cells are made of nothing.
    """
    if set(solids) == {None}:
        return {None: None}
    topology, comm = geometry.mesh.topology, geometry.mesh.comm
    named = [name for name in solids if name is not None]
    owners: NDArray[np.int32] = np.full(topology.index_map(topology.dim).size_local, -1, dtype=np.int32)
    for number, name in enumerate(named):
        if name not in geometry.regions:
            known = ", ".join(geometry.regions) or "none"
            raise UserError(f"region.{name}: expected the name of a region of the mesh, which has {known}")
        cells = geometry.cells(name)
        cells = cells[cells < len(owners)]
        if not comm.allreduce(len(cells)):
            raise UserError(f"region.{name}: expected cells in it, got none")
        taken = owners[cells] >= 0
        for other in sorted(set[int]().union(*comm.allgather({int(number) for number in owners[cells[taken]]}))):
            if not solids[name].same(solids[named[other]]):
                both = f"some that region.{named[other]} makes of another material"
                raise UserError(f"region.{name}: expected cells of its own, got {both}")
        owners[cells[~taken]] = number
    found = {name: np.flatnonzero(owners == number).astype(np.int32) for number, name in enumerate((None, *named), -1)}
    totals = comm.allreduce(np.array([len(own) for own in found.values()]), op=MPI.SUM)
    counts = dict(zip(found, totals.tolist(), strict=True))
    if counts[None] and None not in solids:
        raise UserError(f"material: missing; {counts[None]} cells lie in no region with a material")
    whole = [name for name in found if counts[name] == geometry.cells_count]
    return {whole[0]: None} if whole else {name: own for name, own in found.items() if counts[name]}


def numbered(geometry: Geometry, cells: Iterable[Cells | None]) -> Cells | None:
    """Number, among some sets of cells that together are all, of the set of each cell, owned and ghost; collective.

    Args:
        geometry: Whose cells.
        cells: Those that this rank owns, see `filled`.

    Returns:
        None if there is one set only.
    """
    topology = geometry.mesh.topology
    numbers = la.vector(topology.index_map(topology.dim), dtype=np.int32)
    for number, own in enumerate(cells):
        if own is None:
            return None
        numbers.array[own] = number
    numbers.scatter_forward()
    return numbers.array.copy()
