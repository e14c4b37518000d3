"""Mesh files of every kind that people have: what is in them is found, on any number of ranks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dolfinx import la
from meshes import COMM, KINDS, area, count, degree, file_of, jacobians, length, size

from elastune.geometry import Geometry, build

pytestmark = pytest.mark.filterwarnings("ignore:dofmap is deprecated:DeprecationWarning")


def everywhere(g: Geometry, dim: int, indices: np.ndarray) -> np.ndarray:
    """Entities on this rank that their owners count in."""
    known = la.vector(g.mesh.topology.index_map(dim), 1, np.float64)
    known.array[indices[indices < g.mesh.topology.index_map(dim).size_local]] = 1
    known.scatter_forward()
    return np.flatnonzero(known.array)


def check(kind: str, folder: Path) -> None:
    """Volume, areas and volumes of names are those of the closed form; ghosts have the names of their owners."""
    what = KINDS[kind]
    g = build(COMM, "file", path=file_of(kind, folder), **what.arguments)
    dim = g.mesh.topology.dim
    assert g.volume() == pytest.approx(what.volume, rel=what.rel)
    assert (jacobians(g) > 0).all()
    for name, value in what.faces.items():
        assert area(g, name) == pytest.approx(value, rel=what.rel), name
    for name, value in what.regions.items():
        assert size(g, name) == pytest.approx(value, rel=what.rel), name
    for name, value in what.curves.items():
        assert length(g, name) == pytest.approx(value), name
    for name, number in what.points.items():
        assert count(g, 0, g.vertices(name)) == number
    for names, find, each in ((g.faces, g.facets, dim - 1), (g.regions, g.cells, dim)):
        for name in names:
            indices = find(name)
            assert indices.dtype == np.int32
            assert np.all(np.diff(indices) > 0)
            assert count(g, each, indices) > 0
            np.testing.assert_array_equal(indices, everywhere(g, each, indices))
    assert degree(g) == (2 if any(word in kind for word in ("second", "20", "64", "35", " 8", "10", "step")) else 1)


@pytest.mark.parametrize("kind", KINDS)
def test_kind(kind: str, tmp_path: Path) -> None:
    check(kind, tmp_path)


@pytest.mark.parallel
@pytest.mark.parametrize("kind", KINDS)
def test_kind_on_ranks(kind: str, tmp_path: Path) -> None:
    check(kind, tmp_path)
