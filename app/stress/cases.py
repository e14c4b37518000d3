"""Which cases the stress tests are made of, and the table of their outcomes."""

import csv
import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from itertools import product
from pathlib import Path
from typing import Any

from elastune.app.errors import UserError
from elastune.app.scene.read import load
from elastune.app.scene.schema import Scene
from elastune.app.scene.write import digest
from elastune.forms.energy import CATALOGUE

# A shipped scene each, coarse, in as few steps as it can be expected to take.
SCENES = {
    "twist": ("cube-twist", ["mesh.cells=4", "solve.steps=2"]),
    "stretch": ("cylinder-stretch", ["mesh.cells=4", "solve.steps=6"]),
    "squeeze": ("squeeze", ["mesh.cells=4", "solve.steps=5"]),
    "scramble": ("scramble", ["mesh.cells=4"]),
    "plane": ("collapse", ["mesh.cells=4", "start.shape=plane"]),
    "line": ("collapse", ["mesh.cells=4", "start.shape=line"]),
    "point": ("collapse", ["mesh.cells=4", "start.shape=point"]),
    "inside-out": ("collapse", ["mesh.cells=4", "start.shape=inside-out"]),
}
RATIOS = (0.3, 0.45, 0.49, 0.499)
CELLS = {"hex": ("hexahedron", "Q1"), "tet": ("tetrahedron", "P1")}

# Of the solver.
TOLERANCE = 1e-10

# From good to bad.
OUTCOMES = ("converged", "elsewhere", "failed", "refused", "crashed")


@dataclass
class Row:
    """One case and its outcome.

    Attributes:
        material: Name.
        scene: Key of SCENES.
        nu: Poisson's ratio.
        cell: Key of CELLS.
        status: "converged"; "elsewhere" if a start without loads ended in another minimum than rest; "failed",
            "refused" before solving, or "crashed", which should not be.
        newton: Newton steps.
        linear: Iterations of the linear solver, one a direct solve.
        seconds: Wall time.
        min_J: Least volume ratio of the last state.
        energy: Of the last state.
        residual: |r| of the last state, recomputed independently, over E times an edge squared.
        reason: Of what is not converged, with the diagnosis.
    """

    material: str
    scene: str
    nu: float
    cell: str
    status: str = ""
    newton: int = 0
    linear: int = 0
    seconds: float = 0.0
    min_J: float | None = None
    energy: float | None = None
    residual: float | None = None
    reason: str = ""

    @property
    def key(self) -> tuple[str, str, float, str]:
        """What tells cases apart."""
        return self.material, self.scene, self.nu, self.cell


def cases() -> list[Row]:
    """All cases, their outcomes open."""
    return [Row(*key) for key in product(CATALOGUE, SCENES, RATIOS, CELLS)]


def scene(row: Row, limit: float) -> Scene:
    """The scene of a case.

    Raises:
        SceneError: If the material cannot do it.
    """
    return load(SCENES[row.scene][0], settings(row, limit))


def settings(row: Row, limit: float) -> list[str]:
    """What a case sets of its shipped scene."""
    cell, element = CELLS[row.cell]
    own = [
        *SCENES[row.scene][1],
        f"material.name={row.material}",
        f"material.nu={row.nu}",
        f"mesh.cell={cell}",
        f"solve.element={element}",
        f"solve.tolerance={TOLERANCE}",
        f"solve.time_limit={limit}",
        "solve.smallest_step=0.01",
    ]
    if len(CATALOGUE[row.material].pair) < 2:
        # An energy without a λ part knows no ν.
        own.append("material.volume=stable-neo-hookean")
    return own


def keyed(limit: float) -> dict[str, Row]:
    """All cases by what tells each from others, and from itself in another version of its scene or Elastune.

    Args:
        limit: Seconds a case may take.
    """
    # Of the scenes that they set out from: the cases' own would have to be calibrated first, and some are refused.
    shipped = {name: digest(load(name)) for name, _ in SCENES.values()}

    def key(row: Row) -> str:
        words = [shipped[SCENES[row.scene][0]], *settings(row, limit)]
        return hashlib.sha256(" ".join(words).encode()).hexdigest()[:16]

    return {key(row): row for row in cases()}


def typed(entry: dict[str, str]) -> Row:
    """A row of text as it was; a float that is missing is None."""
    kinds: dict[Any, Callable[[str], Any]] = {int: int, float: float, str: str}
    number = {f.name: kinds.get(f.type, lambda text: float(text) if text else None) for f in fields(Row)}
    return Row(**{name: convert(entry[name]) for name, convert in number.items()})


def read(table: Path) -> list[Row]:
    """The outcomes of a table.

    Raises:
        UserError: If it is another table, or cannot be read.
    """
    try:
        with table.open(newline="", encoding="utf-8") as file:
            return [typed(entry) for entry in csv.DictReader(file)]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UserError(f"{table}: expected a table of outcomes; {error!r}") from None


def worse(old: Iterable[Row], new: Iterable[Row]) -> list[tuple[Row, Row]]:
    """Pairs of rows of one case, old and new, whose outcome has got worse; refused is no worse than failed."""
    before = {row.key: row for row in old}
    rank = {name: i for i, name in enumerate(OUTCOMES)} | {"refused": OUTCOMES.index("failed")}
    pairs = [(before[row.key], row) for row in new if row.key in before]
    return [(a, b) for a, b in pairs if rank[b.status] > rank[a.status]]
