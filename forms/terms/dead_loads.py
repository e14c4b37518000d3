"""Dead loads: forces per rest volume and rest area, which keep their direction."""

from collections.abc import Mapping
from typing import Any

import ufl
from dolfinx import fem

from elastune.forms.terms.domain import Domain
from elastune.forms.terms.term import Fields, Term


class DeadLoads(Term):
    """-t (∫b·u dX + ∫T·u dA): linear in u, so that its forces are integrated once."""

    linear = True

    def __init__(
        self,
        fields: Fields,
        domain: Domain,
        body: Any = None,
        tractions: Mapping[int, Any] | None = None,
        degree: int | None = None,
        name: str = "dead_loads",
    ) -> None:
        """Compiles the forces at full load.

        Args:
            fields: The displacement's space is what counts.
            domain: What is integrated over.
            body: Force per rest volume, an array of shape (d,) or a UFL vector, or None.
            tractions: Force per rest area, shape (d,), by number of the face.
            degree: Of the volume's quadrature, if not the domain's.
            name: What people call it.
        """
        mesh, v = domain.mesh, ufl.TestFunction(fields.u.function_space)
        work: Any = 0
        if body is not None:
            force = body if isinstance(body, ufl.core.expr.Expr) else fem.Constant(mesh, body)
            work += ufl.inner(force, v) * domain.dx(degree=degree)
        for tag, traction in (tractions or {}).items():
            work += ufl.inner(fem.Constant(mesh, traction), v) * domain.ds(tag)
        super().__init__(name, residual={"u": fem.form(-work)}, factor=fem.Constant(mesh, 0.0))
