"""Dead loads: forces that keep their direction, per rest volume and rest area, and at nodes."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray

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
        tractions: Mapping[str, Any] | None = None,
        degree: int | None = None,
        name: str = "dead_loads",
    ) -> None:
        """Compiles the forces at full load.

        Args:
            fields: The displacement's space is what counts.
            domain: What is integrated over.
            body: Force per rest volume, an array of shape (d,) or a UFL vector, or None.
            tractions: Force per rest area, likewise, by name of the face.
            degree: Of the volume's quadrature, if not the domain's.
            name: What people call it.
        """
        mesh, v = domain.mesh, ufl.TestFunction(fields.u.function_space)
        work: Any = 0
        if body is not None:
            work += ufl.inner(_vector(mesh, body), v) * domain.dx(degree=degree)
        for face, traction in (tractions or {}).items():
            work += ufl.inner(_vector(mesh, traction), v) * domain.ds(face)
        super().__init__(name, residual={"u": fem.form(-work)}, factor=fem.Constant(mesh, 0.0))


class NodalLoads(Term):
    """-t Σ f·u over nodes."""

    linear = True

    def __init__(self, fields: Fields, forces: NDArray[np.float64], name: str = "forces") -> None:
        """Takes the forces at full load.

        Args:
            fields: The displacement's space is what counts.
            forces: On the nodes of this rank, owned and ghost, shape (n, d); read where they are owned.
            name: What people call it.
        """
        V = fields.u.function_space
        super().__init__(name, factor=fem.Constant(V.mesh, 0.0))
        self._forces = -forces[: V.dofmap.index_map.size_local].ravel()

    def own_forces(self) -> Any:
        """At full load."""
        return self._forces


def _vector(mesh: Any, value: Any) -> Any:
    return value if isinstance(value, ufl.core.expr.Expr) else fem.Constant(mesh, value)
