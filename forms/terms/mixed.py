"""Π(u, p): a pressure of its own carries the λ part, so that ν may come near to one half, or be it."""

from functools import cached_property
from typing import Any, Literal

import basix
import basix.ufl
import dolfinx
import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray

from elastune.forms.kinematics import deformation_gradient
from elastune.forms.normalize import linearize
from elastune.forms.spectral import pointwise
from elastune.forms.terms.potential import Loads, Potential
from elastune.forms.volumetric import Split

Array = NDArray[np.float64]


class MixedPotential(Potential):
    """Π(u, p; t) = ∫W(F) + p (J - 1) - U*(p) dX and the loads, U* the Legendre transform of λU(J).

    It is least in u and greatest in p; eliminating p point by point gives back ψ. For U = (J - 1)²/2 it is the
    perturbed Lagrangian, U* = p²/(2λ). For any U it is linear in J: the pressures see each cell's true volume,
    and with 1/λ = 0 they keep it. A pressure times ln J, say, would keep the mean of ln J, and let single
    quadrature points collapse.

    What `Potential` lists contains the pressure's share. Signs: p is positive under tension.

    Attributes:
        p: The pressure that all forms read; call `pressure_changed` when it does.
        shear_modulus: μ_Lamé, the scale of what the pressure meets.
        volume_strain: ∂Π/∂p, a form over the pressures: zero where J has the mean that p asks for.
        coupling: ∂²Π/∂p∂u, rows of pressures.
        coupling_transposed: ∂²Π/∂u∂p, rows of displacements.
        compliance: ∂²Π/∂p², not positive, zero at ν = 0.5.
        mass: ∫p q dX.
        stretching: `share` times μ ∫∇u : ∇v dX, positive definite whatever the state.
        share: A constant of `stretching`.

    Reference:
        Sussman & Bathe 1987, Computers & Structures 26:357; Brink & Stein 1996, Computational Mechanics 19:105.
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
            split: The energy, its λ part a function of J.
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
        self._split, self._degree = split, quadrature_degree

        J = ufl.det(deformation_gradient(u))
        stored, ratio, compliance = self._conjugate
        force = ufl.derivative(p * J * dx, u, v)
        strain = (J - ratio) * q * dx
        self.strain_energy = [*self.strain_energy, fem.form((p * (J - 1) - stored) * dx)]
        self.internal = [*self.internal, fem.form(force)]
        self.tangent = [*self.tangent, fem.form(ufl.derivative(force, u, w))]
        self.volume_strain = fem.form(strain)
        self.coupling = fem.form(ufl.derivative(strain, u, w))
        self.coupling_transposed = fem.form(ufl.derivative(force, p, r))
        self.compliance = fem.form(-compliance * r * q * dx)
        self.mass = fem.form(r * q * dx)
        self.share = fem.Constant(V.mesh, 0.0)
        self.stretching = fem.form(self.share * self.shear_modulus * ufl.inner(ufl.grad(v), ufl.grad(w)) * dx)

    @cached_property
    def _conjugate(self) -> tuple[Any, Any, Any]:
        """What `Split.conjugate` gives: in closed form where there is one, else values at quadrature points."""
        mesh = self.p.function_space.mesh
        if self._split.quadratic:
            compliance = fem.Constant(mesh, 1 / self._split.bulk)
            return compliance * self.p**2 / 2, 1 + compliance * self.p, compliance
        element = basix.ufl.quadrature_element(mesh.basix_cell(), degree=self._degree)
        space = fem.functionspace(mesh, element)
        return fem.Function(space), fem.Function(space), fem.Function(space)

    def pressure_changed(self) -> None:
        """Updates what depends on the pressure at the quadrature points."""
        if self._split.quadratic:
            return
        Q = self.p.function_space
        points, _ = basix.make_quadrature(Q.mesh.basix_cell(), self._degree)
        basis = Q.element.basix_element.tabulate(0, points)[0, :, :, 0]
        pressures = self.p.x.array[Q.dofmap.list] @ basis.T
        for function, values in zip(self._conjugate, self._split.conjugate(pressures), strict=True):
            function.x.array[function.function_space.dofmap.list] = values


def mixed_response(split: Split, H: Array, p: Array) -> tuple[Array, Array]:
    """W + p (J - 1) - U*(p) and its derivative in F, by the code that assembles W.

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
    J = np.einsum("ni,ni->n", a, cofactor[:, 0])
    return psi + p * (J - 1) - split.conjugate(p)[0], P + p[:, None, None] * cofactor
