"""Π(u): strain energy less the work of the loads, with its residual and tangent as compiled forms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import dolfinx
import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray

from elastune.forms.energy import Energy
from elastune.forms.kinematics import GradientMeasures, deformation_gradient
from elastune.forms.spectral import SpectralForms, fastest

Form = Any


@dataclass(frozen=True)
class Loads:
    """What pulls and presses at full load.

    Attributes:
        body: Force per reference volume, shape (d,), or None.
        tractions: Dead force per reference area, shape (d,), by facet tag.
        pressures: Pressure on the deformed face, positive into the body, by facet tag.
    """

    body: NDArray[np.float64] | None = None
    tractions: Mapping[int, NDArray[np.float64]] = field(default_factory=dict)
    pressures: Mapping[int, float] = field(default_factory=dict)

    @property
    def conservative(self) -> bool:
        """Whether the loads have a potential: the follower pressure on a face with free edges has none."""
        return not self.pressures


class Potential:
    """Π(u; t) = ∫ψ(F) dX - t (∫b·u dX + ∫T·u dA), and follower pressure t p beside it.

    Attributes:
        u: The displacement that all forms read.
        load: The load factor t, a constant of the forms.
        internal: ∂/∂u of the strain energy: internal forces, a list of forms to be summed.
        external: Internal and external forces are in balance when `internal` and `external` sum to zero.
        strain_energy: ∫ψ dX.
        work: -t (∫b·u dX + ∫T·u dA).
        tangent: Derivative of `internal` and `external` together.
        parameters: Values of the material's parameters in the order of `Energy.constants`; may be changed.
    """

    def __init__(
        self,
        energy: Energy,
        u: fem.Function,
        quadrature_degree: int,
        loads: Loads,
        facet_tags: dolfinx.mesh.MeshTags | None = None,
        assembly: Literal["auto", "ufl", "spectral"] = "auto",
        extension: float | None = None,
    ) -> None:
        """Compiles what is asked for when it is asked for.

        Args:
            energy: Strain-energy density.
            u: Displacement, vector Lagrange in 3D, or in 2D for plane strain.
            quadrature_degree: Of the volume integrals.
            loads: At full load.
            facet_tags: Where the loads are.
            assembly: "ufl" for forms differentiated by UFL, "spectral" for the compiled stretch-space kernel,
                "auto" for the kernel's tangent, which can be filtered, and the faster of the two beside it.
            extension: Stretch below which a singular energy is continued; spectral only.
        """
        mesh = u.function_space.mesh
        self.u = u
        self.loads = loads
        self.load = fem.Constant(mesh, 0.0)
        v, w = ufl.TestFunction(u.function_space), ufl.TrialFunction(u.function_space)
        dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": quadrature_degree})
        ds = ufl.Measure("ds", mesh, subdomain_data=facet_tags)

        work, follower = _load_terms(u, v, loads, self.load, dx, ds)
        self.work = [fem.form(work)] if work is not None else []
        self.external = [fem.form(term) for term in (_derivative(work, u, v), follower) if term is not None]
        loads_tangent = [fem.form(ufl.derivative(follower, u, w))] if follower is not None else []

        by = _assembled_by(assembly, energy, u, extension)
        kernel = SpectralForms(energy, u, quadrature_degree, extension) if "spectral" in by.values() else None
        self._kernel = kernel
        self.parameters = fem.Constant(mesh, np.array(energy.constants())) if kernel is None else kernel.constants
        named = energy.unpack([self.parameters[i] for i in range(len(energy.constants()))])
        F = deformation_gradient(u)
        psi = energy.density(GradientMeasures(F), named)
        # Functions of C know no sign of J: NaN where a material is not defined.
        guarded = psi if energy.inverts else psi + fem.Constant(mesh, 0.0) * ufl.ln(ufl.det(F))

        def compiled(name: str, derivatives: Sequence[Any]) -> fem.Form:
            if by[name] == "spectral":
                return getattr(kernel, name)
            form = (psi if derivatives else guarded) * dx
            for direction in derivatives:
                form = ufl.derivative(form, u, direction)
            return fem.form(form)

        self.strain_energy = [compiled("energy", ())]
        self.internal = [compiled("residual", (v,))]
        self.tangent = [compiled("tangent", (v, w)), *loads_tangent]
        self._filters = by["tangent"] == "spectral"

    @property
    def can_filter(self) -> bool:
        """Whether the tangent can be made positive semi-definite cell by cell."""
        return self._filters

    def set_filter(self, name: Literal["none", "clamp", "absolute"]) -> None:
        """Chooses how the kernel's tangent treats negative eigenvalues, at every quadrature point."""
        if self._kernel is not None:
            self._kernel.filter = name


def _assembled_by(assembly: str, energy: Energy, u: fem.Function, extension: float | None) -> dict[str, str]:
    """What assembles energy, residual and tangent: "ufl" or "spectral"."""
    if assembly == "auto":
        return fastest(energy, u, extended=extension is not None)
    return dict.fromkeys(("energy", "residual", "tangent"), assembly)


def _derivative(form: Any, u: Any, v: Any) -> Any:
    return None if form is None else ufl.derivative(form, u, v)


def _load_terms(u: Any, v: Any, loads: Loads, t: Any, dx: Any, ds: Any) -> tuple[Any, Any]:
    """-t times the work of dead loads, and the residual of the follower pressure; None where there is none."""
    mesh = u.function_space.mesh
    work = []
    if loads.body is not None:
        work.append(ufl.inner(fem.Constant(mesh, loads.body), u) * dx)
    for tag, traction in loads.tractions.items():
        work.append(ufl.inner(fem.Constant(mesh, traction), u) * ds(tag))
    follower = []
    if loads.pressures:
        F = ufl.Identity(len(u)) + ufl.grad(u)
        # Nanson: the deformed area vector is det(F) F^-T N dA.
        area = ufl.det(F) * ufl.inv(F).T * ufl.FacetNormal(mesh)
        for tag, pressure in loads.pressures.items():
            follower.append(t * fem.Constant(mesh, pressure) * ufl.inner(area, v) * ds(tag))
    return (-t * sum(work) if work else None), (sum(follower) if follower else None)
