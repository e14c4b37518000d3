"""Π(u, p): a pressure of its own carries the λ part, so that ν may come near to one half, or be it."""

from collections.abc import Mapping
from typing import Any, Literal

import dolfinx
import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray

from forms.kinematics import deformation_gradient
from forms.normalize import linearize
from forms.potential import Loads, Potential
from forms.spectral import pointwise
from forms.volumetric import Split

Array = NDArray[np.float64]


class MixedPotential(Potential):
    """Π(u, p; t) = ∫W(F) + p θ(J) - p²/(2λ) dX and the loads: a perturbed Lagrangian for any U(J) = θ²/2.

    It is least in u and greatest in p; what is greatest has p = λθ in the mean, and the energy λ/2 of the mean
    strain squared. With 1/λ = 0 the pressure is the multiplier of θ = 0.

    What `Potential` lists contains the pressure's share. Signs: p is positive under tension.

    Attributes:
        p: The pressure that all forms read.
        shear_modulus: μ_Lamé, the scale of what the pressure meets.
        volume_strain: ∂Π/∂p, a form over the pressures: zero where θ = p/λ in the mean.
        coupling: ∂²Π/∂p∂u, rows of pressures.
        coupling_transposed: ∂²Π/∂u∂p, rows of displacements.
        compliance: ∂²Π/∂p², minus 1/λ times `mass`, zero at ν = 0.5.
        mass: ∫p q dX.
        stretching: `share` times μ ∫∇u : ∇v dX, positive definite whatever the state.
        share: A constant of `stretching`.

    Reference:
        Sussman & Bathe 1987, Computers & Structures 26:357, for the displacement-pressure form.
    """

    def __init__(
        self,
        split: Split,
        u: fem.Function,
        p: fem.Function,
        quadrature_degree: int,
        loads: Loads,
        facet_tags: dolfinx.mesh.MeshTags | None = None,
        assembly: Literal["auto", "ufl", "spectral"] = "auto",
    ) -> None:
        """Compiles all forms.

        Args:
            split: The energy, its λ part a square of a volume strain.
            u: Displacement.
            p: Pressure, on the same mesh.
            quadrature_degree: Of the volume integrals.
            loads: At full load.
            facet_tags: Where the loads are.
            assembly: Of the μ part, see `Potential`.
        """
        super().__init__(split.shear, u, quadrature_degree, loads, facet_tags, assembly)
        V, Q = u.function_space, p.function_space
        v, w, q, r = ufl.TestFunction(V), ufl.TrialFunction(V), ufl.TestFunction(Q), ufl.TrialFunction(Q)
        dx = ufl.Measure("dx", V.mesh, metadata={"quadrature_degree": quadrature_degree})
        self.p = p
        self.shear_modulus = linearize(split.shear).lame_mu

        theta = split.strain(ufl.det(deformation_gradient(u)), _constants(split, V.mesh))
        compliance = fem.Constant(V.mesh, 1 / split.bulk)
        stored = (p * theta - compliance * p**2 / 2) * dx
        force, strain = ufl.derivative(stored, u, v), ufl.derivative(stored, p, q)
        self.strain_energy = [*self.strain_energy, fem.form(stored)]
        self.internal = [*self.internal, fem.form(force)]
        self.tangent = [*self.tangent, fem.form(ufl.derivative(force, u, w))]
        self.volume_strain = fem.form(strain)
        self.coupling = fem.form(ufl.derivative(strain, u, w))
        self.coupling_transposed = fem.form(ufl.derivative(force, p, r))
        self.compliance = fem.form(ufl.derivative(strain, p, r))
        self.mass = fem.form(ufl.inner(q, r) * dx)
        self.share = fem.Constant(V.mesh, 0.0)
        self.stretching = fem.form(self.share * self.shear_modulus * ufl.inner(ufl.grad(v), ufl.grad(w)) * dx)


def mixed_response(split: Split, H: Array, p: Array) -> tuple[Array, Array]:
    """W + pθ - p²/(2λ) and its derivative in F, by the code that assembles W.

    Args:
        split: The energy.
        H: F - I at points, shape (n, 3, 3).
        p: Pressure there, shape (n,).

    Returns:
        Energy density, shape (n,), and first Piola-Kirchhoff stress, shape (n, 3, 3).
    """
    psi, P, _ = pointwise(split.shear, H)
    a, b, c = np.moveaxis(np.eye(3) + H, 1, 0)
    # ∂J/∂F; unlike J F⁻ᵀ it exists for every F.
    cofactor = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    theta, slope = split.strains(np.einsum("ni,ni->n", a, cofactor[:, 0]))
    return psi + p * theta - p**2 / (2 * split.bulk), P + (p * slope)[:, None, None] * cofactor


def _constants(split: Split, mesh: dolfinx.mesh.Mesh) -> Mapping[str, Any]:
    """The energy's values as one run-time constant, by name."""
    # An infinite weight of the λ part is no number to compute with; the strain does not read it.
    numbers = np.nan_to_num(np.array(split.energy.constants()), posinf=0.0)
    vector = fem.Constant(mesh, numbers)
    return split.energy.unpack([vector[i] for i in range(len(numbers))])
