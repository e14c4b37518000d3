"""How all our figures look."""

from typing import Any

# Okabe and Ito's colours, told apart by the colour-blind too; those of solvers to compare with are greys.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a4fbf", "#8c6d31", "#b3476b", "#000000")
GREYS = ("#8f8f8f", "#4d4d4d", "#b5b5b5")


def figure(size: tuple[float, float], dpi: int = 150) -> Any:
    """A figure without pyplot: no display, no state that others share.

    Args:
        size: Inches.
        dpi: Pixels an inch.

    Raises:
        ImportError: If matplotlib is missing.
    """
    from matplotlib.figure import Figure

    return Figure(figsize=size, dpi=dpi, layout="constrained")


def dress(axes: Any, grid: str = "both") -> None:
    """A light grid behind the curves, and no frame above and on the right."""
    axes.grid(color="0.9", axis=grid, which="major")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
