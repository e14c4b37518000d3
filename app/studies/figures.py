"""The figures of a study: error against time, memory and size of the cells."""

import math
from pathlib import Path
from typing import Any

from elastune.app.results.pictures import style
from elastune.app.results.pictures.style import COLOURS, GREYS
from elastune.app.studies.compare import Comparison, Curve, Point
from elastune.app.studies.schema import Study

MARKERS = "osD^v<>phd"
# More curves than this have a colour map and a legend beside them.
MANY = 10

LABELS = {
    "l2": "displacement, L²",
    "h1": "displacement gradient, L²",
    "stress": "stress, L²",
    "pressure": "pressure, L²",
    "volume_ratio": "volume",
}


def draw(study: Study, comparison: Comparison, folder: Path) -> list[Path]:
    """Draws the figures that the records suffice for; returns their paths."""
    curves = [curve for curve in comparison.curves if curve.points]
    if not curves:
        return []
    axes = {
        "error-time.png": "run time, s",
        "error-memory.png": "memory, MB",
        "error-size.png": "cell size over body size",
    }
    paths = []
    for file, label in axes.items():
        _figure(study, curves, folder / file, label)
        paths.append(folder / file)
    return paths


def _figure(study: Study, curves: list[Curve], path: Path, label: str) -> None:
    panels = list(dict.fromkeys(curve.panel for curve in curves))
    names = list(dict.fromkeys((curve.name, curve.solver) for curve in curves))
    many = len(names) > MANY
    width = 4.6 * len(panels) + (2.6 if many else 1.2)
    figure = style.figure((width, 4.6), 90 if many else 110)
    grid = figure.subplots(1, len(panels), sharex=True, sharey=True, squeeze=False)[0]
    styles = _styles(names, many)
    for axes, panel in zip(grid, panels, strict=True):
        for curve in curves:
            if curve.panel == panel:
                _curve(axes, study, curve, label, styles[curve.name, curve.solver])
        _dress(axes, study, panel, label, len(panels) > 1)
    grid[0].set_ylabel(f"relative error: {LABELS.get(study.plot, study.plot)}")
    handles = {text: line for axes in grid for line, text in zip(*axes.get_legend_handles_labels(), strict=True)}
    # Inches of a line's sample and of a letter, so that the columns fit.
    entry = 0.55 + 0.065 * max(map(len, handles), default=0)
    below = {"loc": "outside lower center", "ncols": max(1, min(3, int(width / entry)))}
    where: dict[str, Any] = {"loc": "outside right upper"} if many else below
    figure.legend(handles.values(), handles.keys(), frameon=False, fontsize=7.5 if many else 9, **where)
    figure.suptitle(study.title, fontsize=11.5, fontweight="bold")
    figure.savefig(path, format="png", pil_kwargs={"optimize": True})


def _styles(names: list[tuple[str, str]], many: bool) -> dict[tuple[str, str], dict[str, Any]]:
    """Line styles by name and solver."""
    from matplotlib import colormaps

    ours = [name for name in names if name[1] == "elastune"]
    styles: dict[tuple[str, str], dict[str, Any]] = {}
    for i, name in enumerate(ours):
        colour = colormaps["turbo"](0.05 + 0.9 * i / len(ours)) if many else COLOURS[i % len(COLOURS)]
        style = {"color": colour, "marker": MARKERS[i % len(MARKERS)], "markersize": 5, "linestyle": "-"}
        # The latter half hollow and larger, so that of two curves that coincide both are seen.
        hollow = {"markersize": 8, "markerfacecolor": "none"} if 2 * i >= len(ours) > 5 else {}
        styles[name] = style | hollow
    for i, name in enumerate(name for name in names if name not in styles):
        styles[name] = {"color": GREYS[i % len(GREYS)], "marker": MARKERS[i], "markersize": 5, "linestyle": "--"}
    return styles


def _curve(axes: Any, study: Study, curve: Curve, label: str, style: dict[str, Any]) -> None:
    points = [p for p in curve.points if p.errors.get(study.plot, 0) > 0]
    y = [p.errors[study.plot] for p in points]
    x = [_abscissa(p, label) for p in points]
    name = curve.name
    if "size" in label and math.isfinite(curve.order(study.plot)) and study.panels is None:
        name += f": order {curve.order(study.plot):.2f}"
    axes.plot(x, y, label=name, linewidth=1.6, **style)
    if "time" in label:
        low, high = ([abs(p.seconds - p.spread[i]) for p in points] for i in (0, 1))
        axes.errorbar(x, y, xerr=[low, high], fmt="none", ecolor=style["color"], elinewidth=1, capsize=2)


def _abscissa(point: Point, label: str) -> float:
    if "time" in label:
        return point.seconds
    return point.memory_mb if "memory" in label else point.h


def _dress(axes: Any, study: Study, panel: str, label: str, titled: bool) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(label)
    _number_ticks(axes.xaxis, 1.0, "")
    _number_ticks(axes.yaxis, 0.01, " %")
    style.dress(axes)
    if titled:
        axes.set_title(panel, fontsize=10)
    if "time" not in label:
        return
    low, high = axes.get_ylim()
    for tolerance in study.tolerances:
        if low < tolerance < high:
            axes.axhline(tolerance, color="0.75", linewidth=0.8, linestyle=":", zorder=0)
            where = {"xycoords": ("axes fraction", "data"), "ha": "right", "va": "bottom"}
            axes.annotate(f"{100 * tolerance:g} %", (1, tolerance), fontsize=8, color="0.45", **where)


def _number_ticks(axis: Any, unit: float, suffix: str) -> None:
    """Plain numbers at 1, 2 and 5 of each decade, or at the decades where there are many."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high / low < 60 else (1.0,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / unit:g}{suffix}"))
    axis.set_minor_formatter(NullFormatter())
