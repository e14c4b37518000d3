"""Faces and regions that selectors name, on shapes and files, on any number of ranks; what is refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from meshes import COMM, area, layers, size, write

from elastune.geometry import Geometry, GeometryError, build

pytestmark = pytest.mark.filterwarnings("ignore:dofmap is deprecated:DeprecationWarning")

DIAGONAL = {"plane": {"normal": [1, 1, 0], "point": [0.5, 0.5, 0.5]}}
# Arguments of `build`, the table, a selector, and the area or volume of what it selects.
FOUND: dict[str, tuple[dict[str, Any], str, dict[str, Any], float]] = {
    "plane": ({}, "faces", {"plane": "z", "at": 1.0}, 1),
    "inner plane": ({}, "faces", {"plane": "x", "at": 0.5}, 1),
    "plane in 2D": ({"shape": "square", "cell": "triangle"}, "faces", {"plane": "y", "at": 1.0}, 1),
    "oblique plane": ({"cell": "tetrahedron"}, "faces", DIAGONAL, math.sqrt(2)),
    "oblique plane, any length": (
        {"cell": "tetrahedron"}, "faces", {"plane": {"normal": [-7, -7, 0], "point": [0, 1, 9]}}, math.sqrt(2),
    ),
    "box": ({}, "faces", {"box": [[0, 0, 0], [0.5, 0.5, 1]]}, 0.5 * 0.5 * 2 + 0.5 * 2),
    "flat box": ({}, "faces", {"box": [[0, 0, 1], [0.5, 1, 1]]}, 0.5),
    "box in 2D": ({"shape": "square", "cell": "quadrilateral"}, "faces", {"box": [[0, 0], [0.5, 0.5]]}, 1),
    "sphere": ({}, "faces", {"sphere": {"center": [0, 0, 0], "radius": 0.4}}, 3 * 0.25**2),
    "cylinder": ({}, "faces", {"cylinder": {"axis": "z", "center": [0, 0, 5], "radius": 0.36}}, 2 * 0.25**2 + 2 * 0.25),
    "oblique cylinder": ({}, "faces", {"cylinder": {"axis": [0, 0, -3], "center": [0, 0, 5], "radius": 0.36}},
                         2 * 0.25**2 + 2 * 0.25),
    "all": ({}, "faces", {"all": True}, 6),
    "tag": ({}, "faces", {"tag": 2}, 1),
    "tolerance": ({}, "faces", {"plane": "z", "at": 0.9, "tolerance": 0.11}, 1),
    "all of a curved body": ({"shape": "cylinder", "size": [1.0, 2.0], "cells": 8, "order": 2}, "faces", {"all": True},
                             6 * math.pi),
    "side of a curved body": ({"shape": "cylinder", "size": [1.0, 2.0], "cells": 8, "order": 2}, "faces",
                              {"cylinder": {"axis": "z", "center": [0, 0, 0], "radius": 1.0}}, 6 * math.pi),
    "region, box": ({}, "regions", {"box": [[0, 0, 0], [0.5, 1, 1]]}, 0.5),
    "region, sphere": ({}, "regions", {"sphere": {"center": [0.5, 0.5, 0.5], "radius": 0.3}}, 0.125),
    "region, cylinder": ({}, "regions", {"cylinder": {"axis": "y", "center": [0, 0, 0], "radius": 0.2}}, 0.25**2),
    "region, all": ({}, "regions", {"all": True}, 1),
    "region in 2D": (
        {"shape": "square", "cell": "triangle"}, "regions", {"sphere": {"center": [0, 0], "radius": 9}}, 1,
    ),
}  # fmt: skip


def selected(case: str, scale: float = 1.0) -> None:
    """Build at a scale, and measure."""
    arguments, table, selector, value = FOUND[case]
    arguments = {"size": 1.0, "cells": 4} | arguments
    arguments["size"] = (scale * np.array(arguments["size"])).tolist()
    g = build(COMM, **arguments, **{table: {"it": scaled(selector, scale)}})
    dim = g.mesh.topology.dim
    found = area(g, "it") / scale ** (dim - 1) if table == "faces" else size(g, "it") / scale**dim
    assert found == pytest.approx(value, rel=1e-4 if "curved" in case else 1e-9)


def scaled(value: Any, by: float, key: str = "") -> Any:
    """A selector in another unit of length."""
    if isinstance(value, dict):
        return {name: scaled(each, by, name) for name, each in value.items()}
    if isinstance(value, list):
        return [scaled(each, by, key) for each in value]
    return value * by if key in ("at", "point", "box", "center", "radius") else value


@pytest.mark.parametrize("scale", [1.0, 1e-6, 1e4])
@pytest.mark.parametrize("case", FOUND)
def test_selected(case: str, scale: float) -> None:
    selected(case, scale)


@pytest.mark.parallel
@pytest.mark.parametrize("case", FOUND)
def test_selected_on_ranks(case: str) -> None:
    selected(case)


def overlapping() -> Geometry:
    """A cube with its skin, half of its top, and a plane through it."""
    faces = {
        "skin": {"all": True},
        "patch": {"box": [[0, 0, 1], [0.5, 1, 1]]},
        "cut": {"plane": "x", "at": 0.5},
        "top": {"plane": "z", "at": 1.0},
    }
    return build(COMM, cells=4, faces=faces, regions={"low": {"box": [[0, 0, 0], [1, 1, 0.5]]}})


def check_overlapping() -> None:
    g = overlapping()
    areas = {"skin": 6, "patch": 0.5, "cut": 1, "top": 1, "left": 1, "bottom": 1}
    assert {name: area(g, name) for name in areas} == pytest.approx(areas)
    assert {name: g.inside(name) for name in areas} == {name: name == "cut" for name in areas}
    for name in areas:
        np.testing.assert_array_equal(np.sort(np.concatenate([g.exterior(name), g.interior(name)])), g.facets(name))
        assert len(g.interior(name) if name != "cut" else g.exterior(name)) == 0
    # Tags are disjoint: those of a name measure it, too.
    import ufl
    from dolfinx import fem

    ds = ufl.Measure("ds", domain=g.mesh, subdomain_data=g.facet_tags)
    whole = fem.assemble_scalar(fem.form(fem.Constant(g.mesh, 1.0) * ds(g.faces["skin"])))
    assert COMM.allreduce(whole) == pytest.approx(6)
    assert size(g, "low") == pytest.approx(0.5)


def test_overlapping() -> None:
    check_overlapping()


@pytest.mark.parallel
def test_overlapping_on_ranks() -> None:
    check_overlapping()


def test_numbers_of_a_file(tmp_path: Path) -> None:
    """A number is that of a physical group, or else of an entity; both get the name that is asked for."""
    path = write(tmp_path, layers)
    g = build(COMM, "file", path=path, faces={"a": {"tag": 7}, "b": {"tag": 3}}, regions={"c": {"tag": 11}})
    assert (area(g, "a"), area(g, "b")) == (pytest.approx(1), pytest.approx(1))
    np.testing.assert_array_equal(g.facets("a"), g.facets("head"))
    np.testing.assert_array_equal(g.cells("c"), g.cells("hard"))
    with pytest.raises(
        GeometryError, match=r"tag = 99}: no group of surfaces of .*part.msh has this number; there are 1, 2"
    ):
        build(COMM, "file", path=path, faces={"a": {"tag": 99}})
    with pytest.raises(GeometryError, match="has another 'head'; expected a name of its own"):
        build(COMM, "file", path=path, faces={"head": {"tag": 8}})
    with pytest.raises(GeometryError, match=r"faces.head = .*: the mesh has another 'head'"):
        build(COMM, "file", path=path, faces={"head": {"plane": "x", "at": 0.0}})
    same = build(COMM, "file", path=path, faces={"head": {"plane": "x", "at": 2.0}})
    assert area(same, "head") == pytest.approx(1)
    with pytest.raises(GeometryError, match=r"expected 3 numbers, got 2, in 3D"):
        build(COMM, "file", path=path, faces={"a": {"box": [[0, 0], [1, 1]]}})


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        ({"a": {}}, "faces.a: expected one of tag, plane, box, sphere, cylinder, all, got none"),
        ({"a": 3}, "faces.a = 3: expected a selector"),
        ({"a": {"tag": 1, "all": True}}, "faces.a: expected one of .*, got tag and all"),
        ({"a": {"tag": 0}}, "faces.a.tag = 0: expected the number of a group"),
        ({"a": {"tag": 9}}, r"faces.a = {tag = 9}: no group of surfaces of cube has this number; there are 1, 2, 3"),
        ({"a": {"all": False}}, "faces.a.all = False: expected true"),
        ({"a": {"all": True, "at": 1}}, "faces.a.at: expected only all, tolerance with all"),
        ({"a": {"all": True, "tolerance": -1}}, "faces.a.tolerance = -1: expected a part of the body's extent"),
        ({"a": {"plane": "z"}}, "faces.a.at: missing; expected the plane's place along z"),
        ({"a": {"plane": "w", "at": 0}}, "faces.a.plane = 'w': expected x, y, z, or {normal, point}"),
        ({"a": {"plane": "z", "at": math.nan}}, "faces.a.at = nan"),
        ({"a": {"plane": {"normal": [0, 0, 0], "point": [0, 0, 0]}}}, "faces.a.plane.normal = .* other than zero"),
        ({"a": {"plane": {"normal": [0, 0, 1]}}}, "faces.a.plane = .*: expected {normal, point}"),
        ({"a": {"plane": {"normal": [0, 1], "point": [0, 0, 0]}}}, "faces.a.plane.normal = .*: expected 3 numbers"),
        ({"a": {"box": [[0, 0, 0]]}}, "faces.a.box = .*: expected two corners"),
        ({"a": {"box": [[1, 0, 0], [0, 1, 1]]}}, "faces.a.box = .*: expected the lower corner"),
        ({"a": {"sphere": {"center": [0, 0, 0], "radius": 0}}}, "faces.a.sphere.radius = 0: expected a positive"),
        ({"a": {"sphere": {"center": [0, 0, 0]}}}, "faces.a.sphere = .*: expected {center, radius}"),
        ({"a": {"cylinder": {"axis": "w", "center": [0, 0, 0], "radius": 1}}}, "faces.a.cylinder.axis = 'w'"),
        ({"a": {"plane": "z", "at": 2.0}}, r'faces.a = {plane = "z", at = 2.0}: no facet lies .* from \(0, 0, 0\) to'),
        ({"top": {"plane": "z", "at": 0.0}}, "faces.top = .*: the mesh has another 'top'"),
    ],
)  # fmt: skip
def test_impossible_selectors(faces: Any, message: str) -> None:
    with pytest.raises(GeometryError, match=message) as raised:
        build(COMM, cells=2, faces=faces)
    assert "\n" not in str(raised.value)


def test_regions_are_refused() -> None:
    with pytest.raises(GeometryError, match=r"regions.a.plane: a plane has no cells in it"):
        build(COMM, cells=2, regions={"a": {"plane": "z", "at": 0.0}})
    with pytest.raises(GeometryError, match=r"regions.a = .*: no cell lies there"):
        build(COMM, cells=2, regions={"a": {"sphere": {"center": [9, 9, 9], "radius": 1.0}}})
    with pytest.raises(GeometryError, match=r"faces.a.cylinder: not in 2D; a sphere is a disc there"):
        build(
            COMM, "square", cell="triangle", faces={"a": {"cylinder": {"axis": "z", "center": [0, 0], "radius": 1.0}}}
        )


def test_unknown_names_list_what_there_is() -> None:
    g = overlapping()
    with pytest.raises(GeometryError, match=r"face 'lid': expected one of left, right, .*, skin, patch, cut"):
        g.facets("lid")
    for find, kind in ((g.edges, "curve"), (g.vertices, "point")):
        with pytest.raises(GeometryError, match=f"{kind} 'lid': expected one of none: the mesh names none"):
            find("lid")
