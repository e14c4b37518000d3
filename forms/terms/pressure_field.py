"""A pressure of its own carries the λ part, so that ν may come near to one half, or be it."""

from typing import Any

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray

from elastune.forms.kinematics import deformation_gradient
from elastune.forms.spectral import stress
from elastune.forms.terms.domain import Domain
from elastune.forms.terms.term import Fields, Term
from elastune.forms.volumetric import Split

Array = NDArray[np.float64]


class PressureField(Term):
    """∫p (J - 1) - U*(p) dX, U* the Legendre transform of λU(J).

    With the μ part beside it, Π is least in u and greatest in p; eliminating p point by point gives back ψ. For
    U = (J - 1)²/2 it is the perturbed Lagrangian, U* = p²/(2λ). For any U it is linear in J: the pressures see each
    cell's true volume, and with 1/λ = 0 they keep it. A pressure times ln J, say, would keep the mean of ln J, and
    let single quadrature points collapse.

    The residual in p is the volume strain that is left, J less the ratio that p asks for; p is positive under
    tension. The tangent's ("p", "p") is not positive, and zero at ν = 0.5.

    Attributes:
        mass: ∫p q dX, a form.

    Reference:
        Sussman & Bathe 1987, Computers & Structures 26:357; Brink & Stein 1996, Computational Mechanics 19:105.
    """

    internal = True

    def __init__(self, split: Split, fields: Fields, domain: Domain, name: str = "pressure_field") -> None:
        """Compiles the forms.

        Args:
            split: The energy, its λ part a function of J.
            fields: Displacement and pressure.
            domain: What is integrated over.
            name: What people call it.
        """
        u, p = fields
        assert p is not None
        V, Q, dx = u.function_space, p.function_space, domain.dx()
        v, w, q, r = ufl.TestFunction(V), ufl.TrialFunction(V), ufl.TestFunction(Q), ufl.TrialFunction(Q)
        self._conjugate = Conjugate(split, p, domain.degree)
        stored, ratio, compliance = self._conjugate.expressions
        J = ufl.det(deformation_gradient(u))
        force = ufl.derivative(p * J * dx, u, v)
        strain = (J - ratio) * q * dx
        super().__init__(
            name,
            fem.form((p * (J - 1) - stored) * dx),
            {"u": fem.form(force), "p": fem.form(strain)},
            {
                ("u", "u"): [fem.form(ufl.derivative(force, u, w))],
                ("u", "p"): [fem.form(ufl.derivative(force, p, r))],
                ("p", "u"): [fem.form(ufl.derivative(strain, u, w))],
                ("p", "p"): [fem.form(-compliance * r * q * dx)],
            },
        )
        self.mass = fem.form(r * q * dx)

    def refresh(self) -> None:
        """Updates what depends on the pressure at the quadrature points."""
        self._conjugate.refresh()


class Conjugate:
    """U*(p) with its derivatives: in closed form where there is one, else as values at quadrature points.

    Attributes:
        expressions: Energy stored, volume ratio, and its derivative, see `Split.conjugate`.
    """

    def __init__(self, split: Split, p: fem.Function, degree: int) -> None:
        """Makes the expressions; `refresh` fills those that are values."""
        self._split, self._p, self._degree = split, p, degree
        self._last: Array | None = None
        mesh = p.function_space.mesh
        if split.quadratic:
            compliance = fem.Constant(mesh, 1 / split.bulk)
            self.expressions: tuple[Any, Any, Any] = compliance * p**2 / 2, 1 + compliance * p, compliance
        else:
            space = fem.functionspace(mesh, basix.ufl.quadrature_element(mesh.basix_cell(), degree=degree))
            self.expressions = fem.Function(space), fem.Function(space), fem.Function(space)

    def refresh(self) -> None:
        """Solves λU'(J) = p at every point, unless the pressures are still those of the last call."""
        if self._split.quadratic or (self._last is not None and np.array_equal(self._last, self._p.x.array)):
            return
        Q = self._p.function_space
        points, _ = basix.make_quadrature(Q.mesh.basix_cell(), self._degree)
        basis = Q.element.basix_element.tabulate(0, points)[0, :, :, 0]
        pressures = self._p.x.array[Q.dofmap.list] @ basis.T
        for function, values in zip(self.expressions, self._split.conjugate(pressures), strict=True):
            function.x.array[function.function_space.dofmap.list] = values
        self._last = self._p.x.array.copy()


def mixed_response(split: Split, H: Array, p: Array) -> tuple[Array, Array]:
    """W + p (J - 1) - U*(p) and its derivative in F, by the code that assembles W.

    Args:
        split: The energy.
        H: F - I at points, shape (n, 3, 3).
        p: Pressure there, shape (n,).

    Returns:
        Energy density, shape (n,), and first Piola-Kirchhoff stress, shape (n, 3, 3).
    """
    psi, P = stress(split.shear, H)
    a, b, c = np.moveaxis(np.eye(3) + H, 1, 0)
    # ∂J/∂F; unlike J F⁻ᵀ it exists for every F.
    cofactor = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    J = np.einsum("ni,ni->n", a, cofactor[:, 0])
    return psi + p * (J - 1) - split.conjugate(p)[0], P + p[:, None, None] * cofactor
