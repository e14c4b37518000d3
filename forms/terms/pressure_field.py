"""A pressure of its own carries the λ part, so that ν may come near to one half, or be it."""

from collections.abc import Sequence
from typing import Any, NamedTuple

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


class Share(NamedTuple):
    """Cells of one energy.

    Attributes:
        split: The energy, its λ part a function of J.
        cells: Those of this rank; None for all.
    """

    split: Split
    cells: NDArray[np.int32] | None = None


class PressureField(Term):
    """∫p (J - 1) - U*(p) dX, U* the Legendre transform of λU(J).

    With the μ part beside it, Π is least in u and greatest in p; eliminating p point by point gives back ψ. For
    U = (J - 1)²/2 it is the perturbed Lagrangian, U* = p²/(2λ). For any U it is linear in J: the pressures see each
    cell's true volume, and with 1/λ = 0 they keep it. A pressure times ln J, say, would keep the mean of ln J, and
    let single quadrature points collapse.

    The residual in p is the volume strain that is left, J less the ratio that p asks for; p is positive under
    tension. The tangent's ("p", "p") is not positive, and zero at ν = 0.5.

    Of several energies each has the U* of its cells.

    Attributes:
        mass: ∫w p q dX, a form; w is set by `weigh`.

    Reference:
        Sussman & Bathe 1987, Computers & Structures 26:357; Brink & Stein 1996, Computational Mechanics 19:105.
    """

    internal = True

    def __init__(self, shares: Sequence[Share], fields: Fields, domain: Domain, name: str = "pressure_field") -> None:
        """Compiles the forms.

        Args:
            shares: One that is all of the body, or some that are.
            fields: Displacement and pressure.
            domain: What is integrated over.
            name: What people call it.
        """
        u, p = fields
        assert p is not None
        V, Q, dx = u.function_space, p.function_space, domain.dx()
        v, w, q, r = ufl.TestFunction(V), ufl.TrialFunction(V), ufl.TestFunction(Q), ufl.TrialFunction(Q)
        self._conjugate = Conjugate(shares, p, domain.degree)
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
        self._weight = ByCell(domain.mesh, shares)
        self.mass = fem.form(self._weight.number * r * q * dx)

    def weigh(self, weights: Sequence[float]) -> None:
        """Sets the weight of the mass, by share."""
        self._weight.set(weights)

    def refresh(self) -> None:
        """Updates what depends on the pressure at the quadrature points."""
        self._conjugate.refresh()


class ByCell:
    """A number for each share of a body.

    Attributes:
        number: A constant of one share, a function of several.
    """

    def __init__(self, mesh: Any, shares: Sequence[Share]) -> None:
        """Of the cells of the shares; zero until it is set."""
        self._shares = shares
        whole = len(shares) == 1
        self.number: Any = fem.Constant(mesh, 0.0) if whole else fem.Function(fem.functionspace(mesh, ("DG", 0)))

    def set(self, numbers: Sequence[float]) -> None:
        """Sets them, by share."""
        if len(self._shares) == 1:
            self.number.value = numbers[0]
        else:
            for (_, cells), number in zip(self._shares, numbers, strict=True):
                self.number.x.array[self.number.function_space.dofmap.list[cells]] = number


class Conjugate:
    """U*(p) with its derivatives: in closed form where there is one, else as values at quadrature points.

    Attributes:
        expressions: Energy stored, volume ratio, and its derivative, see `Split.conjugate`.
    """

    def __init__(self, shares: Sequence[Share], p: fem.Function, degree: int) -> None:
        """Makes the expressions; `refresh` fills those that are values."""
        self._shares, self._p, self._degree = shares, p, degree
        self._quadratic = all(share.split.quadratic for share in shares)
        self._last: Array | None = None
        mesh = p.function_space.mesh
        if self._quadratic:
            by_cell = ByCell(mesh, shares)
            by_cell.set([1 / share.split.bulk for share in shares])
            compliance = by_cell.number
            self.expressions: tuple[Any, Any, Any] = compliance * p**2 / 2, 1 + compliance * p, compliance
        else:
            space = fem.functionspace(mesh, basix.ufl.quadrature_element(mesh.basix_cell(), degree=degree))
            self.expressions = fem.Function(space), fem.Function(space), fem.Function(space)

    def refresh(self) -> None:
        """Solves λU'(J) = p at every point, unless the pressures are still those of the last call."""
        if self._quadratic or (self._last is not None and np.array_equal(self._last, self._p.x.array)):
            return
        Q = self._p.function_space
        points, _ = basix.make_quadrature(Q.mesh.basix_cell(), self._degree)
        basis = Q.element.basix_element.tabulate(0, points)[0, :, :, 0]
        pressures = self._p.x.array[Q.dofmap.list] @ basis.T
        for split, cells in self._shares:
            own = slice(None) if cells is None else cells
            for function, values in zip(self.expressions, split.conjugate(pressures[own]), strict=True):
                function.x.array[function.function_space.dofmap.list[own]] = values
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
