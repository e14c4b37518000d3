"""Pressure on the deformed faces, with the potential that it has where the faces' edges are held."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import ufl
from dolfinx import fem, la
from numpy.typing import NDArray

from elastune.forms.terms.domain import Domain
from elastune.forms.terms.term import Fields, Term

Array = NDArray[np.float64]

# Of a displacement without symmetry.
_WAVES, _PHASES = np.array([[1.7, 0.6, -1.1], [0.4, 1.9, 0.8], [-0.9, 1.3, 1.6]]), np.array([0.3, 1.1, 2.3])


class FollowerPressure(Term):
    """t p ∫n da over deformed faces, p positive into the body.

    On a closed face it is the derivative of t p times the volume V that the face encloses, V = ∫f(x)·n da for any
    field f of divergence one. On a face with edges the derivative of that integral has a part on the edges too,
    ∮(f × δx)·dx, which vanishes where an edge is held, and where it slides in a plane normal to an axis along which
    f is zero there: f = Σ wᵢ (xᵢ - cᵢ) eᵢ with Σ wᵢ = 1 is chosen so, if it can be. The pressure then has a potential
    and a symmetric tangent; otherwise it has neither.

    Attributes:
        conservative: Whether all its faces together have a potential.
    """

    def __init__(
        self,
        fields: Fields,
        domain: Domain,
        pressures: Mapping[str, float],
        held: NDArray[np.bool_],
        name: str = "follower_pressure",
    ) -> None:
        """Looks for a potential, and compiles the forms.

        Args:
            fields: Displacement.
            domain: What is integrated over.
            pressures: At full load, by name of the face.
            held: Mask of the prescribed displacements, owned and ghost.
            name: What people call it.
        """
        u, mesh = fields.u, domain.mesh
        v, w = ufl.TestFunction(u.function_space), ufl.TrialFunction(u.function_space)
        t = fem.Constant(mesh, 0.0)
        # Nanson: the deformed area vector is det(F) F^-T N dA, written as a cofactor, which exists for every F.
        F = ufl.Identity(len(u)) + ufl.grad(u)
        area = ufl.cofac(F) * ufl.FacetNormal(mesh)
        weighted = [(fem.Constant(mesh, float(p)), domain.ds(face)) for face, p in pressures.items()]
        force = sum(p * ufl.inner(area, v) * measure for p, measure in weighted)
        volume = _potential(u, area, force, weighted, held)
        super().__init__(
            name,
            None if volume is None else fem.form(t * volume),
            {"u": fem.form(t * force)},
            {("u", "u"): [fem.form(ufl.derivative(t * force, u, w))]},
            t,
        )
        self.conservative = volume is not None


def _potential(u: fem.Function, area: Any, force: Any, weighted: list[Any], held: NDArray[np.bool_]) -> Any:
    """Σ p (V - V at rest) as a UFL functional, or None if no field f makes one."""
    V, d = u.function_space, len(u)
    mesh, owned = V.mesh, V.dofmap.index_map.size_local * d
    weights, center = fem.Constant(mesh, np.full(d, 1.0 / d)), fem.Constant(mesh, np.zeros(d))
    X = ufl.SpatialCoordinate(mesh)

    def field(x: Any) -> Any:
        return ufl.as_vector([weights[i] * (x[i] - center[i]) for i in range(d)])

    volume = sum(
        p * (ufl.dot(field(X + u), area) - ufl.dot(field(X), ufl.FacetNormal(mesh))) * ds for p, ds in weighted
    )
    # What is left on the edges: the two differ nowhere else.
    edges = fem.form(ufl.derivative(volume, u, ufl.TestFunction(V)) - force)
    forces = fem.form(force)

    def at_random(form: fem.Form) -> Array:
        b = fem.assemble_vector(form)
        b.scatter_reverse(la.InsertMode.add)
        return b.array[:owned]

    # A state without symmetry, the same on any number of ranks: what vanishes there vanishes.
    kept, points = u.x.array.copy(), V.tabulate_dof_coordinates()
    low = np.min(mesh.comm.allgather(points.min(axis=0, initial=np.inf)), axis=0)
    size = float((np.max(mesh.comm.allgather(points.max(axis=0, initial=-np.inf)), axis=0) - low).max())
    waves = np.sin((points - low) / size @ _WAVES + _PHASES)
    u.x.array[:] = np.where(held, 0.0, 0.1 * size * waves[:, :d].ravel())
    try:
        free = ~held[:owned].reshape(-1, d)
        scale = np.sqrt(mesh.comm.allreduce(float(np.sum(at_random(forces) ** 2))))
        # Off any plane, f is zero nowhere on an edge.
        center.value[:] = (low - size * np.array([1.3, 2.1, 1.7]))[:d]
        edge = np.abs(at_random(edges)).reshape(-1, d).max(axis=1) > 1e-9 * scale
        planes = [
            _planes(mesh.comm, size, points[: len(free)][edge & free.any(axis=1) & ~free[:, i], i]) for i in range(d)
        ]
        usable = np.array([len(at) <= 1 for at in planes], dtype=float)
        if not usable.any():
            return None
        weights.value[:] = usable / usable.sum()
        center.value[:] = [at[0] if len(at) == 1 else 0.0 for at in planes]
        left = np.sqrt(mesh.comm.allreduce(float(np.sum(at_random(edges)[free.ravel()] ** 2))))
        return volume if left <= 1e-9 * scale else None
    finally:
        u.x.array[:] = kept


def _planes(comm: Any, size: float, coordinates: Array) -> Array:
    """The different ones of some coordinates on all ranks."""
    values = np.sort(np.concatenate(comm.allgather(coordinates)))
    return values[np.concatenate([[True], np.diff(values) > 1e-9 * size])] if len(values) else values
