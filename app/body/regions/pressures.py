"""Integrals of a mixed element's pressures and of the volume strains that they leave."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import dolfinx.fem.petsc
import numpy as np
from numpy.typing import NDArray

from elastune.app.body.regions.parts import Part, Parts
from elastune.app.body.unknowns import Layout
from elastune.forms.terms import PressureField

Array = NDArray[np.float64]


class Pressures:
    """Those of a body; without any, its volume strains are zero."""

    def __init__(self, term: PressureField | None, parts: Parts, layout: Layout) -> None:
        """Of a body's term, which knows the parts in their order."""
        self._term, self._parts, self._layout = term, parts, layout

    def mass(self, weight: Callable[[Part], float]) -> Any:
        """∫w p q dX with a weight by part, a new PETSc matrix."""
        assert self._term is not None
        self._term.weigh([weight(part) for part in self._parts])
        matrix = dolfinx.fem.petsc.assemble_matrix(self._term.mass)
        matrix.assemble()
        return matrix

    @cached_property
    def _volumes(self) -> Array:
        """Diagonal of the mass matrix, of this rank's pressures."""
        return self.mass(lambda part: 1.0).getDiagonal().array_r.copy()

    @cached_property
    def _moduli(self) -> Array:
        """The shear modulus at each of them."""
        return self.mass(lambda part: part.shear_modulus).getDiagonal().array_r / self._volumes

    def squared(self, strains: Array) -> float:
        """∫θ² dX of a volume strain by its values at the pressures, see `Assembly.strains`."""
        return 0.0 if self._term is None else self._layout.total(strains @ (strains / self._volumes))

    def work(self, strains: Array) -> float:
        """∫μθ²/2 dX: what a volume strain costs that pressures have yet to take away."""
        return 0.0 if self._term is None else self._layout.total(strains @ (self._moduli * strains / self._volumes)) / 2
