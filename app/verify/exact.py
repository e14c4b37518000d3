"""Manufactured solutions: a displacement in closed form, the body force that it needs, and the errors against it."""

import math
from functools import cached_property
from typing import Any

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import Mesh
from mpi4py import MPI
from numpy.typing import NDArray

from elastune.app.body.body import Problem
from elastune.app.errors import SceneError
from elastune.app.scene.schema import Condition, Scene
from elastune.forms.elements import ELEMENTS
from elastune.forms.energy import Energy
from elastune.forms.normalize import linearize
from elastune.forms.spectral import pointwise
from elastune.forms.terms.mixed import mixed_response
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


def response(energy: Energy, H: Array) -> tuple[Array, Array, Array]:
    """ψ, P and ∂P/∂F at displacement gradients, shapes (n,), (n, 3, 3), (n, 9, 9), of any energy."""
    if energy.objective:
        return pointwise(energy, H)
    # Of the energies of the small strain there is one: the quadratic.
    at_rest = linearize(energy)
    eye = np.eye(3)
    symmetric = np.einsum("ik,jl->ijkl", eye, eye) + np.einsum("il,jk->ijkl", eye, eye)
    D = at_rest.lame_lambda * np.einsum("ij,kl->ijkl", eye, eye) + at_rest.lame_mu * symmetric
    P = np.einsum("ijkl,nkl->nij", D, H)
    return np.einsum("nij,nij->n", P, H) / 2, P, np.tile(D.reshape(9, 9), (len(H), 1, 1))


def body_force(energy: Energy, exact: Waves, X: Array) -> Array:
    """-div P at points: -∂P_iJ/∂F_kL ∂²u_k/∂X_L∂X_J, shape (n, 3)."""
    _, _, D = response(energy, exact.gradient(X))
    return -np.einsum("niJkL,nkLJ->ni", D.reshape(-1, 3, 3, 3, 3), exact.second_gradient(X))


class Manufactured(Problem):
    """A scene's body and material under the body force that makes a known displacement its solution.

    The whole boundary takes the exact displacement, in place of the scene's conditions and loads; at load t < 1
    both motion and force are scaled by t.
    """

    def __init__(self, scene: Scene, comm: MPI.Comm) -> None:
        """Builds the problem of the scene, and the body force beside it."""
        boundary = {face: Condition(fix=True) for face in face_names(scene.mesh.shape)}
        super().__init__(scene.model_copy(update={"boundary": boundary, "body": None}), comm)
        if not np.isfinite(self.energy.constants()).all():
            raise SceneError("material.nu = 0.5: expected less for a manufactured solution, which changes volume")
        self.exact = Waves(self.dimension)
        mesh, d = self.geometry.mesh, self.dimension
        degree = 2 * ELEMENTS[self.element].degree + 2
        element = basix.ufl.quadrature_element(mesh.basix_cell(), value_shape=(d,), degree=degree)
        force = fem.Function(fem.functionspace(mesh, element))
        X = Points(mesh, degree).coordinates()
        force.x.array[:] = body_force(self.energy, self.exact, X)[:, :d].ravel()
        dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": degree})
        work = -self.potential.load * ufl.inner(force, self.u) * dx
        self.potential.work.append(fem.form(work))
        self.potential.external.append(fem.form(ufl.derivative(work, self.u)))

    def prescribed(self, load: float) -> Array:
        """The exact displacement times the load at `held`, zero elsewhere."""
        motion = load * self.exact.displacement(self.V.tabulate_dof_coordinates())
        return np.where(self.held, self.joined(motion[:, : self.dimension].ravel()), 0.0)

    def errors(self) -> dict[str, float]:
        """Relative errors of the present state in L²: l2 of u, h1 of grad u, stress of P; energy and volume_ratio.

        Mixed elements have the error of the pressure too, and a stress that it makes a part of.
        """
        points = Points(self.geometry.mesh, 2 * ELEMENTS[self.element].degree + 4)
        X, weights = points.coordinates(), points.weights
        H, H_exact = points.gradient(self.u), self.exact.gradient(X)
        psi_exact, P_exact, _ = response(self.energy, H_exact)
        J, J_exact = (np.linalg.det(np.eye(3) + gradient) for gradient in (H, H_exact))
        pressures = {}
        if self.p is None or self.split is None:
            psi, P, _ = response(self.energy, H)
        else:
            p = points.evaluate(self.p, points.cells)[:, 0]
            psi, P = mixed_response(self.split, H, p)
            pressures = {"pressure": (p, self.split.bulk * self.split.derivatives(J_exact)[1])}

        def total(values: Array) -> float:
            return self.comm.allreduce(float(weights @ values))

        def error(values: Array, exact: Array) -> float:
            axes = tuple(range(1, exact.ndim))
            wrong, right = (total(np.square(field).sum(axis=axes)) for field in (values - exact, exact))
            return float(np.sqrt(wrong / right))

        return {
            "l2": error(points.values(self.u), self.exact.displacement(X)),
            "h1": error(H, H_exact),
            "stress": error(P, P_exact),
            "energy": abs(total(psi) / total(psi_exact) - 1),
            "volume_ratio": abs(total(J) / total(J_exact) - 1),
            **{name: error(*pair) for name, pair in pressures.items()},
        }


class Points:
    """Quadrature points of the cells of this rank, in the order of a quadrature element's values."""

    def __init__(self, mesh: Mesh, degree: int) -> None:
        """The rule that forms use at this degree."""
        self.mesh = mesh
        self.points, self._weights = basix.make_quadrature(mesh.basix_cell(), degree)
        topology = mesh.topology.index_map(mesh.topology.dim)
        self.cells = np.arange(topology.size_local + topology.num_ghosts, dtype=np.int32)
        self.owned = topology.size_local * len(self._weights)

    def evaluate(self, expression: Any, cells: NDArray[np.int32]) -> Array:
        """An expression at the points of cells, shape (points, components)."""
        values = fem.Expression(expression, self.points).eval(self.mesh, cells)
        return np.asarray(values).reshape(len(cells) * len(self._weights), math.prod(expression.ufl_shape))

    def coordinates(self) -> Array:
        """X, ghost cells included, shape (n, 3)."""
        return _padded(self.evaluate(ufl.SpatialCoordinate(self.mesh), self.cells))

    @cached_property
    def weights(self) -> Array:
        """Weights times the volume that they stand for; zero at the points of ghost cells."""
        volume = abs(self.evaluate(ufl.JacobianDeterminant(self.mesh), self.cells)[:, 0])
        weights = volume * np.tile(self._weights, len(self.cells))
        weights[self.owned :] = 0.0
        return weights

    def values(self, u: fem.Function) -> Array:
        """A vector field, shape (n, 3)."""
        return _padded(self.evaluate(u, self.cells))

    def gradient(self, u: fem.Function) -> Array:
        """The gradient of a vector field, shape (n, 3, 3)."""
        d = self.mesh.geometry.dim
        H = np.zeros((len(self.cells) * len(self._weights), 3, 3))
        H[:, :d, :d] = self.evaluate(ufl.grad(u), self.cells).reshape(-1, d, d)
        return H


def _padded(values: Array) -> Array:
    padded = np.zeros((len(values), 3))
    padded[:, : values.shape[1]] = values
    return padded
