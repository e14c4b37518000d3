"""Volume against stretch of a cylinder pulled to 3.4 times its length, for four materials (Smith et al., Fig. 6)."""

import csv
from collections.abc import Callable
from pathlib import Path

from mpi4py import MPI

from elastune.app.body.body import Problem
from elastune.app.path.follow import LoadFailure, follow
from elastune.app.results.measures import Measures
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
        scene = load("cylinder-stretch", [f"mesh.cells={cells}", *settings])
        problem = Problem(scene, MPI.COMM_SELF)
        measures = Measures(problem)
        curves[name] = [(1.0, 1.0)]
        end = "converged"
        try:
            for state in follow(problem):
                curves[name].append((1 + 2.4 * state.load, measures.volume_ratio()))
        except LoadFailure as failure:
            end = f"{failure.kind} before stretch {1 + 2.4 * failure.load:.3f}"
        tell(f"{name:22} volume {curves[name][-1][1]:.4f} at stretch {curves[name][-1][0]:.3f}, {end}")
    return curves


def write(curves: dict[str, Curve], folder: Path) -> list[Path]:
    """The curves as a table and as a picture."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    table, picture = folder / "volume.csv", folder / "volume.png"
    with table.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["material", "stretch", "volume_ratio"])
        writer.writerows([name, *point] for name, points in curves.items() for point in points)
    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    for name, points in curves.items():
        axes.plot(*zip(*points, strict=True), label=name, marker=".")
    axes.set(xlabel="stretch", ylabel="volume ratio", title="Cylinder, nu = 0.49")
    axes.legend(frameon=False)
    figure.savefig(picture, dpi=150)
    plt.close(figure)
    return [table, picture]
