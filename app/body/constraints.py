"""Prescribed displacements: which degrees of freedom, and where they are at a load."""

from typing import Any

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from elastune.app.errors import SceneError
from elastune.app.scene.schema import Condition, Rotation, Scene
from elastune.geometry import Geometry

Array = NDArray[np.float64]


class Constraints:
    """The faces and points of a scene that hold the body.

    Attributes:
        held: Mask of the prescribed degrees of freedom, owned and ghost.
        conditions: dolfinx's view of them, for assembly; they prescribe `motion`.
        motion: Any displacement; dolfinx reads it where it is prescribed.
        faces: Nodes on this rank, owned and ghost, of the faces that hold.
    """

    def __init__(self, scene: Scene, geometry: Geometry, V: fem.FunctionSpace) -> None:
        """Finds them.

        Raises:
            SceneError: If a point that the start pins is no node.
        """
        self._scene, self._geometry, self._V, self._d = scene, geometry, V, V.dofmap.index_map_bs
        self.motion = fem.Function(V)
        self.held = np.zeros(len(self.motion.x.array), dtype=bool)
        self.conditions: list[Any] = []
        self.faces: dict[str, NDArray[np.int32]] = {}
        for face, condition in self._by_precedence():
            nodes = fem.locate_dofs_topological(V, geometry.mesh.topology.dim - 1, geometry.facets(face))
            self.faces[face] = nodes
            if condition.kind == "roller":
                self._guide(face, condition)
            else:
                self._hold(nodes)
        pins = self._pinned()
        if geometry.mesh.comm.allreduce(len(pins)):
            self._hold(pins)

    def _hold(self, nodes: NDArray[np.int32]) -> None:
        self.conditions.append(fem.dirichletbc(self.motion, nodes))
        self.held[self._components(nodes)] = True

    def _guide(self, face: str, condition: Condition) -> None:
        geometry = self._geometry
        for axis in condition.roller or ():
            i = "xyz".index(axis)
            component = self._V.sub(i)
            dofs = fem.locate_dofs_topological(component, geometry.mesh.topology.dim - 1, geometry.facets(face))
            self.conditions.append(fem.dirichletbc(np.float64(0.0), dofs, component))
            self.held[self.faces[face] * self._d + i] = True

    def _components(self, nodes: NDArray[np.int32]) -> NDArray[np.int64]:
        """Degrees of freedom of nodes, all components."""
        return (nodes[:, None] * self._d + np.arange(self._d)).ravel()

    def _pinned(self) -> NDArray[np.int32]:
        """Nodes on this rank, owned and ghost, at the points that the start pins."""
        points, comm = self._V.tabulate_dof_coordinates()[:, : self._d], self._geometry.mesh.comm
        found: list[NDArray[np.int32]] = [np.empty(0, dtype=np.int32)]
        for pin in self._scene.start.pins if self._scene.start is not None else []:
            distance = np.linalg.norm(points - np.array(pin), axis=1)
            farthest = max(comm.allgather(float(distance.max(initial=0.0))))
            nodes = np.flatnonzero(distance < 1e-6 * farthest)
            if not comm.allreduce(len(nodes)):
                raise SceneError(f"start.pins: {pin} is no node of the mesh")
            found.append(nodes.astype(np.int32))
        return np.concatenate(found)

    def _by_precedence(self) -> list[tuple[str, Condition]]:
        """Conditions that hold, weakest first: at a shared edge a clamp wins over a motion over a roller."""
        rank = ("roller", "rotate", "move", "fix")
        holding = [(face, c) for face, c in self._scene.boundary.items() if c.holds]
        return sorted(holding, key=lambda item: rank.index(item[1].kind))

    def displacements(self, load: float) -> Array:
        """Displacements at a load factor, owned and ghost: right where `held`, zero elsewhere."""
        values = np.zeros_like(self.motion.x.array)
        points = self._V.tabulate_dof_coordinates()
        for face, condition in self._by_precedence():
            nodes = self.faces[face]
            if condition.kind == "roller":
                for axis in condition.roller or ():
                    values[nodes * self._d + "xyz".index(axis)] = 0.0
                continue
            motion = prescribed_motion(condition, points[nodes], load)
            values[self._components(nodes)] = motion[:, : self._d].ravel()
        return values


def prescribed_motion(condition: Condition, points: Array, load: float) -> Array:
    """Displacements of points, shape (n, 3), under a condition at a load factor."""
    motion = np.zeros_like(points)
    if condition.move is not None:
        motion[:, : len(condition.move)] = load * np.array(condition.move)
    elif condition.rotate is not None:
        angle = np.deg2rad(load * condition.rotate.angle)
        motion = rotated(condition.rotate, points, np.full(len(points), angle))
    return motion


def rotated(rotation: Rotation, points: Array, angles: Array) -> Array:
    """Displacements of points, shape (n, 3), that turn by angles in radians, shape (n,)."""
    axis = np.array(rotation.axis) / np.linalg.norm(rotation.axis)
    arm = points - np.pad(rotation.center, (0, 3 - len(rotation.center)))
    # Rodrigues' formula, with 1 - cos as 2 sin² to keep small rotations exact.
    turned = np.cross(axis, arm)
    again = np.cross(axis, turned)
    return np.sin(angles)[:, None] * turned + 2 * np.sin(angles / 2)[:, None] ** 2 * again
