"""The parts of a body: cells of one solid, with its moduli at rest and its term of Π."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from elastune.app.body.regions.solids import Cells, Solid, Solids
from elastune.forms.energy import Energy
from elastune.forms.normalize import Linearization, linearize
from elastune.forms.terms import Domain, Fields, StrainEnergy
from elastune.forms.volumetric import Split, split

# Times the softest part's shear modulus.
STIFF = 100.0


@dataclass(frozen=True, eq=False)
class Part:
    """Cells that are made of one solid.

    Attributes:
        name: Of their region; None for those that lie in no region with a solid of its own.
        solid: What they are made of.
        cells: Those that this rank owns, ascending; None for all.
        split: The energy as a mixed element sees it, or None.
        strain: The term of its strain energy.
        at_rest: Moduli at rest.
    """

    name: str | None
    solid: Solid
    cells: Cells | None
    split: Split | None
    strain: StrainEnergy
    at_rest: Linearization

    @property
    def key(self) -> str:
        """The table of a scene that says what they are made of."""
        return "material" if self.name is None else f"region.{self.name}.material"

    @property
    def energy(self) -> Energy:
        """Strain-energy density."""
        return self.solid.energy

    @property
    def extension(self) -> float | None:
        """Stretch below which it is continued, or None."""
        return self.solid.extension

    @property
    def shear_modulus(self) -> float:
        """μ_Lamé."""
        return self.at_rest.lame_mu

    @property
    def modulus(self) -> float:
        """Stress of a strain of one at rest that displacements alone make: λ + 2μ, or 2μ where pressures carry λ."""
        return 2 * self.at_rest.lame_mu + (self.at_rest.lame_lambda if self.split is None else 0.0)


class Parts(tuple[Part, ...]):
    """All of a body's parts, no cell in two of them."""

    @classmethod
    def made(
        cls,
        cells: Mapping[str | None, Cells | None],
        solids: Solids,
        fields: Fields,
        domain: Domain,
        assembly: Literal["auto", "ufl", "spectral"],
    ) -> "Parts":
        """Compiles the forms of each.

        Args:
            cells: By region, see `filled`.
            solids: By region.
            fields: Displacement, and of a mixed element the pressure.
            domain: What is integrated over.
            assembly: See `StrainEnergy`.

        Raises:
            MaterialError: If a mixed element cannot take an energy.
        """
        at_rest = {name: linearize(solids[name].energy) for name in cells}
        least = min(rest.lame_mu for rest in at_rest.values())
        parts = []
        for name, owned in cells.items():
            solid = solids[name]
            own = None if fields.p is None else split(solid.energy)
            energy = solid.energy if own is None else own.shear
            # UFL's forms round relative to the modulus, the kernel relative to the stress: that of a stiff part, hardly
            # strained, must not drown the forces of a soft one.
            stiff = at_rest[name].lame_mu > STIFF * least
            by: Literal["auto", "ufl", "spectral"] = "spectral" if stiff and assembly == "auto" else assembly
            # No two terms have one name.
            label = "strain" if name is None else f"strain of {name}"
            strain = StrainEnergy(energy, fields, domain, by, solid.extension, owned, label)
            parts.append(Part(name, solid, owned, own, strain, at_rest[name]))
        return cls(parts)

    def of(self, cells: Cells) -> Iterator[tuple[Part, Any]]:
        """The parts that some cells are made of, and which of the cells are: indices into them, or a slice.

        Args:
            cells: Of those that this rank owns, in any order, shape (n,).
        """
        if len(self) == 1:
            yield self[0], slice(None)
            return
        numbers = self._numbers[cells]
        for number, part in enumerate(self):
            yield part, np.flatnonzero(numbers == number)

    @cached_property
    def _numbers(self) -> NDArray[np.int32]:
        """Number of the part of each cell that this rank owns."""
        owned = np.concatenate([np.empty(0, dtype=np.int32), *(part.cells for part in self if part.cells is not None)])
        numbers = np.zeros(len(owned), dtype=np.int32)
        for number, part in enumerate(self):
            numbers[part.cells] = number
        return numbers

    @property
    def can_filter(self) -> bool:
        """Whether the strain energy's tangent can be made positive semi-definite point by point."""
        return all(part.strain.can_filter for part in self)

    @cached_property
    def softest(self) -> float:
        """Least modulus of a part."""
        return min(part.modulus for part in self)

    @cached_property
    def contrast(self) -> float:
        """The largest modulus of a part over the least."""
        return max(part.modulus for part in self) / self.softest
