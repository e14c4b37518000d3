"""What a run leaves: fields against closed forms, files against the readers that people use, and every failure."""

import csv
import json
import logging
import math
import os
import subprocess
import sys
import typing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI

from app import plots
from app import scene as scenes
from app.errors import SceneError, UserError
from app.fields import CELL_FIELDS, Fields
from app.output import Output
from app.results import Failure, Step, Summary
from app.xdmf import FieldFile, WholeMesh, replace_text
from forms.materials import make
from geometry import build

ALL = ["displacement", "J", "von_mises", "stretches", "energy", "stress"]
LAM, MU = 0.7, 0.4
SHEARED = np.array([[1.3, 0.2, -0.1], [0.05, 0.8, 0.3], [0.1, -0.2, 1.1]])

# Cell, its order, and the degree of the displacement: equal, higher and lower.
CASES = [
    *[(cell, order, order) for cell in ("tetrahedron", "hexahedron", "triangle", "quadrilateral") for order in (1, 2)],
    *[("tetrahedron", 1, 3), ("hexahedron", 1, 2), ("hexahedron", 2, 1), ("quadrilateral", 2, 3)],
]


def _displacement(cell: str, order: int, degree: int, F: np.ndarray, comm: Any = MPI.COMM_SELF) -> fem.Function:
    """U = (F - I) X on two by two cells."""
    shape = "cube" if cell in ("tetrahedron", "hexahedron") else "square"
    mesh = build(comm, shape=shape, cells=2, cell=cell, order=order).mesh
    d = mesh.geometry.dim
    u = fem.Function(fem.functionspace(mesh, ("Lagrange", degree, (d,))))
    u.interpolate(lambda x: (F - np.eye(3))[:d, :d] @ x[:d])
    return u


def _plane(F: np.ndarray, d: int) -> np.ndarray:
    """F in three dimensions, F in its plane in two."""
    G = np.eye(3)
    G[:d, :d] = F[:d, :d]
    return G


def _neo_hookean(F: np.ndarray) -> dict[str, Any]:
    J = np.linalg.det(F)
    C = F.T @ F
    sigma = (MU * (F @ F.T - np.eye(3)) + LAM * math.log(J) * np.eye(3)) / J
    principal = np.linalg.eigvalsh(sigma)
    return {
        "J": J,
        "stretches": np.sqrt(np.linalg.eigvalsh(C))[::-1],
        "energy": MU / 2 * (np.trace(C) - 3) - MU * math.log(J) + LAM / 2 * math.log(J) ** 2,
        "stress": sigma,
        "von_mises": math.sqrt(sum((principal[i] - principal[i - 1]) ** 2 for i in range(3)) / 2),
    }


# ---------------------------------------------------------------- fields


def test_registry_has_what_a_scene_may_ask_for() -> None:
    annotation = scenes.Output.model_fields["fields"].annotation
    allowed = typing.get_args(typing.get_args(annotation)[0])
    assert sorted(allowed) == sorted(["displacement", *CELL_FIELDS])
    assert sorted(allowed) == sorted(ALL)


@pytest.mark.parametrize(("cell", "order", "degree"), CASES)
def test_fields_of_a_uniform_deformation(cell: str, order: int, degree: int) -> None:
    u = _displacement(cell, order, degree, SHEARED)
    mesh = u.function_space.mesh
    F = _plane(SHEARED, mesh.geometry.dim)
    fields = Fields(u, make("neo-hookean", lam=LAM, mu=MU), None, None)
    cells = fields.cells(CELL_FIELDS)
    for name, expected in _neo_hookean(F).items():
        values = cells[name]
        assert len(values) == mesh.topology.index_map(mesh.topology.dim).size_local
        np.testing.assert_allclose(values, np.broadcast_to(expected, values.shape), atol=2e-12, err_msg=name)
    np.testing.assert_allclose(fields.displacement(), mesh.geometry.x @ (F - np.eye(3)).T, atol=1e-13)
    corners = [x for x in mesh.geometry.x if set(x) <= {0.0, 1.0}]
    largest = max(np.linalg.norm((F - np.eye(3)) @ x) for x in corners)
    assert fields.largest_displacement() == pytest.approx(largest, abs=1e-13)


def test_only_what_is_asked_for_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*arguments: Any, **options: Any) -> None:
        raise AssertionError("the kernel was called")

    monkeypatch.setattr("app.fields.pointwise", never)
    fields = Fields(_displacement("hexahedron", 1, 1, SHEARED), make("neo-hookean"), None, None)
    assert list(fields.cells(["J", "stretches"])) == ["J", "stretches"]
    with pytest.raises(AssertionError):
        fields.cells(["energy"])


