"""What `elastune materials` shows: the table of all energies, or one of them with its uniaxial curve."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from elastune.app import interrupts

if TYPE_CHECKING:
    from rich.console import Console

    from elastune.forms.energy import Energy, Material
    from elastune.forms.normalize import Linearization

_NO_LAMBDA = 'no λ part: shown at ν = 0; volume = "neo-hookean-ogden" gives it any ν'
_NUMBERS = ("E", "ν", "λ_Lamé", "μ_Lamé")
_WIDE, _PIPE, _NARROW = 110, 80, 75
_STRETCHES = (0.4, 2.5)
_FAMILY = {0.5: "#3b7dd8", 1.0: "#1b1b1b", 2.0: "#d1495b"}


def table(E: float, nu: float, console: "Console") -> None:
    """Prints every material of the catalogue, calibrated.

    Args:
        E: Young's modulus that all are calibrated to, in the unit of stress.
        nu: Poisson's ratio; materials without a λ part stand at zero.
        console: Where to; in a wide one the energies have a column of their own.

    Raises:
        MaterialError: If E or ν is impossible.
    """
    from elastune.forms.materials import CATALOGUE
    from elastune.forms.normalize import lame_pair

    lame_pair(E, nu)
    rows = [_row(CATALOGUE[name], E, nu) for name in sorted(CATALOGUE)]
    # The same in every pipe.
    width = _PIPE if console.soft_wrap else console.width
    if width >= _WIDE:
        _columns(rows, console)
    else:
        _blocks(rows, console, width)
    if any(row.numbers[1].endswith("*") for row in rows):
        console.print(f"* {_NO_LAMBDA}", highlight=False, markup=False)


def show(name: str, E: float, nu: float, out: Path, options: Mapping[str, Any], console: "Console") -> Path:
    """Prints one material, calibrated, and draws its uniaxial curve.

    Args:
        name: Name in the catalogue.
        E: Young's modulus, in the unit of stress.
        nu: Poisson's ratio; a material without a λ part stands at zero.
        out: The picture to write, or the folder to write NAME.png in.
        options: Further arguments of `elastune.forms.tuned.tuned_energy`: parameters, volume, alpha, calibrate...
        console: Where to print.

    Returns:
        The picture's path.

    Raises:
        MaterialError: If the material cannot be what is asked for.
    """
    from elastune.forms.materials import get
    from elastune.forms.normalize import linearize
    from elastune.forms.tuned import tuned_energy

    material = get(name)
    parameters = options.get("parameters") or {}
    lacks_lambda = not (material.energy(**parameters).has_lambda or options.get("volume"))
    nu = 0.0 if lacks_lambda else nu
    plain = {key: value for key, value in options.items() if not key.startswith("alpha")}
    base, chosen = tuned_energy(name, E, nu, **plain), tuned_energy(name, E, nu, **options)
    achieved = _rounded(linearize(chosen))
    path = out if out.suffix == ".png" else out / f"{name}.png"
    exponents = {key: options[key] for key in options if key not in plain and options[key] is not None}
    _draw(path, name, base, chosen, exponents, achieved)

    console.print(f"[bold]{name}[/bold]  [dim]{material.source}[/dim]", highlight=False)
    console.print(material.formula, highlight=False, markup=False)
    if material.notes:
        console.print(material.notes, style="dim", highlight=False, markup=False)
    facts = {"parameters": _values(chosen, digits=6)}
    facts |= {label: f"{value:.6g}" for label, value in zip(_NUMBERS, achieved, strict=True)}
    facts["domain"] = _domain(chosen)
    facts |= {option: " | ".join(choices) for option, choices in material.options.items()}
    for label, fact in (facts | {"curve": str(path)}).items():
        console.print(f"{label:<13}{fact}", highlight=False, markup=False)
    if lacks_lambda:
        console.print(_NO_LAMBDA, highlight=False, markup=False)
    return path


class _Row(NamedTuple):
    """A line of the table: E, ν, λ_Lamé and μ_Lamé are what linearising the calibrated energy gives."""

    material: "Material"
    formula: str
    values: str
    numbers: list[str]


def _row(material: "Material", E: float, nu: float) -> _Row:
    from elastune.forms.energy import MaterialError
    from elastune.forms.normalize import calibrate, linearize

    # The energy without the definitions that follow it.
    formula = material.formula.split(",  ")[0].rstrip(".")
    mark = "" if material.energy().has_lambda else "*"
    try:
        energy = calibrate(material, E, 0.0 if mark else nu)
    except MaterialError as error:
        return _Row(material, formula, str(error), ["-"] * 4)
    numbers = [f"{value:.4g}" for value in _rounded(linearize(energy))]
    numbers[1] += mark
    return _Row(material, formula, _values(energy), numbers)


def _columns(rows: list[_Row], console: "Console") -> None:
    """For a wide console: two lines a material."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    grid = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), leading=1, pad_edge=False)
    grid.add_column("material", width=27)
    grid.add_column("energy and parameters")
    for heading in _NUMBERS:
        grid.add_column(heading, justify="right", no_wrap=True)
    grid.add_column("domain", no_wrap=True)
    for material, formula, values, numbers in rows:
        name = Text(material.name, style="bold").append(f"\n{material.source}", style="not bold dim")
        energy = Text(formula).append(f"\n{values}", style="cyan")
        grid.add_row(name, energy, *numbers, _domain(material))
    console.print(grid)


