"""States: what is remembered of them, in files, and on other meshes and elements."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import made
from mpi4py import MPI

from elastune.app.body.states import prolongated, read, write
from elastune.app.body.unknowns import State
from elastune.app.errors import UserError
from elastune.app.run import start
from elastune.app.scene.read import load

PULL = ["solve.steps=2", "boundary.right.move=[0.3,0.0,0.0]"]


def body_of(*overrides: str, comm: Any = MPI.COMM_SELF) -> Any:
    return start(load("cube-pull", [*PULL, *overrides]), comm).body


@pytest.mark.parametrize("element", ["Q2", "P2", "P1", "Q3", "Q2-P1d", "P2-P1", "P1-bubble"])
def test_a_state_comes_back_from_its_file(element: str, tmp_path: Path) -> None:
    cell = "tetrahedron" if element.startswith("P") else "hexahedron"
    body = body_of("mesh.cells=2", f"mesh.cell={cell}", f"solve.element={element}")
    state = State(np.random.default_rng(1).normal(size=body.size), 0.7)
    write(body, state, tmp_path / "state.h5")
    found = read(body, tmp_path / "state.h5")
    np.testing.assert_array_equal(found.values, state.values)
    assert found.load == 0.7 and found.stamp != state.stamp


def test_files_of_others_are_refused(tmp_path: Path) -> None:
    body = body_of("mesh.cells=2", "solve.element=Q1")
    write(body, body.state, tmp_path / "state.h5")
    (tmp_path / "text.h5").write_text("no HDF5")
    for path, other in (
        ("state.h5", body_of("mesh.cells=3", "solve.element=Q1")),
        ("state.h5", body_of("mesh.cells=2", "solve.element=Q2")),
        ("text.h5", body),
        ("none.h5", body),
    ):
        with pytest.raises(UserError, match="expected") as error:
            read(other, tmp_path / path)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(("coarse", "fine"), [("Q1", "Q2"), ("Q2", "Q1"), ("Q2-P1d", "Q2-P1d")])
@pytest.mark.parametrize("cells", [2, 4])
def test_a_state_is_carried_to_another_mesh_and_element(coarse: str, fine: str, cells: int) -> None:
    """What both can represent, exactly; and a coarse solution is a start that saves Newton steps."""
    one = body_of("mesh.cells=2", f"solve.element={coarse}", "material.nu=0.4")
    two = body_of(f"mesh.cells={cells}", f"solve.element={fine}", "material.nu=0.4")
    affine = one.points @ np.array([[0.3, 0.1, 0.0], [0.0, -0.1, 0.2], [0.05, 0.0, 0.1]])
    carried = prolongated(State(one.layout.joined(affine.ravel()), 0.5), one, two)
    expected = two.points @ np.array([[0.3, 0.1, 0.0], [0.0, -0.1, 0.2], [0.05, 0.0, 0.1]])
    free = ~two.held[: two.layout.displacements]
    found = two.layout.split(carried.values)[0]
    assert np.abs(found - expected.ravel())[free].max() < 1e-12
    assert np.abs(found[~free] - two.prescribed(0.5)[~free]).max() == 0


def test_what_is_known_of_a_state_is_not_asked_for_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the last few; and not of a state whose material has changed."""
    body = made(load("cube-pull", ["mesh.cells=2"]))
    assembly, calls = body.assembly, []
    put = assembly._put
    monkeypatch.setattr(assembly, "_put", lambda state: calls.append(state.stamp) or put(state))
    states = [State(0.01 * k * np.ones(body.size), 1.0) for k in range(1, 4)]
    before = [(assembly.energy(state), assembly.residual(state)) for state in states]
    count = len(calls)
    again = [(assembly.energy(state), assembly.residual(state)) for state in states]
    assert len(calls) == count
    assert all(a[0] == b[0] and np.array_equal(a[1], b[1]) for a, b in zip(before, again, strict=True))
    body.parts[0].strain.parameters.value[:] *= 2
    assembly.forget()
    assert assembly.energy(states[0]) == pytest.approx(2 * before[0][0])
    with pytest.raises(ValueError, match="read-only"):
        states[0].values[0] = 1.0


@pytest.mark.parallel
def test_a_state_written_by_some_ranks_is_read_by_others(tmp_path: Path) -> None:
    """Written by all ranks, read by each alone, and the other way round."""
    comm = MPI.COMM_WORLD
    folder = Path(comm.bcast(str(tmp_path)))
    settings = ("mesh.cells=3", "solve.element=Q2-P1d", "material.nu=0.499")
    together, alone = body_of(*settings, comm=comm), body_of(*settings)

    def wave(body: Any) -> State:
        x = body.points
        bent = np.stack([np.sin(x[:, 1]), x[:, 0] * x[:, 2], np.cos(x[:, 0])], axis=1)
        return State(body.layout.joined(0.1 * bent.ravel()), 0.25)

    for writer, reader, path in ((together, alone, "a.h5"), (alone, together, f"b{comm.rank}.h5")):
        write(writer, wave(writer), folder / path)
        comm.barrier()
        found, expected = read(reader, folder / ("b0.h5" if reader is together else path)), wave(reader)
        assert np.abs(found.values - expected.values).max() < 1e-13
        assert found.load == 0.25
