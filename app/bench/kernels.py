"""What energy, residual and tangent cost a cell: the spectral kernel against forms differentiated by UFL.

Two measures of each: the kernel alone, on the packed data of all cells, and assembled, into a PETSc matrix for
tangents as in the solver. UFL's forms are compiled with the options that dolfinx has by default, those of the
reference also with the optimisation of the spectral kernel.
"""

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from numpy.typing import NDArray

from elastune.app.bench.stopwatch import Call, assembly, interleaved, tabulation
from elastune.forms.energy import CATALOGUE, Energy
from elastune.forms.kinematics import GradientMeasures, deformation_gradient
from elastune.forms.materials import make
from elastune.forms.spectral import SpectralForms, build
from elastune.forms.spectral.choice import needs_eigenvalues

# The energy in invariants that others are held against, and the stretch-based ones whose UFL forms are compiled
# unless all are asked for: each takes seconds.
REFERENCE = "stable-neo-hookean"
STRETCH_BASED = ("linear-corotational", "hencky")

FORMS = ("energy", "residual", "tangent", "clamped", "absolute")
MEASURES = ("kernel", "assembled")
# "reference": UFL's form of the reference; "optimised": the same compiled like the spectral kernel.
METHODS = ("spectral", "invariants", "eigenvalues", "reference", "optimised")
_FILTERS = {"clamped": "clamp", "absolute": "absolute"}


@dataclass(frozen=True)
class Cells:
    """A unit square or cube of so many cells along an edge."""

    cell: str
    order: int
    edge: int


ELEMENTS = {
    "P1 tetrahedron": Cells("tetrahedron", 1, 12),
    "P2 tetrahedron": Cells("tetrahedron", 2, 7),
    "Q1 hexahedron": Cells("hexahedron", 1, 14),
    "Q2 hexahedron": Cells("hexahedron", 2, 6),
    "P1 triangle": Cells("triangle", 1, 72),
    "P2 triangle": Cells("triangle", 2, 48),
    "Q1 quadrilateral": Cells("quadrilateral", 1, 64),
    "Q2 quadrilateral": Cells("quadrilateral", 2, 32),
}


@dataclass(frozen=True)
class Plan:
    """What is measured.

    Attributes:
        materials: Names of the catalogue.
        eigenvalues: Those whose stretch-based energy is also assembled by UFL.
        elements: By name.
        repeats: Of each call.
    """

    materials: tuple[str, ...] = tuple(CATALOGUE)
    eigenvalues: tuple[str, ...] = STRETCH_BASED
    elements: Mapping[str, Cells] = field(default_factory=lambda: ELEMENTS)
    repeats: int = 15


@dataclass(frozen=True)
class Row:
    """One entry of the table.

    Attributes:
        element: As in `ELEMENTS`.
        material: Name.
        form: One of `FORMS`.
        measure: One of `MEASURES`.
        cells: Of the mesh.
        times: Microseconds a cell of each round by method; UFL's tangent stands beside filtered ones too.
    """

    element: str
    material: str
    form: str
    measure: str
    cells: int
    times: Mapping[str, NDArray[np.float64]]

    def spread(self, method: str) -> tuple[float, float, float]:
        """Median and quartiles."""
        middle, low, high = np.percentile(self.times[method], (50, 25, 75))
        return float(middle), float(low), float(high)

    def ratio(self, method: str) -> float | None:
        """Time of the spectral kernel over that of another method in the same round, the median of all rounds."""
        return float(np.median(self.times["spectral"] / self.times[method])) if method in self.times else None


def plan(quick: bool = False, everything: bool = False) -> Plan:
    """Of the options of the command line."""
    if quick:
        return Plan((REFERENCE, STRETCH_BASED[0]), STRETCH_BASED[:1], ELEMENTS, 11)
    return Plan(eigenvalues=tuple(CATALOGUE)) if everything else Plan()


