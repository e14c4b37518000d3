"""Elastic foundations of faces."""

from collections.abc import Sequence

import numpy as np
import ufl
from dolfinx import fem

from elastune.forms.terms.domain import Domain
from elastune.forms.terms.term import Fields, Term


class Foundation(Term):
    """½ ∫ k_i u_i² dA: a spring along each axis, per rest area."""

    convex = True

    def __init__(self, fields: Fields, domain: Domain, face: str, stiffness: Sequence[float]) -> None:
        """Compiles the forms.

        Args:
            fields: Displacement.
            domain: What is integrated over.
            face: Its name.
            stiffness: Force per rest area and displacement along each axis, shape (d,).
        """
        u = fields.u
        v, w = ufl.TestFunction(u.function_space), ufl.TrialFunction(u.function_space)
        k, ds = fem.Constant(domain.mesh, np.array(stiffness, dtype=np.float64)), domain.ds(face)
        energy = sum(k[i] / 2 * u[i] ** 2 for i in range(len(u))) * ds
        force = sum(k[i] * u[i] * v[i] for i in range(len(u))) * ds
        tangent = sum(k[i] * w[i] * v[i] for i in range(len(u))) * ds
        super().__init__(f"spring {face}", fem.form(energy), {"u": fem.form(force)}, {("u", "u"): [fem.form(tangent)]})
