"""What is recorded of a state, of a uniform deformation."""

import numpy as np
import pytest
from bodies import made, shipped
from dolfinx import fem
from mpi4py import MPI

from elastune import geometry
from elastune.app.body.unknowns import State
from elastune.app.errors import UserError
from elastune.app.results.measures import Measures
from elastune.app.results.quantities import Probes
from elastune.app.scene.read import load
from elastune.forms.elements import ELEMENTS
from elastune.forms.spaces import displacement_space

F = np.array([[1.3, 0.2, -0.1], [0.05, 0.8, 0.3], [0.1, -0.2, 1.1]])


@pytest.mark.parametrize("element", ["Q1", "Q2", "Q2-P1d"])
def test_measures_of_a_uniform_deformation(element: str) -> None:
    body = made(load("cube-pull", ["mesh.cells=2", f"solve.element={element}"]))
    values, points = body.state.values.copy(), body.points
    values[: points.size] = ((F - np.eye(3)) @ points.T).T.ravel()
    body.take(State(values))
    measures = Measures(body)
    assert measures.volume_ratio() == pytest.approx(np.linalg.det(F), rel=1e-12)
    assert measures.min_J() == pytest.approx(np.linalg.det(F), rel=1e-12)
    corners = [np.linalg.norm((F - np.eye(3)) @ x) for x in np.ndindex(2, 2, 2)]
    assert measures.largest_displacement() == pytest.approx(max(corners), rel=1e-12)
    values = body.state.values.copy()
    values[:3] = 50.0
    body.take(State(values))
    assert measures.largest_displacement() == pytest.approx(np.sqrt(3) * 50)
    assert measures.min_J() < np.linalg.det(F) - 1


PROBED = [
    ("cube", "hexahedron", "Q1", 1), ("cube", "tetrahedron", "P3", 1), ("cylinder", "hexahedron", "Q2", 1),
    ("cylinder", "hexahedron", "Q2", 2), ("cylinder", "tetrahedron", "P2", 2), ("square", "triangle", "P2-P1", 1),
]  # fmt: skip


def probe(shape: str, cell: str, element: str, order: int, comm: MPI.Comm) -> None:
    """A displacement that every element represents, asked for at points within, on edges, and just outside of cells."""
    size = {"cylinder": [1.0, 2.0]}.get(shape, 1.0)
    mesh = geometry.build(comm, shape=shape, cell=cell, size=size, cells=4, order=order)
    u, d = fem.Function(displacement_space(mesh.mesh, ELEMENTS[element])), mesh.mesh.geometry.dim
    u.interpolate(lambda x: ((F - np.eye(3)) @ x)[:d])
    points = {"centre": [0.5] * d, "within": [0.11, 0.23, 0.37][:d], "edge": [0.25, 0.5, 0.0][:d]}
    if shape == "cylinder":
        angle = 2 * np.pi * 0.03
        points["skin"] = [np.cos(angle), np.sin(angle), 0.7]
    found = Probes(u, points).displacements()
    for name, at in points.items():
        assert found[name] == pytest.approx(((F - np.eye(3))[:d, :d] @ at).tolist(), abs=1e-13)
    with pytest.raises(UserError, match=r"^points.far = \[1.5, .*\]: lies outside the body$"):
        Probes(u, {"far": [1.5] * d})
    with pytest.raises(UserError, match=rf"expected {d} coordinates"):
        Probes(u, {"flat": [0.1] * (5 - d)})


@pytest.mark.parametrize("case", PROBED, ids=str)
def test_points_are_where_they_are(case: tuple[str, str, str, int]) -> None:
    probe(*case, comm=MPI.COMM_SELF)


@pytest.mark.parallel
def test_points_on_all_ranks() -> None:
    for case in PROBED:
        probe(*case, comm=MPI.COMM_WORLD)


def test_points_of_a_scene() -> None:
    run = shipped(
        "cube-pull", "mesh.cells=2", "solve.steps=2", "output.points={tip=[1.0, 1.0, 1.0], middle=[0.5, 0.5, 0.5]}"
    )
    assert [record.displacement["tip"][0] for record in run.summary.steps] == pytest.approx([0.5, 1.0], abs=1e-12)
    # Of a body that is symmetric about its middle.
    assert run.history["displacement_middle"] == pytest.approx(np.array([[0.25, 0, 0], [0.5, 0, 0]]), abs=1e-9)
    row = run.summary.steps[-1].row()
    assert row["displacement_tip_x"] == run.summary.as_dict()["steps"][-1]["displacement"]["tip"][0]
    with pytest.raises(UserError, match=r"^cube-pull.toml: output.points.far = .* lies outside the body$"):
        shipped("cube-pull", "mesh.cells=2", "output.points={far=[2.0, 0, 0]}")
