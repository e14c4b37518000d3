"""A study's records against its reference: errors, medians of the times, orders, and the price of an accuracy."""

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from elastune.app.errors import UserError
from elastune.app.studies.cases import Case, references, stated
from elastune.app.studies.orders import fitted_order, limit, price
from elastune.app.studies.records import Records
from elastune.app.studies.schema import NORMS, Study


@dataclass(frozen=True)
class Point:
    """One case.

    Attributes:
        h: Size of a cell over that of the body, (1/cells)^(1/d).
        dofs: Number of unknowns.
        seconds: Median of the repeats.
        spread: Least and largest of the repeats.
        memory_mb: Median of the repeats.
        values: Energy, volume_ratio and quantities.
        errors: Relative, by the same names, and norms.
    """

    h: float
    dofs: int
    seconds: float
    spread: tuple[float, float]
    memory_mb: float
    values: dict[str, float]
    errors: dict[str, float]


@dataclass
class Curve:
    """The cases that differ by their mesh only, from coarse to fine.

    Attributes:
        name: As the figures call it.
        panel: Name of its panel, which may be empty.
        solver: Of its cases.
        element: Of its cases.
        points: The cases that converged.
        lost: Status and message of those that did not.
    """

    name: str
    panel: str
    solver: str
    element: str
    points: list[Point]
    lost: list[str]

    def order(self, name: str) -> float:
        """The fitted order of an error in h."""
        return fitted_order([p.h for p in self.points], [p.errors.get(name, math.nan) for p in self.points])

    @property
    def timed_out(self) -> bool:
        """Whether its finest case was given up."""
        return any(text.startswith("timeout") for text in self.lost)

    def price(self, name: str, tolerance: float) -> float:
        """Seconds of the cheapest case from which on the error stays within a tolerance; infinity if there is none."""
        return price([(p.seconds, p.errors.get(name, math.nan)) for p in self.points], tolerance)


