"""The closed form of plane strain against the kernel in three dimensions."""

import basix.ufl
import numpy as np
import pytest
from dolfinx import fem, mesh
from mpi4py import MPI

from elastune.forms import materials
from elastune.forms.energy import Energy
from elastune.forms.spectral import SpectralForms, pointwise

TURN = np.array([[0.8, -0.6], [0.6, 0.8]])
STATES = {
    "generic": np.array([[0.3, -0.2], [0.5, 0.1]]),
    "second stretch longer": np.array([[-0.2, 0.1], [0.3, 0.6]]),
    "small": 1e-10 * np.array([[0.3, -0.2], [0.5, 0.1]]),
    "isochoric and small": 1e-8 * np.array([[1.0, 0.5], [0.5, -1.0]]),
    "uniaxial and small": np.diag([0.0, 1e-9]),
    "rest": np.zeros((2, 2)),
    "equal": 1.4 * TURN - np.eye(2),
    "nearly equal": TURN @ np.diag([1.4, 1.4 + 1e-7]) - np.eye(2),
    "turned by half": np.diag([-2.1, -2.3]),
    "tiny": np.diag([1e-6, 1.3]) - np.eye(2),
    "inverted": TURN @ np.diag([-0.4, 1.3]) - np.eye(2),
    "inverted along an axis": np.diag([0.7, -0.5]) - np.eye(2),
    "rank one": np.diag([1.2, 0.0]) - np.eye(2),
}


def of_a_triangle(energy: Energy) -> SpectralForms:
    """Forms of the reference triangle."""
    element = basix.ufl.element("Lagrange", "triangle", 1, shape=(2,))
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    domain = mesh.create_mesh(MPI.COMM_SELF, np.array([[0, 1, 2]]), x=corners, e=element)
    return SpectralForms(energy, fem.Function(fem.functionspace(domain, ("Lagrange", 1, (2,)))))


def at(forms: SpectralForms, H: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """ψ, P and ∂P/∂F on the reference triangle, where the gradients of two nodes are the axes."""
    forms.u.interpolate(lambda x: H @ x[:2])
    energy = fem.assemble_scalar(forms.energy)
    residual = fem.assemble_vector(forms.residual).array.reshape(3, 2)
    tangent = fem.assemble_matrix(forms.tangent).to_dense().reshape(3, 2, 3, 2)
    nodes = [int(np.argmax(forms.u.function_space.tabulate_dof_coordinates()[:, i])) for i in range(2)]
    D = tangent[np.ix_(nodes, range(2), nodes, range(2))].transpose(1, 0, 3, 2)
    return 2 * energy, 2 * residual[nodes].T, 2 * D


@pytest.mark.parametrize("name", ["stable-neo-hookean", "linear-corotational", "linear-elasticity", "hencky"])
def test_closed_form(name: str) -> None:
    """To rounding of the largest entry, at rest and small strain too, wherever the energy is defined."""
    energy = materials.make(name)
    forms = of_a_triangle(energy)
    for state, H in STATES.items():
        if not energy.inverts and np.linalg.det(np.eye(2) + H) <= 0:
            continue
        solid = np.zeros((1, 3, 3))
        solid[0, :2, :2] = H
        for rule in ("none", "clamp"):
            forms.filter = rule
            psi, P, D = at(forms, H)
            psi3, P3, D3 = (value[0] for value in pointwise(energy, solid, filter=rule))
            D3 = D3.reshape(3, 3, 3, 3)[:2, :2, :2, :2]
            assert abs(psi - psi3) <= 3e-14 * abs(psi3), state
            assert np.abs(P - P3[:2, :2]).max() <= 2e-14 * np.abs(P3).max(), state
            if rule == "none":
                assert np.abs(D - D3).max() <= 1e-12 * np.abs(D3).max(), state
            else:
                # Not the same matrix: the third direction takes no part.
                assert np.linalg.eigvalsh(D.reshape(4, 4))[0] >= -1e-12 * np.abs(D).max(), state


@pytest.mark.parametrize("name", ["stable-neo-hookean", "linear-corotational"])
def test_collapsed(name: str) -> None:
    """A triangle that is a single point has a finite stress and tangent."""
    assert all(np.isfinite(value).all() for value in at(of_a_triangle(materials.make(name)), -np.eye(2)))
