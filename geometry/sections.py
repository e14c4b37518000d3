"""gmsh models of the shapes: a structured section, extruded layer by layer.

Everything is built at unit size, a square or a disc times unit height, because gmsh joins the layers of
an extrusion with absolute tolerances; `elastune.geometry.builder` stretches the mesh to its lengths afterwards.
Extruded tetrahedra conform across the blocks of the disc, where transfinite volumes would not.
"""

from __future__ import annotations

import math
from typing import Any

from elastune.geometry.grading import relative_sizes
from elastune.geometry.shapes import Plan

# Half diagonal of the core of the unit disc: cells of the core, the ring and the arc are of a size then.
CORE = 0.6
# Half the opening of the arcs that bound the core: three cells meet at its corners, at 120° each.
BULGE = math.radians(15)

# Names -> entities of the faces, and the entities of the cells.
Parts = tuple[dict[str, list[int]], list[int]]


def make_model(model: Any, plan: Plan) -> None:
    """Mesh a plan at unit size, its faces and its cells in physical groups.

    The tags of the faces count from 1 in the order of `plan.shape.faces`, that of the cells is 1.

    Args:
        model: An empty `gmsh.model`.
        plan: What to build.
    """
    dim, recombine = plan.shape.dim, plan.cell in ("hexahedron", "quadrilateral")
    faces, cells = _disc(model.geo, plan) if plan.round else _square(model.geo, plan)
    for surface in cells:
        model.geo.mesh.setTransfiniteSurface(surface)
        if recombine:
            model.geo.mesh.setRecombine(2, surface)
    if dim == 3:
        faces, cells = _extrude(model.geo, plan, cells, recombine)
    model.geo.synchronize()
    for tag, name in enumerate(plan.shape.faces, start=1):
        model.addPhysicalGroup(dim - 1, faces[name], tag, name)
    model.addPhysicalGroup(dim, cells, 1)
    model.mesh.generate(dim)
    if plan.order > 1:
        model.mesh.setOrder(plan.order)


def _square(geo: Any, plan: Plan) -> Parts:
    """Draw the unit square with a corner at the origin."""
    points = [geo.addPoint(x, y, 0) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    curves = [geo.addLine(points[i], points[(i + 1) % 4]) for i in range(4)]
    for i, curve in enumerate(curves):
        geo.mesh.setTransfiniteCurve(curve, plan.counts[i % 2] + 1)
    surface = geo.addPlaneSurface([geo.addCurveLoop(curves)])
    return {name: [curve] for name, curve in zip(_square_sides(plan), curves, strict=True)}, [surface]


def _square_sides(plan: Plan) -> tuple[str, str, str, str]:
    """Names of the sides of the square, counter-clockwise from y = 0."""
    (left, right), (low, high) = plan.shape.ends[:2]
    return str(low), right, high, str(left)


def _disc(geo: Any, plan: Plan) -> Parts:
    """Draw the unit disc about the origin: a core with four sides, and a ring of four blocks."""
    ring = plan.ring()
    core = plan.counts[0] - 2 * ring
    half = CORE / math.sqrt(2)
    middle = half * (1 / math.tan(BULGE) - 1)  # from the origin to the centre of an arc of the core
    corners = [(math.cos(angle), math.sin(angle)) for angle in (math.pi * (0.25 + 0.5 * i) for i in range(4))]
    normals = ((0, 1), (-1, 0), (0, -1), (1, 0))  # of the side from corner i to corner i + 1

    origin = geo.addPoint(0, 0, 0)
    centres = [geo.addPoint(-middle * x, -middle * y, 0) for x, y in normals]
    inner = [geo.addPoint(CORE * x, CORE * y, 0) for x, y in corners]
    outer = [geo.addPoint(x, y, 0) for x, y in corners]
    core_arcs = [geo.addCircleArc(inner[i], centres[i], inner[(i + 1) % 4]) for i in range(4)]
    side_arcs = [geo.addCircleArc(outer[i], origin, outer[(i + 1) % 4]) for i in range(4)]
    spokes = [geo.addLine(inner[i], outer[i]) for i in range(4)]

    for curve in core_arcs + side_arcs:
        geo.mesh.setTransfiniteCurve(curve, core + 1)
    sizes = relative_sizes(ring, end=plan.grade.get("side"))
    growth = sizes[1] / sizes[0] if ring > 1 else 1.0
    for curve in spokes:
        geo.mesh.setTransfiniteCurve(curve, ring + 1, "Progression", growth)

    loops = [core_arcs]
    loops += [[spokes[i], side_arcs[i], -spokes[(i + 1) % 4], -core_arcs[i]] for i in range(4)]
    return {"side": side_arcs}, [geo.addPlaneSurface([geo.addCurveLoop(loop)]) for loop in loops]


def _extrude(geo: Any, plan: Plan, section: list[int], recombine: bool) -> Parts:
    """Raise a section of four-sided surfaces to unit height."""
    surfaces, layers = [(2, tag) for tag in section], [plan.counts[-1]]
    tags = [tag for _, tag in geo.extrude(surfaces, 0, 0, 1, numElements=layers, recombine=recombine)]
    # For each surface its copy on top, the volume, and the walls over its four curves in order.
    tops, volumes, walls = tags[0::6], tags[1::6], [tags[i + 2 : i + 6] for i in range(0, len(tags), 6)]
    faces = {"bottom": section, "top": tops}
    if plan.round:
        return faces | {"side": [wall[1] for wall in walls[1:]]}, volumes
    return faces | {name: [wall] for name, wall in zip(_square_sides(plan), walls[0], strict=True)}, volumes
