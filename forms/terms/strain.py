"""The strain energy ∫ψ(F) dX of a material in some cells, by the compiled kernel or by UFL."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import ufl
from dolfinx import fem

from elastune.forms.energy import Energy
from elastune.forms.kinematics import GradientMeasures, deformation_gradient
from elastune.forms.normalize import linearize
from elastune.forms.spectral import SpectralForms, fastest
from elastune.forms.terms.domain import Domain
from elastune.forms.terms.term import Convexity, Fields, Term


class StrainEnergy(Term):
    """∫ψ(F) dX.

    Attributes:
        parameters: Values of the material's parameters in the order of `Energy.constants`; may be changed.
        can_filter: Whether the tangent can be made positive semi-definite point by point.
    """

    internal = True
    convex = True

    def __init__(
        self,
        energy: Energy,
        fields: Fields,
        domain: Domain,
        assembly: Literal["auto", "ufl", "spectral"] = "auto",
        extension: float | None = None,
        cells: Any = None,
        name: str = "strain",
    ) -> None:
        """Compiles the forms.

        Args:
            energy: Strain-energy density.
            fields: Displacement, vector Lagrange in 3D, or in 2D for plane strain.
            domain: What is integrated over.
            assembly: "ufl" for forms differentiated by UFL, "spectral" for the compiled stretch-space kernel,
                "auto" for the kernel's tangent, which can be filtered, and the faster of the two beside it.
            extension: Stretch below which a singular energy is continued; spectral only.
            cells: Those that this rank owns and that are made of the material; all by default.
            name: What people call it.
        """
        u, mesh = fields.u, domain.mesh
        v, w = ufl.TestFunction(u.function_space), ufl.TrialFunction(u.function_space)
        by = fastest(energy, u, extension is not None) if assembly == "auto" else dict.fromkeys(_FORMS, assembly)
        kernel = SpectralForms(energy, u, domain.degree, extension, cells) if "spectral" in by.values() else None
        self._kernel, self.can_filter = kernel, by["tangent"] == "spectral"
        self.parameters = fem.Constant(mesh, np.array(energy.constants())) if kernel is None else kernel.constants
        named = energy.unpack([self.parameters[i] for i in range(len(energy.constants()))])
        psi = energy.density(GradientMeasures(deformation_gradient(u)), named)
        # Functions of C know no sign of J: NaN where a material is not defined.
        guarded = psi if energy.inverts else psi + fem.Constant(mesh, 0.0) * ufl.ln(ufl.det(deformation_gradient(u)))

        def compiled(name: str, derivatives: Sequence[Any]) -> fem.Form:
            if by[name] == "spectral":
                return getattr(kernel, name)
            form = (psi if derivatives else guarded) * domain.dx(cells)
            for direction in derivatives:
                form = ufl.derivative(form, u, direction)
            return fem.form(form)

        super().__init__(name, compiled("energy", ()), {"u": compiled("residual", (v,))})
        self._tangent = compiled("tangent", (v, w))
        self._share = fem.Constant(mesh, 0.0)
        self._shear_modulus = linearize(energy).lame_mu
        # Positive definite whatever the state: a collapsed body has a tangent of zero, however filtered.
        membrane = self._share * ufl.inner(ufl.grad(v), ufl.grad(w)) * domain.dx(cells)
        self._membrane = membrane
        self.convexify(Convexity())

    def convexify(self, convexity: Convexity) -> None:
        """Chooses how the tangent treats negative eigenvalues, and what is added to it."""
        if self._kernel is not None:
            self._kernel.filter = convexity.filter
        self._share.value = convexity.share * self._shear_modulus
        self.tangent = {("u", "u"): [self._tangent, *([self._stretching] if convexity.share > 0 else [])]}

    @property
    def _stretching(self) -> fem.Form:
        """Compiled when it is first asked for, which few scenes do."""
        if not isinstance(self._membrane, fem.Form):
            self._membrane = fem.form(self._membrane)
        return self._membrane


_FORMS = ("energy", "residual", "tangent")