class Comparison:
    """Curves of errors, and their tables."""

    def __init__(self, study: Study, found: Sequence[Case], records: Records) -> None:
        """Collects what has been run.

        Raises:
            UserError: If a reference run failed, or three of them point to no limit.
        """
        self.study, self.records = study, records
        self.curves: list[Curve] = []
        for case in found:
            curve = self._curve(case)
            done = [record for record in records.of(case) if record.converged]
            if not done:
                curve.lost += [f"{r.entries['status']}: {r.entries['message']}" for r in records.of(case)]
                continue
            seconds = [record.seconds for record in done]
            cells, dofs = int(done[0].entries["cells"]), int(done[0].entries["dofs"])
            dimension = 2 if case.scene.cell in ("triangle", "quadrilateral") else 3
            curve.element = done[0].entries["element"]
            curve.points.append(
                Point(
                    cells ** (-1 / dimension),
                    dofs,
                    median(seconds),
                    (min(seconds), max(seconds)),
                    median(float(record.entries["memory_mb"]) for record in done),
                    done[0].values,
                    self._errors(case, done[0].values),
                )
            )

    def _curve(self, case: Case) -> Curve:
        for curve in self.curves:
            if (curve.name, curve.panel, curve.solver) == (case.curve, case.panel, case.solver):
                return curve
        self.curves.append(Curve(case.curve, case.panel, case.solver, case.scene.element, [], []))
        return self.curves[-1]

    def _errors(self, case: Case, values: dict[str, float]) -> dict[str, float]:
        if self.study.reference.manufactured:
            return values
        truth = self.truth(case)
        return {name: abs(value / truth[name] - 1) for name, value in values.items() if truth.get(name)}

    def truth(self, case: Case) -> dict[str, float]:
        """What the quantities of a case tend to."""
        if self.study.reference.stated:
            return stated(self.study, case)
        runs = []
        for reference in references(self.study, case):
            record = self.records.of(reference)[0]
            if not record.converged:
                raise UserError(f"{self.study.name}.toml: reference {reference.line}: {record.entries['message']}")
            runs.append(record.values)
        if len(runs) == 1:
            return runs[0]
        try:
            return {name: limit([run[name] for run in runs]) for name in runs[0]}
        except ValueError as error:
            raise UserError(f"{self.study.name}.toml: reference.extrapolate: {error}") from None

    # ------------------------------------------------------------------ tables

    def write(self, folder: Path) -> list[Path]:
        """Writes `errors.csv`, a row a case, and `table.md`, a row a curve; returns their paths."""
        errors, table = folder / "errors.csv", folder / "table.md"
        with errors.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerows(self._rows())
        table.write_text("\n".join(self._table()) + "\n", encoding="utf-8")
        return [errors, table]

    def _names(self) -> list[str]:
        present = {name for curve in self.curves for point in curve.points for name in point.errors}
        return [name for name in (*NORMS, *self.study.quantities, "energy", "volume_ratio") if name in present]

    def _rows(self) -> Iterator[list[Any]]:
        names = self._names()
        head = ["curve", "panel", "solver", "h", "unknowns", "seconds", "fastest", "slowest", "memory_mb"]
        yield head + [f"error_{name}" for name in names]
        for curve in self.curves:
            for p in curve.points:
                row = [curve.name, curve.panel, curve.solver, p.h, p.dofs, p.seconds, *p.spread, p.memory_mb]
                yield row + [p.errors.get(name) for name in names]

    def _table(self) -> Iterator[str]:
        plot, tolerances = self.study.plot, self.study.tolerances
        names = [name for name in self._names() if name in NORMS or name == plot]
        yield f"{self.study.title}. Error of {plot}; seconds to reach it."
        yield ""
        panels = ["case"] if self.study.panels else []
        head = ["curve", *panels, *(f"order of {name}" for name in names), "least error", "unknowns"]
        head += [f"to {100 * tolerance:g} %" for tolerance in tolerances]
        yield f"| {' | '.join(head)} |"
        yield f"|{'---|' * len(head)}"
        for curve in self.curves:
            if not curve.points:
                row = [curve.name, *([curve.panel] if panels else []), *curve.lost[:1]]
                yield f"| {' | '.join(row)} |" + " |" * (len(head) - len(row))
                continue
            finest = curve.points[-1]
            cells = [curve.name, *([curve.panel] if panels else []), *(_number(curve.order(name)) for name in names)]
            cells += [f"{finest.errors.get(plot, math.nan):.2g}", f"{finest.dofs:,}"]
            cells += [self._price(curve, tolerance) for tolerance in tolerances]
            yield f"| {' | '.join(cells)} |"

        yield from self._against()

    def _price(self, curve: Curve, tolerance: float) -> str:
        seconds = curve.price(self.study.plot, tolerance)
        if math.isfinite(seconds):
            return _seconds(seconds)
        return f"not in {self.study.timeout:g} s" if curve.timed_out else "-"

    def _against(self) -> Iterator[str]:
        """Elastune's default, or its fastest curve, against each of the other solvers', where there are any."""
        others = [curve for curve in self.curves if curve.solver != "elastune" and curve.points]
        if not others:
            return
        names = list(dict.fromkeys(curve.name for curve in others))
        yield ""
        yield f"| case | error | Elastune, s | with | {' | '.join(f'{name}, s' for name in names)} |"
        yield f"|{'---|' * (4 + len(names))}"
        for panel in dict.fromkeys(curve.panel for curve in others):
            ours = [curve for curve in self.curves if curve.solver == "elastune" and curve.panel == panel]
            ours = [curve for curve in ours if self.study.default in (None, curve.name)]
            rivals = {curve.name: curve for curve in others if curve.panel == panel}
            for tolerance in self.study.tolerances:
                prices = {curve.name: curve.price(self.study.plot, tolerance) for curve in ours}
                best = min(prices, key=lambda name: prices[name])
                name = best if math.isfinite(prices[best]) else "-"
                row = [panel, f"{100 * tolerance:g} %", _seconds(prices[best]), name]
                row += [self._factor(rivals[rival], tolerance, prices[best]) for rival in names if rival in rivals]
                yield f"| {' | '.join(row)} |"

    def _factor(self, rival: Curve, tolerance: float, best: float) -> str:
        seconds = rival.price(self.study.plot, tolerance)
        # A run that was given up has lasted that long at least.
        over = "over " if math.isinf(seconds) else ""
        factor = (self.study.timeout if over and rival.timed_out else seconds) / best
        text = self._price(rival, tolerance)
        if not 0 < factor < math.inf:
            return text
        # Two digits, rounded down: the times have no more.
        unit = 10.0 ** (math.floor(math.log10(factor)) - 1)
        return f"{text} ({over}{math.floor(factor / unit) * unit:,.{0 if unit >= 1 else 1}f} ×)"


def _seconds(value: float) -> str:
    if not math.isfinite(value):
        return "-"
    return f"{value:.2g}" if value < 100 else f"{value:.0f}"


def _number(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "-"
