"""What to try next: each piece of advice says when it can help, and when the scene can do it."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, NamedTuple

from elastune.app.body.body import Body
from elastune.app.body.regions.parts import Part
from elastune.app.results.advice.locking import locking
from elastune.app.solvers.options import Options
from elastune.forms.elements import ELEMENTS
from elastune.forms.energy import MaterialError
from elastune.forms.volumetric import split


@dataclass(frozen=True)
class Case:
    """All that advice may depend on.

    Attributes:
        body: What was solved.
        options: How.
        started: Whether it set out from a shape other than that at rest: then there is one step, to full load.
        kind: Of the failure, see `NotConverged`; nothing of a run that converged.
        found: What is known of its state, see `diagnose`.
    """

    body: Body
    options: Options
    started: bool
    kind: str
    found: dict[str, Any]

    @property
    def mixed(self) -> bool:
        """Whether its element has pressures."""
        return self.body.p is not None

    @property
    def element(self) -> str | None:
        """One that does not lock, if there is one that takes the scene, or else is less prone to it; or None."""
        simplex = self.body.geometry.mesh.topology.cell_name() in ELEMENTS["P1"].cells
        second, mixed = ("P2", "P2-P1") if simplex else ("Q2", "Q2-P1d")
        if self.mixed:
            return None
        if self._takes_pressures:
            return mixed
        return second if ELEMENTS[self.body.element].degree == 1 else None

    @property
    def _takes_pressures(self) -> bool:
        options = self.options
        if self.started or options.method != "line-search" or options.filter != "auto":
            return False
        try:
            for part in self.body.parts:
                split(part.energy)
        except MaterialError:
            return False
        return all(part.extension is None for part in self.body.parts)

    @property
    def limit(self) -> bool:
        """Whether no equilibrium is beyond, however it is looked for."""
        return self.kind == "limit"

    @property
    def can_follow_an_arc(self) -> bool:
        """Whether `follow = "arc"` takes the scene."""
        options = self.options
        once = len(self.body.stages) == 1 and not self.started
        return once and options.linear != "iterative" and options.follow != "arc"

    @cached_property
    def undefined(self) -> Part | None:
        """A part whose energy ends at J = 0, and can be continued."""
        parts = [part for part in self.body.parts if not part.energy.inverts and part.energy.objective]
        return next((part for part in parts if part.extension is None), None)


def instead(at: Case) -> str:
    """What to write where an element locks."""
    return "take a finer mesh" if at.element is None else f'set solve.element = "{at.element}"'


class Advice(NamedTuple):
    """A thing to try.

    Attributes:
        when: Whether it may help, and can be done.
        what: What to do, in words; a key is set as they say.
    """

    when: Callable[[Case], bool]
    what: Callable[[Case], str]


# The most promising first.
ADVICE = (
    Advice(
        lambda at: at.limit and at.can_follow_an_arc,
        lambda at: 'set solve.follow = "arc", which goes on through limits',
    ),
    Advice(
        lambda at: at.limit,
        lambda at: "prescribe a motion instead of the load",
    ),
    Advice(
        lambda at: at.kind == "undefined" and at.undefined is not None and at.body.parts.can_filter and not at.mixed,
        lambda at: f"set {at.undefined.key}.extension = 0.25, which continues the energy through J = 0",  # type: ignore[union-attr]
    ),
    Advice(
        lambda at: bool(at.found["unbounded_below"]) and not at.limit,
        lambda at: "take another material or a smaller load: this energy has no minimum to find",
    ),
    Advice(
        lambda at: bool(at.found["ellipticity"] < 0) and not at.limit,
        lambda at: "take another material: this one loses ellipticity there, and the mesh decides what folds",
    ),
    Advice(
        lambda at: bool(at.found["locking"]) and at.element is not None and not at.limit,
        lambda at: instead(at),
    ),
    Advice(
        lambda at: not (at.body.parts.can_filter or at.limit),
        lambda at: 'set solve.assembly = "spectral", whose tangent can be filtered',
    ),
    Advice(
        lambda at: at.kind == "time" and at.options.time_limit is not None,
        lambda at: f"raise solve.time_limit above {at.options.time_limit:g} s, or take fewer cells",
    ),
    Advice(
        lambda at: at.kind == "iterations",
        lambda at: f"raise solve.max_iterations above {at.options.max_iterations}",
    ),
    Advice(
        lambda at: not at.started and at.kind != "time" and not at.limit,
        lambda at: f"raise solve.steps above {at.options.steps}, or lower solve.smallest_step",
    ),
    Advice(
        lambda at: (
            at.kind in ("stalled", "iterations", "indefinite")
            and at.options.method == "line-search"
            and at.options.follow == "minimum"
            and not at.mixed
            and at.body.conservative
            and at.body.parts.can_filter
        ),
        lambda at: 'set solve.method = "trust-region"',
    ),
)


def advise(case: Case) -> list[str]:
    """Next things to try, the most promising first."""
    return [what(case) for when, what in ADVICE if when(case)] or ["take a finer mesh around the worst cells"]


def locked(body: Body, options: Options, started: bool) -> dict[str, Any] | None:
    """What a summary says of the locking of a solution, see `Locking`, in a `message` too, and what to do `instead`."""
    seen = locking(body)
    if seen is None:
        return None
    return {**asdict(seen), "message": str(seen), "instead": instead(Case(body, options, started, "", {}))}
