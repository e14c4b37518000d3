"""Prescribed displacements: which degrees of freedom, and where they are at a load."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from elastune.app.body.conditions.motions import Motion
from elastune.app.body.conditions.places import Place
from elastune.app.body.conditions.stages import Stage, shares
from elastune.app.errors import UserError
from elastune.geometry import Geometry

Array = NDArray[np.float64]
Nodes = NDArray[np.int32]

# Of the largest displacement: two that differ by less are the same.
SAME = 1e-9


@dataclass(frozen=True)
class Held:
    """A place that moves as prescribed, by one motion.

    Attributes:
        place: Where.
        ends: The motion at the end of each stage.
        nodes: On this rank, owned and ghost.
        components: That are prescribed.
    """

    place: Place
    ends: tuple[Motion, ...]
    nodes: Nodes
    components: tuple[int, ...]

    def displacements(self, points: Array, load: float) -> Array:
        """Of its nodes, shape (n, components), from the places of all nodes at rest."""
        share = shares(load, len(self.ends))
        return type(self.ends[0]).between(self.ends, share, points[self.nodes])[:, self.components]


class Constraints:
    """The places that hold a body.

    Attributes:
        parts: What holds it where.
        held: Mask of the prescribed degrees of freedom, owned and ghost.
        conditions: dolfinx's view of them, for assembly; they prescribe `increment`.
        increment: Any displacement; dolfinx reads it where it is prescribed.
        faces: Nodes on this rank, owned and ghost, of the places that hold, by name.
        supports: Degrees of freedom held beside, on this rank, to keep a free body in its place.
    """

    def __init__(self, geometry: Geometry, V: fem.FunctionSpace, stages: Sequence[Stage]) -> None:
        """Finds them; collective.

        Args:
            geometry: With the named places.
            V: Displacement space.
            stages: What happens at the ends of all stages.

        Raises:
            UserError: If there is no such place, or one displacement is prescribed twice and differently.
        """
        self._V, self._d = V, V.dofmap.index_map_bs
        self.increment = fem.Function(V)
        self.held = np.zeros(len(self.increment.x.array), dtype=bool)
        self.conditions: list[Any] = []
        self.faces: dict[str, Nodes] = {}
        self.supports: NDArray[np.int32] = np.empty(0, dtype=np.int32)
        self.parts: list[Held] = []
        for place, conditions in stages[0].items():
            for kind in [type(condition) for condition in conditions if isinstance(condition, Motion)]:
                ends = tuple(next(c for c in stage[place] if type(c) is kind) for stage in stages)
                nodes = place.nodes(geometry, V)
                assert all(isinstance(end, Motion) for end in ends)
                components = tuple(ends[0].components(self._d))  # type: ignore[attr-defined]
                self.parts.append(Held(place, ends, nodes, components))  # type: ignore[arg-type]
                self.faces[place.name] = nodes
                self._hold(nodes, components)
        self._check(len(stages))

    def _hold(self, nodes: Nodes, components: Sequence[int]) -> None:
        if len(components) == self._d:
            self.conditions.append(fem.dirichletbc(self.increment, nodes))
        else:
            for i in components:
                dofs = (nodes * self._d + i).astype(np.int32)
                self.conditions.append(fem.dirichletbc(self.increment, [dofs, dofs], self._V.sub(i)))
        self.held[(nodes[:, None] * self._d + np.array(components, dtype=np.int32)).ravel()] = True

    def support(self, node: int | None, component: int) -> None:
        """Holds one more component, of a node of this rank, owned or ghost, or on other ranks only; collective."""
        nodes = np.array([] if node is None else [node], dtype=np.int32)
        self._hold(nodes, [component])
        self.supports = np.append(self.supports, nodes * self._d + component).astype(np.int32)

    # ------------------------------------------------------------------ where they are

    @cached_property
    def points(self) -> Array:
        """Places of the nodes at rest, owned and ghost, shape (n, 3)."""
        return self._V.tabulate_dof_coordinates()

    def displacements(self, load: float, others: Mapping[type[Motion], float] | None = None) -> Array:
        """Displacements at a load factor, owned and ghost: right where `held`, zero elsewhere.

        Args:
            load: The load factor.
            others: That of motions of another kind.
        """
        values = np.zeros((len(self.points), self._d))
        for part in self.parts:
            at = (others or {}).get(type(part.ends[0]), load)
            values[part.nodes[:, None], part.components] = part.displacements(self.points, at)
        return values.ravel()

    def weights(self) -> list[Array]:
        """The share that each part has in the reactions at its nodes, shape (nodes, components), all together one.

        Where places meet it is of the one that holds most there, a clamp before a roller; of equals, each has the same.
        """
        most, count = np.zeros((len(self.points), self._d)), np.zeros((len(self.points), self._d))
        parts = [((part.nodes[:, None], part.components), self._holds(part)) for part in self.parts]
        for at, holds in parts:
            most[at] = np.maximum(most[at], holds)
        for at, holds in parts:
            count[at] += most[at] == holds
        return [(most[at] == holds) / count[at] for at, holds in parts]

    def _holds(self, part: Held) -> int:
        """How many components a part's place holds."""
        return sum(len(other.components) for other in self.parts if other.place == part.place)

    def _check(self, stages: int) -> None:
        """Refuses displacements that are no numbers, or differ where places meet."""
        comm, count = self._V.mesh.comm, np.zeros((len(self.points), self._d))
        for part in self.parts:
            count[part.nodes[:, None], part.components] += 1
        meeting = count > 1
        # Half-way too: a turn and a move may end at one place.
        loads = [0.5 * k for k in range(1, 2 * stages + 1)]
        complaint = None
        for load in loads:
            values, owner = np.full(meeting.shape, np.nan), np.zeros(meeting.shape, dtype=int)
            for number, part in enumerate(self.parts):
                own = part.displacements(self.points, load)
                if not np.isfinite(own).all() and complaint is None:
                    complaint = f"{part.place.key}: its displacement is no number everywhere"
                at = (part.nodes[:, None], np.array(part.components, dtype=int))
                before = values[at]
                size = max(float(np.abs(own).max(initial=0.0)), float(np.nanmax(np.abs(before), initial=0.0)))
                wrong = np.argwhere(meeting[at] & (np.abs(own - before) > SAME * size))
                if len(wrong) and complaint is None:
                    i, c = wrong[0]
                    first = self.parts[owner[at][i, c]].place.key
                    axis = "xyz"[part.components[c]]
                    x = [round(float(v), 6) for v in self.points[part.nodes[i], : self._d]]
                    complaint = (
                        f"{first} and {part.place.key}: meet at {x}, and prescribe different displacements "
                        f"along {axis} there, {before[i, c]:.6g} and {own[i, c]:.6g} at load {load:g}"
                    )
                values[at] = own
                owner[at] = number
        complaints = [found for found in comm.allgather(complaint) if found is not None]
        if complaints:
            raise UserError(complaints[0])
