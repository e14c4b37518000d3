"""From a study to its cases: every combination of what varies, as a checked scene."""

import itertools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from elastune.app.errors import UserError
from elastune.app.scene.override import assign
from elastune.app.scene.read import parse
from elastune.app.scene.schema import Scene
from elastune.app.studies.schema import Settings, Study, StudyError, flatten

# The keys of a scene that make one body finer: along them runs a curve, all others tell curves apart.
REFINEMENT = ("mesh.cells", "mesh.h", "mesh.refine")


# The curve that reference runs are recorded under.
REFERENCE = "reference"


@dataclass(frozen=True)
class Case:
    """One scene to be solved.

    Attributes:
        curve: Name of the curve it is a point of.
        panel: Name of the panel that the curve is in, empty if there is one only.
        settings: What it sets of the base scene, by dotted key.
        scene: The checked scene.
        solver: As in `Series`.
        ranks: As in `Series`.
    """

    curve: str
    panel: str
    settings: Settings
    scene: Scene
    solver: str
    ranks: int

    @property
    def line(self) -> str:
        """Settings in a line, as `elastune run --set` takes them."""
        return " ".join(f"{name}={json.dumps(value)}" for name, value in sorted(self.settings.items()))

    @property
    def curve_settings(self) -> Settings:
        """The settings that all points of the curve share."""
        return {name: value for name, value in self.settings.items() if name not in REFINEMENT}


def cases(study: Study) -> list[Case]:
    """All cases, curve by curve from coarse to fine.

    Raises:
        UserError: If a scene is impossible, or has not what the study wants to know; the line names the settings.
    """
    found = []
    for series in study.series:
        vary = flatten(study.vary) | flatten(series.vary)
        fixed = flatten(study.set) | flatten(series.set)
        for name, values in vary.items():
            if not isinstance(values, list) or not values:
                raise StudyError(f"{study.name}.toml: vary.{name} = {values!r}: expected a list of values")
        # Refinement last, so that it changes fastest and a curve is solved from coarse to fine.
        names = sorted(vary, key=lambda name: name in REFINEMENT)
        telling = [name for name in names if name not in (*REFINEMENT, study.panels) and len(vary[name]) > 1]
        for values in itertools.product(*(vary[name] for name in names)):
            chosen = dict(zip(names, values, strict=True))
            settings = fixed | flatten(chosen)
            words = [series.label, *(_word(name, chosen[name]) for name in telling)]
            curve = ", ".join(word for word in words if word) or study.title
            panel = _word(study.panels, chosen[study.panels]) if study.panels in chosen else ""
            case = Case(curve, panel, settings, make_scene(study, settings), series.solver, series.ranks)
            _check(study, case)
            found.append(case)
    return found


def overkill(study: Study, case: Case) -> list[Settings]:
    """The reference runs for a case: one, or three that are extrapolated."""
    own = flatten(study.reference.overkill)
    base = {key: value for key, value in case.curve_settings.items() if not _beaten(key, own)}
    finer = [{name: value} for name, values in flatten(study.reference.extrapolate).items() for value in values]
    return [base | own | settings for settings in finer or [{}]]


def references(study: Study, case: Case) -> list[Case]:
    """The reference runs that a case is held against; none where the truth is known.

    Raises:
        UserError: If their scene is impossible.
    """
    if not study.reference.overkill:
        return []
    return [
        Case(REFERENCE, "", settings, make_scene(study, settings), "elastune", case.ranks)
        for settings in overkill(study, case)
    ]


def _beaten(key: str, winners: Settings) -> bool:
    """Whether another setting takes the place of this one, or of the table that it is a part of."""
    return any(key == other or key.startswith(f"{other}.") or other.startswith(f"{key}.") for other in winners)


def stated(study: Study, case: Case) -> dict[str, float]:
    """The known values for a case."""
    values: dict[str, float] = {}
    for entry in study.reference.stated:
        where = flatten(entry.where)
        if all(read(study, case.settings, name) == value for name, value in where.items()):
            values |= entry.values
    return values


def read(study: Study, settings: Settings, name: str) -> Any:
    """The value of a dotted key under settings, or in the base scene; None if neither has it."""
    if name in settings:
        return settings[name]
    table: Any = study.scene
    for part in name.split("."):
        table = table.get(part) if isinstance(table, dict) else None
    return table


def make_scene(study: Study, settings: Settings) -> Scene:
    """The base scene with settings.

    Raises:
        UserError: If it is impossible.
    """
    data = json.loads(json.dumps(study.scene))
    try:
        for key, value in settings.items():
            assign(data, key, value)
        return parse(data, Path(f"{study.name}.toml"))
    except UserError as error:
        given = ", ".join(f"{key} = {value!r}" for key, value in settings.items())
        raise StudyError(f"{error} (case {given})") from None


def _word(name: str, value: Any) -> str:
    """A varied value in a curve's name."""
    if name == "mesh.grade":
        return "graded" if value else "even"
    if isinstance(value, dict):
        return ", ".join(_word(key, entry) for key, entry in value.items() if key != "volume")
    symbols = {"nu": "ν", "alpha": "α"}
    last = name.rpartition(".")[2]
    return str(value) if isinstance(value, str) else f"{symbols.get(last, last)} = {value}"


def _check(study: Study, case: Case) -> None:
    held = [face for face, condition in case.scene.boundary.items() if condition.held()]
    for name, quantity in study.quantities.items():
        if quantity.reaction is not None and quantity.reaction not in held:
            raise StudyError(
                f"{study.name}.toml: quantities.{name}.reaction = {quantity.reaction!r}: "
                f"expected a held face, {' or '.join(held)}"
            )
    if study.reference.stated and study.plot not in stated(study, case):
        raise StudyError(f"{study.name}.toml: reference.stated: no {study.plot} for the case {case.line}")
    references(study, case)
