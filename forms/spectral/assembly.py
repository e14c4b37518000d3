"""Energy, residual and tangent as dolfinx forms with compiled kernels."""

import ctypes
from functools import cached_property

import numpy as np
from dolfinx.fem import Constant, Form, Function

from elastune.forms.energy import Energy
from elastune.forms.spectral import build, compat, density, tables
from elastune.forms.spectral.build import SpectralError

FILTERS = ("none", "clamp", "absolute")
_CELLS = ("triangle", "quadrilateral", "tetrahedron", "hexahedron")


class SpectralForms:
    """Π(u) = ∫ ψ dX and its two derivatives, on owned cells.

    Attributes:
        constants: Values of the material's parameters in the order of `Energy.constants`; assigning to `.value`
            changes the material without compiling anything.
    """

    def __init__(
        self,
        energy: Energy,
        u: Function,
        quadrature_degree: int | None = None,
        extension: float | None = None,
        cells: np.ndarray | None = None,
    ) -> None:
        """Checks what is asked; compilation waits for the first form.

        Args:
            energy: Any energy of the catalogue, calibrated, tuned and mixed or not.
            u: Displacement, vector Lagrange of any order; two components are plane strain.
            quadrature_degree: By default 2(k - 1), at least 1, on simplices of order k and 2k on tensor cells.
            extension: σ_f, the stretch below which ψ continues as a polynomial (off by default), for energies
                with a singularity at zero stretch.
            cells: Those of this rank to integrate over; all that it owns by default.

        Raises:
            SpectralError: If the space is not such a one, or the threshold is not between 0 and 0.9.
        """
        _check_space(u)
        check_extension(energy, extension)
        self.energy_density = energy
        self.u = u
        self._cells = cells
        V = u.function_space
        degree = tables.default_quadrature_degree(V) if quadrature_degree is None else quadrature_degree
        self.quadrature_degree = degree
        self.constants = Constant(V.mesh, np.array(energy.constants(), dtype=np.float64))
        self._extended = extension is not None
        self._control = Constant(V.mesh, np.array([0.0, extension or 0.0]))

    @property
    def filter(self) -> str:
        """What `tangent` does to negative eigenvalues: "none" nothing, "clamp" to zero, "absolute" their size."""
        return FILTERS[int(self._control.value[0])]

    @filter.setter
    def filter(self, name: str) -> None:
        if name not in FILTERS:
            raise SpectralError(f"filter: expected one of {', '.join(FILTERS)}, got {name!r}")
        self._control.value[0] = FILTERS.index(name)

    @property
    def extension(self) -> float | None:
        """σ_f; may be changed, but not switched on or off."""
        return float(self._control.value[1]) if self._extended else None

    @extension.setter
    def extension(self, threshold: float) -> None:
        if not self._extended:
            raise SpectralError("extension: expected to be given when the forms are made")
        check_extension(self.energy_density, threshold)
        self._control.value[1] = threshold

    @cached_property
    def energy(self) -> Form:
        """Π(u), a functional of each rank's cells."""
        return self._form("energy", 0)

    @cached_property
    def residual(self) -> Form:
        """Π'(u), a vector."""
        return self._form("residual", 1)

    @cached_property
    def tangent(self) -> Form:
        """Π''(u), a symmetric matrix, filtered as `filter` says when it is assembled."""
        return self._form("tangent", 2)

    @cached_property
    def _library(self) -> ctypes.CDLL:
        V = self.u.function_space
        mesh = V.mesh
        key = (
            f"{density.signature(self.energy_density, self._extended)} {V.ufl_element()!r} "
            f"{mesh.ufl_domain().ufl_coordinate_element()!r} {self.quadrature_degree}"
        )

        def generate() -> str:
            table = tables.element_tables(V, self.quadrature_degree)
            return f"{table.code()}\n{density.code(self.energy_density, self._extended)}"

        return build.load("element.c", key, generate, mesh.comm)

    def _form(self, kernel: str, rank: int) -> Form:
        spaces = [self.u.function_space] * rank
        constants = [self.constants, self._control]
        address = build.address(self._library, kernel)
        return compat.custom_form(address, spaces, self.u, constants, self._library, self._cells)


def check_extension(energy: Energy, threshold: float | None) -> None:
    """Refuses a threshold that is not below rest, or an energy that is no function of stretches.

    Raises:
        SpectralError: If it is refused.
    """
    if threshold is None:
        return
    if not 0 < threshold <= 0.9:
        raise SpectralError(f"extension: must be above 0 and at most 0.9, got {threshold!r}")
    if not energy.objective:
        raise SpectralError(f"extension: {energy.name} is no function of stretches, and has no singularity to continue")


def _check_space(u: Function) -> None:
    V = u.function_space
    element, mesh = V.ufl_element(), V.mesh
    gdim, cell = mesh.geometry.dim, mesh.basix_cell().name
    if cell not in _CELLS or mesh.topology.dim != gdim:
        raise SpectralError(f"u: expected {', '.join(_CELLS)} in as many dimensions, got {cell} in {gdim}")
    family = None if element.element_family is None else element.element_family.name
    # A custom element is one of values at nodes with a bubble.
    if element.reference_value_shape != (gdim,) or family not in ("P", "custom") or element.discontinuous:
        raise SpectralError(f"u: expected continuous Lagrange with {gdim} components, got {element}")
    if u.dtype != np.float64:
        raise SpectralError(f"u: expected float64, got {u.dtype}")
