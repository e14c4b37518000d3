"""The diagnosis of a state that no run leaves on purpose."""

import numpy as np
import pytest
from bodies import made

from elastune.app.body.unknowns import State
from elastune.app.results.diagnose import diagnose
from elastune.app.scene.read import load
from elastune.app.solvers.options import Options


def test_displacements_that_are_no_numbers_hide_nothing() -> None:
    """One node is lost: the other cells are told of, and sorted."""
    body = made(load("cube-pull", ["mesh.cells=3", "solve.element=Q1"]))
    values, x = np.zeros_like(body.state.values), body.points
    values[0] = np.nan
    # Another corner is pushed through the body.
    far = int(np.argmax(np.linalg.norm(x - x[0], axis=1)))
    values[3 * far : 3 * far + 3] = 2 * (x[0] - x[far])
    found = diagnose(body, Options(), State(values), "undefined")
    assert found["inverted_cells"] == 1
    assert found["J"][0] < 0 < 1 <= found["J"][1] < 100
    assert found["stretches"][0] > 0
    worst = [cell["J"] for cell in found["worst_cells"]]
    assert worst == sorted(worst)
    assert worst[0] == pytest.approx(found["J"][0])
    assert np.linalg.norm(np.array(found["worst_cells"][0]["center"]) - x[far]) < 0.4
