"""The study: which cases are solved and what they are held against, read from TOML and checked before any is run."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from elastune.app.errors import UserError
from elastune.app.scene import files as toml
from elastune.app.scene.complaints import Table, complaint
from elastune.app.scene.read import load

# Relative errors of a case with an exact solution: displacement, its gradient, first Piola-Kirchhoff stress,
# and of mixed elements the pressure, all in L².
NORMS = ("l2", "h1", "stress", "pressure")

SHIPPED = Path(__file__).parent / "shipped"

Tables = dict[str, Any]
Settings = dict[str, Any]  # by dotted key
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class StudyError(UserError):
    """A study that cannot be run."""


class Quantity(Table):
    """A number that is read off a solution, at full load: exactly one of `reaction` and `at`.

    reaction: The force of a held face on the body, `along` an axis, or its moment `about` one through the origin.
    at: The displacement of this point, `along` an axis.
    """

    reaction: str | None = None
    at: Annotated[list[float], Field(min_length=2, max_length=3)] | None = None
    along: Literal["x", "y", "z"] | None = None
    about: Literal["x", "y", "z"] | None = None

    @model_validator(mode="after")
    def _one(self) -> "Quantity":
        if (self.reaction is None) == (self.at is None):
            raise ValueError("expected exactly one of reaction and at")
        turning = self.about is not None
        if (self.along is not None) == turning or (turning and self.at is not None):
            raise ValueError("expected one of along and about (a reaction only), the axis")
        return self


class Stated(Table):
    """Known values of quantities, for the cases whose settings contain `where`."""

    where: Tables = {}
    values: dict[str, float]


class Reference(Table):
    """What is taken for the truth: exactly one of these.

    manufactured: The exact solution of `verify.exact`, which takes the place of the scene's boundary and loads.
    stated: Known values.
    overkill: Settings of a scene far finer than the cases. `extrapolate` beside it has one key of the scene with
        three values in constant ratio: the limit that the three solutions point to (Richardson).
    """

    manufactured: bool = False
    stated: list[Stated] = []
    overkill: Tables = {}
    extrapolate: Tables = {}

    @model_validator(mode="after")
    def _one(self) -> "Reference":
        if [self.manufactured, bool(self.stated), bool(self.overkill)].count(True) != 1:
            raise ValueError("expected exactly one of manufactured, stated and overkill")
        for values in flatten(self.extrapolate).values():
            if not self.overkill or not isinstance(values, list) or len(values) != 3:
                raise ValueError("extrapolate: expected one key with three values, beside overkill")
        return self


class Series(Table):
    """Cases of one kind.

    label: How the figures call it, before the values that vary.
    solver: "elastune", or "tutorial" for the solver of `elastune.app.verify.tutorial`.
    ranks: MPI processes a case.
    set: Keys of the scene.
    vary: Keys of the scene with a list of values each; every combination is a case.
    """

    label: str = ""
    solver: Literal["elastune", "tutorial"] = "elastune"
    ranks: Annotated[int, Field(ge=1)] = 1
    set: Tables = {}
    vary: Tables = {}


class Study(Table):
    """One file, one comparison.

    Attributes:
        title: Above the figures.
        scene: A shipped scene by name, a scene file relative to the study, or the tables of a scene.
        quantities: What is read off each solution by name, beside energy and volume_ratio.
        plot: The quantity, or the norm of a manufactured solution, whose error the figures show.
        panels: Key of the scene; each of its values gets a panel of its own.
        tolerances: Relative errors whose price the table tells.
        repeats: How often each case is timed, if it takes less than `repeat_below` seconds.
        default: Label of the series that the table holds against other solvers; the fastest unless given.
        timeout: Seconds after which a case is given up, and finer ones of its curve are left out.
        set: Keys of the scene, for all cases.
        vary: As in a series, for all of them.
    """

    title: str
    scene: str | Tables
    quantities: dict[str, Quantity] = {}
    plot: str
    panels: str | None = None
    tolerances: list[Positive] = [0.01, 0.003, 0.001]
    repeats: Annotated[int, Field(ge=1)] = 1
    repeat_below: Positive = 60.0
    default: str | None = None
    timeout: Positive = 600.0
    reference: Reference
    set: Tables = {}
    vary: Tables = {}
    series: list[Series] = [Series()]
    name: str = Field(default="study", exclude=True)

    @model_validator(mode="after")
    def _known(self) -> "Study":
        names = ["energy", "volume_ratio", *(NORMS if self.reference.manufactured else self.quantities)]
        if self.plot not in names:
            raise ValueError(f"plot = {self.plot!r}: expected one of {', '.join(names)}")
        labels = [series.label for series in self.series if series.solver == "elastune"]
        if self.default is not None and self.default not in labels:
            raise ValueError(f"default = {self.default!r}: expected the label of a series, {', '.join(labels)}")
        return self


def flatten(tables: Tables, prefix: str = "") -> Settings:
    """Nested tables as dotted keys; `mesh.grade`, whose keys are faces, stays whole, and so do boundary conditions."""
    flat: Settings = {}
    for name, value in tables.items():
        key = f"{prefix}{name}"
        whole = key == "mesh.grade" or key.startswith("boundary.")
        flat |= flatten(value, f"{key}.") if isinstance(value, dict) and not whole else {key: value}
    return flat


def load_study(source: str) -> Study:
    """Reads a shipped study by name, or a study file, with its base scene.

    Raises:
        UserError: One line with file, key and what was expected.
    """
    path, data = toml.read(source, SHIPPED, "study")
    try:
        study = Study.model_validate({**data, "name": path.stem})
    except ValidationError as error:
        raise StudyError(f"{path.name}: {complaint(error, data, Study, 'study')}") from None
    if isinstance(study.scene, dict):
        mesh = study.scene.get("mesh", {})
        if isinstance(mesh, dict) and isinstance(mesh.get("path"), str):
            mesh["path"] = str(path.parent / mesh["path"])
    else:
        near = path.parent / study.scene
        scene = load(str(near) if near.is_file() else study.scene)
        study = study.model_copy(update={"scene": scene.model_dump(exclude_unset=True)})
    return study


def shipped() -> list[str]:
    """Names of the shipped studies."""
    return toml.names(SHIPPED)
