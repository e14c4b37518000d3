"""The picture of the stress tests: materials by cases, coloured by outcome."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from elastune.app.results.pictures import style
from elastune.app.stress.cases import CELLS, OUTCOMES, RATIOS, SCENES, Row

_COLORS = {
    "converged": "#3b8f5a",
    "elsewhere": "#e3b23c",
    "failed": "#c8553d",
    "refused": "#c9ced6",
    "crashed": "#000000",
}


def matrix(rows: Sequence[Row], path: Path) -> None:
    """Draws the outcomes; a case not yet solved stays white.

    Args:
        rows: Of the table.
        path: PNG file.
    """
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    materials = sorted({row.material for row in rows})
    columns = [(scene, cell, nu) for scene in SCENES for cell in CELLS for nu in RATIOS]
    image = np.full((len(materials), len(columns)), np.nan)
    for row in rows:
        image[materials.index(row.material), columns.index((row.scene, row.cell, row.nu))] = OUTCOMES.index(row.status)

    figure = style.figure((14, 0.28 * len(materials) + 2.2))
    axes = figure.add_subplot()
    axes.pcolormesh(
        image, cmap=ListedColormap([_COLORS[outcome] for outcome in OUTCOMES]), vmin=-0.5, vmax=len(OUTCOMES) - 0.5,
        edgecolors="white", linewidth=0.6,
    )  # fmt: skip
    axes.invert_yaxis()
    axes.set_yticks(np.arange(len(materials)) + 0.5, materials, fontsize=8)
    width = len(CELLS) * len(RATIOS)
    halves = [(i + 0.5) * len(RATIOS) for i in range(len(SCENES) * len(CELLS))]
    axes.set_xticks(halves, [cell for _ in SCENES for cell in CELLS], fontsize=8)
    for i, scene in enumerate(SCENES):
        axes.text((i + 0.5) * width, -0.4, scene, ha="center", va="bottom", fontsize=9)
        axes.axvline(i * width, color="black", linewidth=0.8)
    axes.tick_params(length=0)
    axes.set_xlabel(f"in each block nu = {', '.join(map(str, RATIOS))} from left to right", fontsize=8)
    counts = {outcome: sum(row.status == outcome for row in rows) for outcome in OUTCOMES}
    handles = [Patch(color=_COLORS[name], label=f"{name} {n}") for name, n in counts.items() if n]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False, fontsize=9)
    figure.savefig(path)
