"""What is recorded of a state, of a uniform deformation."""

import numpy as np
import pytest
from bodies import made

from elastune.app.body.unknowns import State
from elastune.app.results.measures import Measures
from elastune.app.scene.read import load

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