def measure(plan: Plan, tell: Callable[[str], None]) -> Iterator[Row]:
    """Times everything, element by element.

    Args:
        plan: What.
        tell: Told each tangent in a line.
    """
    for element, cells in plan.elements.items():
        u = deformed(cells)
        degree = SpectralForms(make(REFERENCE), u).quadrature_degree
        reference = ufl_forms(make(REFERENCE), u, degree)
        optimised = ufl_forms(make(REFERENCE), u, degree, optimised=True)
        targets: dict[int, Any] = {}
        for name in plan.materials:
            forms = {"reference": reference, "optimised": optimised}
            own = "eigenvalues" if needs_eigenvalues(make(name), u) else "invariants"
            if name != REFERENCE and (own == "invariants" or name in plan.eigenvalues):
                forms[own] = ufl_forms(make(name), u, degree)
            rows = list(_rows(element, name, u, forms, targets, plan.repeats))
            yield from rows
            tell("; ".join(_line(row) for row in rows if row.form == "tangent"))


def deformed(cells: Cells) -> fem.Function:
    """A displacement that is random at every node, with strains about a tenth."""
    kind = getattr(mesh.CellType, cells.cell)
    n = cells.edge
    planar = cells.cell in ("triangle", "quadrilateral")
    create = mesh.create_unit_square if planar else mesh.create_unit_cube
    domain = create(MPI.COMM_SELF, *([n] * (2 if planar else 3)), kind)
    u = fem.Function(fem.functionspace(domain, ("Lagrange", cells.order, (domain.geometry.dim,))))
    u.x.array[:] = np.random.default_rng(1).uniform(-0.1, 0.1, u.x.array.size) / n
    return u


def ufl_forms(energy: Energy, u: fem.Function, degree: int, optimised: bool = False) -> dict[str, fem.Form]:
    """UFL's energy, residual and tangent, with parameters as constants as in the solver."""
    constants = fem.Constant(u.function_space.mesh, np.array(energy.constants()))
    named = energy.unpack([constants[i] for i in range(len(constants.value))])
    form = energy.density(GradientMeasures(deformation_gradient(u)), named) * ufl.dx(
        metadata={"quadrature_degree": degree}
    )
    flags = [flag for flag in build.FLAGS if flag.startswith(("-O", "-m", "-fno"))]
    options = {"cffi_extra_compile_args": [*flags, "-g0"]} if optimised else None
    forms = {}
    for name in FORMS[:3]:
        forms[name] = fem.form(form, jit_options=options)
        form = ufl.derivative(form, u)
    return forms


def _rows(
    element: str,
    name: str,
    u: fem.Function,
    forms: dict[str, dict[str, fem.Form]],
    targets: dict[int, Any],
    repeats: int,
) -> Iterator[Row]:
    spectral = SpectralForms(make(name), u)
    cells = len(u.function_space.dofmap.list)
    for how in MEASURES:
        calls: dict[tuple[str, str], Call] = {}
        for form in FORMS:
            calls["spectral", form] = _spectral_call(spectral, form, how, targets)
        for (method, by_name), form in itertools.product(forms.items(), FORMS[:3]):
            compiled = by_name[form]
            calls[method, form] = tabulation(compiled, form, u) if how == "kernel" else assembly(compiled, targets)
        seconds = interleaved(calls, repeats)
        for form in FORMS:
            plain = "tangent" if form in _FILTERS else form
            times = {"spectral": 1e6 / cells * seconds["spectral", form]}
            times |= {method: 1e6 / cells * seconds[method, plain] for method in forms}
            if name == REFERENCE:
                times["invariants"] = times["reference"]
            yield Row(element, name, form, how, cells, times)


def _spectral_call(spectral: SpectralForms, form: str, how: str, targets: dict[int, Any]) -> Call:
    """A filtered tangent is the same form with another constant."""
    name = "tangent" if form in _FILTERS else form
    compiled, rule = getattr(spectral, name), _FILTERS.get(form, "none")
    spectral.filter = rule
    if how == "kernel":
        return tabulation(compiled, name, spectral.u)
    call = assembly(compiled, targets)

    def filtered() -> None:
        spectral.filter = rule
        call()

    return filtered


def _line(row: Row) -> str:
    against = ", ".join(f"{row.ratio(m):.2f} x {m}" for m in METHODS[1:] if m in row.times)
    head = f"{row.element:16} {row.material:26} " if row.measure == MEASURES[0] else ""
    return f"{head}{row.measure} {row.spread('spectral')[0]:.3g} µs: {against}"