def test_average_of_J_is_the_ratio_of_volumes(monkeypatch: pytest.MonkeyPatch) -> None:
    """On curved cells, whose points carry different volumes, and in several blocks."""
    monkeypatch.setattr("app.fields.BLOCK", 100)
    mesh = build(MPI.COMM_SELF, shape="cylinder", size=[0.5, 1.0], cells=4, order=2).mesh
    x, nodes = mesh.geometry.x, mesh.geometry.dofmap
    rest = _volumes(x[nodes], mesh)
    u = fem.Function(fem.functionspace(mesh, ("Lagrange", 2, (3,))))
    u.interpolate(lambda x: [0.3 * x[0] * x[1], 0.2 * x[0] ** 2 + 0.1 * x[2], -0.2 * x[2] ** 2])
    fields = Fields(u, make("neo-hookean"), None, 8)
    deformed = _volumes((x + fields.displacement())[nodes], mesh)
    assert np.ptp(deformed / rest) > 0.1
    np.testing.assert_allclose(fields.cells(["J"])["J"], deformed / rest, rtol=1e-12)


def _volumes(nodes: np.ndarray, mesh: Any) -> np.ndarray:
    """Volumes of cells from the coordinates of their nodes, shape (cells, nodes, 3)."""
    import basix

    element = mesh.ufl_domain().ufl_coordinate_element().basix_element
    points, weights = basix.make_quadrature(element.cell_type, 9)
    gradients = element.tabulate(1, points)[1:, :, :, 0]
    jacobians = np.einsum("dpn,cnx->cpxd", gradients, nodes)
    return np.linalg.det(jacobians) @ weights


def test_inverted_cells_have_a_negative_stretch_and_collapsed_ones_no_warning() -> None:
    for last, energy in ((-0.5, "stable-neo-hookean"), (0.0, "stable-neo-hookean")):
        u = _displacement("tetrahedron", 1, 1, np.diag([2.0, 1.5, last]))
        cells = Fields(u, make(energy), None, None).cells(CELL_FIELDS)
        np.testing.assert_allclose(cells["stretches"], np.tile([2.0, 1.5, last], (48, 1)), atol=1e-13)
        assert np.isfinite(cells["energy"]).all()


def test_energy_of_the_small_strain() -> None:
    u = _displacement("hexahedron", 1, 1, SHEARED)
    cells = Fields(u, make("linear-elasticity", lam=LAM, mu=MU), None, None).cells(["energy", "stress"])
    strain = (SHEARED + SHEARED.T) / 2 - np.eye(3)
    P = LAM * np.trace(strain) * np.eye(3) + 2 * MU * strain
    np.testing.assert_allclose(cells["energy"], np.sum(P * strain) / 2, rtol=1e-12)
    expected = P @ SHEARED.T / np.linalg.det(SHEARED)
    np.testing.assert_allclose(cells["stress"], np.broadcast_to(expected, (8, 3, 3)), atol=1e-13)


# ---------------------------------------------------------------- the field file


def _write(folder: Path, u: fem.Function, times: tuple[float, ...] = (0.0, 0.5, 1.0)) -> None:
    """Steps t of the displacement t u, with all fields."""
    full = u.x.array.copy()
    fields = Fields(u, make("neo-hookean", lam=LAM, mu=MU), None, None)
    whole = WholeMesh(u.function_space.mesh)
    file = FieldFile(folder, whole) if u.function_space.mesh.comm.rank == 0 else None
    for time in times:
        u.x.array[:] = time * full
        nodes = {"displacement": whole.nodes_to_root(fields.displacement())}
        cells = {name: whole.cells_to_root(values) for name, values in fields.cells(CELL_FIELDS).items()}
        if file:
            file.write(time, nodes, cells)


Read = tuple[np.ndarray, np.ndarray, str, list[tuple[float, dict[str, np.ndarray]]]]


def _read_by_meshio(path: Path) -> Read:
    import meshio

    with meshio.xdmf.TimeSeriesReader(path) as reader:
        points, cells = reader.read_points_cells()
        steps = []
        for k in range(reader.num_steps):
            time, at_nodes, in_cells = reader.read_data(k)
            steps.append((time, at_nodes | {name: parts[0] for name, parts in in_cells.items()}))
    return points, cells[0].data, cells[0].type, steps


def _read_by_vtk(path: Path) -> Read:
    import pyvista

    if not hasattr(pyvista._vtk, "vtkXdmfReader"):
        pytest.skip("this VTK is built without the XDMF reader")
    reader = pyvista.get_reader(path)
    steps = []
    for time in reader.time_values:
        reader.set_active_time_value(time)
        grid = reader.read()
        steps.append((time, {**grid.point_data, **grid.cell_data}))
    (kind,) = grid.cells_dict
    names = {vtk: name.lower().replace("_", "") for name, vtk in ()}
    return grid.points, grid.cells_dict[kind], names.get(kind, str(kind)), steps


VTK_CELLS = {
    "tetra": "vtkTetra",
    "tetra10": "vtkQuadraticTetra",
    "hexahedron": "vtkHexahedron",
    "hexahedron27": "vtkTriQuadraticHexahedron",
    "triangle": "vtkTriangle",
    "triangle6": "vtkQuadraticTriangle",
    "quad": "vtkQuad",
    "quad9": "vtkBiQuadraticQuad",
}
