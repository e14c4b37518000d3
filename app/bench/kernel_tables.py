"""Tables and figure of the kernel's times."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from elastune.app.bench.compilation import Compilation
from elastune.app.bench.kernels import FORMS, MEASURES, METHODS, REFERENCE, STRETCH_BASED, Row
from elastune.app.results.pictures import style

# Bars of the figure: material, method, name, colour (Okabe and Ito's).
BARS = (
    (REFERENCE, "spectral", "spectral, stable neo-Hookean", "#0072b2"),
    (REFERENCE, "invariants", "UFL, stable neo-Hookean by invariants", "#e69f00"),
    (REFERENCE, "optimised", "the same with the kernel's compiler options", "#d8c08a"),
    (STRETCH_BASED[0], "spectral", "spectral, linear corotational", "#56b4e9"),
    (STRETCH_BASED[0], "eigenvalues", "UFL, linear corotational by eigenvalues", "#d55e00"),
)
# With more materials than this the figure shows their tangents only.
FEW = 4


def write(rows: Sequence[Row], compiled: Sequence[Compilation], folder: Path) -> list[Path]:
    """Writes `kernels.csv`, `kernels-compile.csv` and `kernels.png`; returns their paths."""
    paths = [folder / name for name in ("kernels.csv", "kernels-compile.csv", "kernels.png")]
    head = ["element", "material", "form", "measure", "cells"]
    head += [f"{method}_{what}" for method in METHODS for what in ("us", "low_us", "high_us")]
    _table(paths[0], [*head, *(f"ratio_{method}" for method in METHODS[1:])], map(_entries, rows))
    entries = ([c.element, c.material, round(c.empty, 4), round(c.warm, 5)] for c in compiled)
    _table(paths[1], ["element", "material", "empty_cache_s", "warm_cache_s"], entries)
    draw(rows, paths[2])
    return paths


def _table(path: Path, head: Sequence[str], rows: Any) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head)
        writer.writerows(rows)


def _entries(row: Row) -> list[Any]:
    entries: list[Any] = [row.element, row.material, row.form, row.measure, row.cells]
    for method in METHODS:
        entries += [f"{value:.5g}" for value in row.spread(method)] if method in row.times else [""] * 3
    ratios = [row.ratio(method) for method in METHODS[1:]]
    return entries + ["" if ratio is None else f"{ratio:.3f}" for ratio in ratios]


def summary(rows: Sequence[Row], compiled: Sequence[Compilation]) -> list[str]:
    """The largest ratios of all elements, and the longest compilations, a line each."""
    lines = []
    for measure in MEASURES:
        at = {(r.element, r.material, r.form): r for r in rows if r.measure == measure}
        tangents = [row for row in at.values() if row.form == "tangent"]
        words = [_worst(f"UFL by {method}", [(row, row.ratio(method)) for row in tangents]) for method in METHODS[1:3]]
        added = []
        for row in tangents:
            clamped = at[row.element, row.material, "clamped"]
            added.append((row, float(np.median(clamped.times["spectral"] / row.times["spectral"]))))
        words.append(_worst("clamped over not", added))
        lines.append(f"tangent, {measure}: " + "; ".join(word for word in words if word))
    empty, warm = max(compiled, key=lambda c: c.empty), max(compiled, key=lambda c: c.warm)
    lines.append(
        f"compilation: at most {empty.empty:.2f} s ({empty.element}, {empty.material}), "
        f"from the cache {1e3 * warm.warm:.0f} ms ({warm.element}, {warm.material})"
    )
    return lines


def _worst(what: str, ratios: Sequence[tuple[Row, float | None]]) -> str:
    known = [(ratio, row) for row, ratio in ratios if ratio is not None]
    if not known:
        return ""
    ratio, row = max(known, key=lambda entry: entry[0])
    return f"at most {ratio:.2f} x {what} ({row.element}, {row.material})"


def draw(rows: Sequence[Row], path: Path) -> None:
    """Bars of two materials' tangents, and ratios of all to UFL's forms."""
    materials = list(dict.fromkeys(row.material for row in rows))
    lines = [(name, form) for name in materials for form in (FORMS if len(materials) <= FEW else FORMS[2:3])]
    heights = (3.6, 0.24 * len(lines) + 0.6)
    figure = style.figure((16, sum(heights) + 1.8), 110)
    grid = figure.subplots(2, 2, height_ratios=heights, sharex="row", sharey="row")
    for column, measure in enumerate(MEASURES):
        chosen = [row for row in rows if row.measure == measure]
        _bars(grid[0, column], chosen, measure)
        _ratios(grid[1, column], chosen, lines)
    grid[0, 0].set_ylabel("tangent, µs a cell")
    grid[1, 0].set_yticks(range(len(lines)), [f"{name}, {form}" for name, form in lines], fontsize=8)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    figure.savefig(path, format="png", pil_kwargs={"optimize": True})


def _bars(axes: Any, rows: Sequence[Row], measure: str) -> None:
    elements = list(dict.fromkeys(row.element for row in rows))
    width = 0.8 / len(BARS)
    for i, (material, method, label, colour) in enumerate(BARS):
        tangents = [row for row in rows if (row.material, row.form) == (material, "tangent")]
        found = {row.element: row.spread(method) for row in tangents if method in row.times}
        x = [elements.index(element) + (i - (len(BARS) - 1) / 2) * width for element in found]
        middle = [median for median, _, _ in found.values()]
        error = [[m - low for m, low, _ in found.values()], [high - m for m, _, high in found.values()]]
        axes.bar(x, middle, width, yerr=error, label=label, color=colour, error_kw={"elinewidth": 0.8})
    axes.set_yscale("log")
    axes.set_xticks(range(len(elements)), [name.replace(" ", "\n") for name in elements], fontsize=7)
    axes.set_title("the kernel alone" if measure == MEASURES[0] else "assembled into a PETSc matrix", fontsize=11)
    style.dress(axes, "y")


def _ratios(axes: Any, rows: Sequence[Row], lines: Sequence[tuple[str, str]]) -> None:
    from matplotlib.colors import LogNorm

    elements = list(dict.fromkeys(row.element for row in rows))
    at = {(row.material, row.form, row.element): row for row in rows}
    values = [[_against_ufl(at[(*line, element)]) for element in elements] for line in lines]
    axes.imshow(values, cmap="RdBu_r", norm=LogNorm(1 / 8, 8), aspect="auto")
    for y, line in enumerate(values):
        for x, value in enumerate(line):
            dark = not 0.29 < value < 3.5
            axes.text(x, y, f"{value:.2f}", ha="center", va="center", fontsize=7.5, color="white" if dark else "black")
    axes.set_xticks(range(len(elements)), [name.replace(" ", "\n") for name in elements], fontsize=7)
    axes.set_title("spectral over UFL: the material's own form, or else the stable neo-Hookean one", fontsize=10)
    axes.tick_params(length=0)


def _against_ufl(row: Row) -> float:
    own = (row.ratio(method) for method in ("invariants", "eigenvalues", "reference"))
    return next(ratio for ratio in own if ratio is not None)
