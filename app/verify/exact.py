"""Manufactured solutions: a displacement in closed form, the body force that it needs, and the errors against it."""

from collections.abc import Callable
from dataclasses import dataclass

import basix
import basix.ufl
import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from elastune.app.body.conditions.motions import Motion
from elastune.app.errors import SceneError
from elastune.app.scene.build import build
from elastune.app.scene.schema import Scene, material_energy
from elastune.forms import response
from elastune.forms.elements import ELEMENTS
from elastune.forms.energy import Energy
from elastune.forms.points import Points
from elastune.forms.terms import DeadLoads, Domain, Fields, Term, mixed_response
from elastune.geometry import face_names

Array = NDArray[np.float64]

# u = A X + Σ a sin(k·X + φ) over three plane waves: amplitudes a, wave vectors k (rows), phases φ.
_LINEAR = np.array([[0.15, 0.06, 0.0], [-0.04, -0.06, 0.05], [0.03, 0.0, 0.04]])
_AMPLITUDES = np.array([[0.05, 0.02, -0.02], [-0.02, 0.04, 0.03], [0.02, -0.03, 0.04]])
_WAVES = np.array([[1.7, 1.3, 0.6], [-0.8, 2.1, 1.1], [1.2, -0.5, 1.9]])
_PHASES = np.array([0.3, 1.1, 2.3])


class Waves:
    """A smooth displacement of the unit cube with distinct principal stretches; in 2D its plane part."""

    def __init__(self, dimension: int) -> None:
        """For 2 or 3 dimensions; in 2D the third component and all change along z are left out."""
        mask = (np.arange(3) < dimension).astype(float)
        self.linear = _LINEAR * mask[:, None] * mask
        self.amplitudes = _AMPLITUDES * mask
        self.waves = _WAVES * mask

    def displacement(self, X: Array) -> Array:
        """The displacement at points, both of shape (n, 3)."""
        return X @ self.linear.T + np.sin(X @ self.waves.T + _PHASES) @ self.amplitudes

    def gradient(self, X: Array) -> Array:
        """∂u_i/∂X_J, shape (n, 3, 3)."""
        waves = np.einsum("nw,wi,wJ->niJ", np.cos(X @ self.waves.T + _PHASES), self.amplitudes, self.waves)
        return self.linear + waves

    def second_gradient(self, X: Array) -> Array:
        """∂²u_i/∂X_J∂X_K, shape (n, 3, 3, 3)."""
        sines = np.sin(X @ self.waves.T + _PHASES)
        return -np.einsum("nw,wi,wJ,wK->niJK", sines, self.amplitudes, self.waves, self.waves)


def body_force(energy: Energy, exact: Waves, X: Array) -> Array:
    """-div P at points: -∂P_iJ/∂F_kL ∂²u_k/∂X_L∂X_J, shape (n, 3)."""
    _, _, D = response.second(energy, exact.gradient(X))
    return -np.einsum("niJkL,nkLJ->ni", D.reshape(-1, 3, 3, 3, 3), exact.second_gradient(X))


@dataclass(frozen=True)
class Follows(Motion):
    """A displacement that is given as a function of places, and grows with the load.

    Attributes:
        displacement: From shape (n, 3) to shape (n, 3), at full load.
    """

    displacement: Callable[[Array], Array]

    def displacements(self, points: Array) -> Array:
        """Displacements of points, both of shape (n, 3)."""
        return self.displacement(points)


class Manufactured:
    """A scene's body and material under the body force that makes a known displacement its solution.

    The whole boundary takes the exact displacement, in place of the scene's conditions and loads; at load t < 1
    both motion and force are scaled by t.

    Attributes:
        body: The body.
        exact: Its displacement at full load.
    """

    def __init__(self, scene: Scene, comm: MPI.Comm) -> None:
        """Builds the body of the scene, and the body force beside it.

        Raises:
            SceneError: If the scene is impossible, or its material incompressible.
        """
        energy = material_energy(scene)
        if not np.isfinite(energy.constants()).all():
            raise SceneError("material.nu = 0.5: expected less for a manufactured solution, which changes volume")
        self.exact = Waves(scene.mesh.dimension or 3)
        follows = Follows(self.exact.displacement)

        def force(fields: Fields, domain: Domain) -> list[Term]:
            d, degree = domain.mesh.geometry.dim, 2 * (fields.u.function_space.element.basix_element.degree) + 2
            element = basix.ufl.quadrature_element(domain.mesh.basix_cell(), value_shape=(d,), degree=degree)
            function = fem.Function(fem.functionspace(domain.mesh, element))
            points = Points(domain.mesh, degree)
            X = points.coordinates(points.all)
            function.x.array[:] = body_force(energy, self.exact, X)[:, :d].ravel()
            return [DeadLoads(fields, domain, function, degree=degree)]

        conditions = dict.fromkeys(face_names(scene.mesh.shape), follows)
        self.body, _ = build(scene, comm, conditions=conditions, more=force)

    def errors(self) -> dict[str, float]:
        """Relative errors of the present state in L²: l2 of u, h1 of grad u, stress of P; energy and volume_ratio.

        Mixed elements have the error of the pressure too, and a stress that it makes a part of.
        """
        body = self.body
        points = Points(body.geometry.mesh, 2 * ELEMENTS[body.element].degree + 4)
        X, weights = points.coordinates(), points.volumes()
        H, H_exact = points.gradient(body.u), self.exact.gradient(X)
        (part,) = body.parts
        psi_exact, P_exact = response.first(part.energy, H_exact)
        J, J_exact = (np.linalg.det(np.eye(3) + gradient) for gradient in (H, H_exact))
        pressures = {}
        if body.p is None or part.split is None:
            psi, P = response.first(part.energy, H)
        else:
            p = points.evaluate(body.p)[:, 0]
            psi, P = mixed_response(part.split, H, p)
            pressures = {"pressure": (p, part.split.bulk * part.split.derivatives(J_exact)[1])}

        def total(values: Array) -> float:
            return body.comm.allreduce(float(weights @ values))

        def error(values: Array, exact: Array) -> float:
            axes = tuple(range(1, exact.ndim))
            wrong, right = (total(np.square(field).sum(axis=axes)) for field in (values - exact, exact))
            return float(np.sqrt(wrong / right))

        return {
            "l2": error(points.values(body.u), self.exact.displacement(X)),
            "h1": error(H, H_exact),
            "stress": error(P, P_exact),
            "energy": abs(total(psi) / total(psi_exact) - 1),
            "volume_ratio": abs(total(J) / total(J_exact) - 1),
            **{name: error(*pair) for name, pair in pressures.items()},
        }
