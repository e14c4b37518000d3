"""Volume against stretch of a cylinder pulled to 3.4 times its length, for four materials (Smith et al., Fig. 6)."""

import csv
from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

from elastune.app.results.pictures import style
from elastune.app.run import start
from elastune.app.scene.read import load

# "Filtered" neo-Hookean is continued below the stretch that Smith et al. name. The corotational body collapses
# onto its axis on the way, where its energy has a kink and forces cannot balance: it gets little time for that.
MATERIALS = {
    "corotational": ["material.name=linear-corotational", "solve.smallest_step=0.2"],
    "fixed corotational": ["material.name=fixed-corotational"],
    "filtered neo-Hookean": ["material.name=neo-hookean", "material.extension=0.25"],
    "stable neo-Hookean": ["material.name=stable-neo-hookean"],
}

Curve = list[tuple[float, float]]


def stretch(cells: int = 8, tell: Callable[[str], None] = print) -> dict[str, Curve]:
    """Stretch and volume ratio of the states in balance, by material.

    Args:
        cells: Across the diameter.
        tell: Told how each material ends.
    """
    curves = {}
    for name, settings in MATERIALS.items():
        run = start(load("cylinder-stretch", [f"mesh.cells={cells}", *settings]), MPI.COMM_SELF).finish()
        curves[name] = [(1.0, 1.0), *((1 + 2.4 * step.load, step.volume_ratio) for step in run.summary.steps)]
        failure = run.summary.failure
        end = "converged" if failure is None else f"{failure.kind} before stretch {1 + 2.4 * failure.load:.3f}"
        tell(f"{name:22} volume {curves[name][-1][1]:.4f} at stretch {curves[name][-1][0]:.3f}, {end}")
    return curves


def write(curves: dict[str, Curve], folder: Path) -> list[Path]:
    """The curves as a table and as a picture."""
    folder.mkdir(parents=True, exist_ok=True)
    table, picture = folder / "volume.csv", folder / "volume.png"
    with table.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["material", "stretch", "volume_ratio"])
        writer.writerows([name, *point] for name, points in curves.items() for point in points)
    figure = style.figure((6, 4))
    axes = figure.add_subplot()
    for name, points in curves.items():
        axes.plot(*zip(*points, strict=True), label=name, marker=".")
    axes.set(xlabel="stretch", ylabel="volume ratio", title="Cylinder, nu = 0.49")
    axes.legend(frameon=False)
    style.dress(axes)
    figure.savefig(picture)
    return [table, picture]
