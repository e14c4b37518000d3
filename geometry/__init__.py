"""Meshes with named faces: gmsh's cube, box, cylinder, square and rectangle, and the user's own files and selectors.

    from elastune.geometry import build
    g = build(comm, shape="cylinder", size=[0.5, 2.0], cells=16, order=2)
    g.mesh, g.facets("top")

Importing this package loads neither dolfinx nor gmsh, so that a scene is checked in no time.
"""

from elastune.geometry.builder import build
from elastune.geometry.errors import GeometryError
from elastune.geometry.named import Geometry
from elastune.geometry.shapes import face_names

__all__ = ["Geometry", "GeometryError", "build", "face_names"]