def _blocks(rows: list[_Row], console: "Console", width: int) -> None:
    """For a narrow console or a pipe: a heading with the numbers, and energy and parameters below it."""
    from rich.text import Text

    def line(name: str, numbers: Sequence[str], domain: str) -> str:
        E, nu, first, second = numbers
        if width < _NARROW:
            return f"{name}\n  {E}  {nu}  {first}  {second}  {domain}"
        return f"{name:<28}{E:>8}{nu:>7}{first:>11}{second:>11}  {domain}"

    console.print(Text(line("material", _NUMBERS, "domain"), style="bold"))
    for material, formula, values, numbers in rows:
        console.print(Text(line(material.name, numbers, _domain(material)), style="bold"))
        fits = len(values) + len(material.source) + 5 <= width
        below = Text(f"  {formula}").append(f"\n  {values}", style="cyan")
        console.print(below.append(f"{' · ' if fits else f'{chr(10)}  '}{material.source}", style="dim"))


def _rounded(at_rest: "Linearization") -> list[float]:
    """E, ν, λ_Lamé and μ_Lamé, with a λ of pure rounding as zero."""
    without = abs(at_rest.lame_lambda) < 1e-12 * at_rest.lame_mu
    nu, lame_lambda = (0.0, 0.0) if without else (at_rest.poissons_ratio, at_rest.lame_lambda)
    return [at_rest.youngs_modulus, nu, lame_lambda, at_rest.lame_mu]


def _values(energy: "Energy", digits: int = 4) -> str:
    def text(value: Any) -> str:
        return " ".join(f"{term:.{digits}g}" for term in (value if isinstance(value, tuple) else (value,)))

    return ", ".join(f"{name} = {text(value)}" for name, value in energy.values.items())


def _domain(energy: "Energy | Material") -> str:
    return "any J" if energy.inverts else "J > 0"


def _draw(
    path: Path,
    name: str,
    base: "Energy",
    chosen: "Energy",
    exponents: Mapping[str, float],
    achieved: Sequence[float],
) -> None:
    """Nominal stress and lateral stretch over axial stretch, for a family of exponents."""
    import numpy as np

    from elastune.app.results.pictures import style
    from elastune.app.tuning.response import respond
    from elastune.forms.tuning import with_nonlinearity

    E, nu, *_ = achieved
    stretches = np.linspace(*_STRETCHES, 211)
    curves: list[tuple[str, str, Energy]] = [
        (f"α = {alpha:g}", color, with_nonlinearity(base, alpha))
        for alpha, color in _FAMILY.items()
        if base.objective or alpha == 1
    ]
    if exponents and exponents.get("alpha") not in _FAMILY:
        label = ", ".join(f"{key.replace('alpha', 'α')} = {value:g}" for key, value in exponents.items())
        curves.append((label, "#2a9d6f", chosen))

    figure = style.figure((7, 6))
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
    for label, color, energy in curves:
        stress, lateral = respond(energy, "uniaxial", stretches)
        width = 2.4 if label == "α = 1" else 1.7
        above.plot(stretches, stress / E, color=color, lw=width, label=label)
        below.plot(stretches, lateral, color=color, lw=width)
        if label == "α = 1":
            above.set_ylim(*_window(stress / E))
    tangent = {"color": "#8a8a8a", "ls": (0, (5, 3)), "lw": 1.2, "zorder": 1.5}
    above.plot(stretches, stretches - 1, label="small strain, E (λ - 1)", **tangent)
    below.plot(stretches, 1 - nu * (stretches - 1), **tangent)
    below.set_ylim(0.3, 1.7)
    above.set_ylabel("nominal stress, in units of E")
    below.set_ylabel("lateral stretch")
    below.set_xlabel("axial stretch λ, length over rest length")
    above.set_xlim(*_STRETCHES)
    above.legend(loc="upper left", frameon=False)
    above.set_title(f"{name}, uniaxial, E = {E:g}, ν = {nu:.4g}", loc="left", fontweight="bold")
    for axes in (above, below):
        style.dress(axes)
        axes.axhline(0 if axes.get_ylim()[0] < 0 else 1, color="#b5b5b5", lw=0.8, zorder=0)
        axes.axvline(1, color="#b5b5b5", lw=0.8, zorder=0)
    path.parent.mkdir(parents=True, exist_ok=True)
    with interrupts.held():
        figure.savefig(path)


def _window(stress: Any) -> tuple[float, float]:
    """Limits of the stress axis: what the plain material spans, within reason, with room for the others."""
    import numpy as np

    low, high = np.nanmin(stress), np.nanmax(stress)
    return float(np.clip(1.3 * low, -3, -0.8)), float(np.clip(1.3 * high, 1.5, 4))
