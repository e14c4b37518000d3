"""Energies as pure functions of stretch measures, and the registry of materials that make them."""

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import Annotated, Any, NamedTuple, get_args

from elastune.forms.kinematics import PrincipalStretches, Scalar

Value = Any  # a number, or a tuple of numbers for a parameter with terms
Values = Mapping[str, Value]


class MaterialError(ValueError):
    """A material, parameter or target that cannot be: one line with what was expected and what came."""


def as_number(value: Any, where: str) -> float:
    """The value as a float.

    Raises:
        MaterialError: If it is not a real number; a word that reads like one is none.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise MaterialError(f"{where}: expected a number, got {value!r}")
    return float(value)


class Bounds(NamedTuple):
    """Open interval of a parameter; a modulus has the unit of stress and scales with E."""

    low: float
    high: float
    modulus: bool
    nonzero: bool = False


_INF = float("inf")
Modulus = Annotated[Any, Bounds(-_INF, _INF, True)]
PositiveModulus = Annotated[Any, Bounds(0.0, _INF, True)]
Number = Annotated[Any, Bounds(-_INF, _INF, False)]
Exponent = Annotated[Any, Bounds(-_INF, _INF, False, nonzero=True)]


class Parts(NamedTuple):
    """ψ = shear + bulk · volume, where `volume` has the Lamé pair (1, 0) at rest (Chen & Barbič, Eq. 19).

    A material without a λ part leaves the last two out.
    """

    shear: Scalar
    bulk: Scalar = 0.0
    volume: Scalar | None = None

    @property
    def total(self) -> Scalar:
        """ψ."""
        return self.shear if self.volume is None else self.shear + self.bulk * self.volume


@dataclass(frozen=True)
class Energy:
    """A strain-energy density with the values of its parameters.

    Attributes:
        name: What people call it.
        parts: ψ as a function of stretch measures and parameter values, numbers or UFL expressions alike.
        values: Parameter values, which stay run-time constants of everything compiled from the energy.
        inverts: Whether ψ is defined and finite for J <= 0.
        objective: False for an energy of the small strain, which no function of stretches can be.
    """

    name: str
    parts: Callable[[PrincipalStretches, Values], Parts]
    values: Values
    inverts: bool = True
    objective: bool = True

    def density(self, measures: PrincipalStretches, values: Values | None = None) -> Scalar:
        """ψ per unit reference volume.

        Args:
            measures: Invariants and stretches, of F or of three scalars.
            values: Replaces the stored values, e.g. by UFL constants.
        """
        return self.parts(measures, self.values if values is None else values).total

    @property
    def incompressible(self) -> bool:
        """Whether the λ part weighs infinitely much: ν = 0.5, for mixed elements only."""
        return self.parts(PrincipalStretches((1.0, 1.0, 1.0)), self.values).bulk == float("inf")

    @property
    def shear(self) -> "Energy":
        """The μ part as an energy of its own."""
        return replace(self, parts=lambda s, v: Parts(self.parts(s, v).shear))

    @property
    def has_lambda(self) -> bool:
        """Whether the energy states a λ part; without one, λ_Lamé is zero."""
        return self.parts(PrincipalStretches((1.0, 1.0, 1.0)), self.values).volume is not None

    def constants(self) -> list[float]:
        """All parameter values in one list, in the order that `unpack` reads."""
        return [number for value in self.values.values() for number in _terms(value)]

    def unpack(self, constants: Sequence[Scalar]) -> dict[str, Value]:
        """Names the entries of a flat list of constants, e.g. of a UFL vector constant."""
        named: dict[str, Value] = {}
        entries = iter(constants)
        for name, value in self.values.items():
            if isinstance(value, tuple):
                named[name] = tuple(next(entries) for _ in value)
            else:
                named[name] = next(entries)
        return named

    def with_values(self, values: Values) -> "Energy":
        """The same energy with some parameter values replaced."""
        return replace(self, values={**self.values, **values})


def _terms(value: Value) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else (value,)


@dataclass(frozen=True)
class Parameter:
    """Name, default and bounds of a material parameter."""

    name: str
    default: Value
    bounds: Bounds

    def check(self, value: Value, where: str) -> Value:
        """The value as float or tuple of floats.

        Raises:
            MaterialError: If it is not a number, has no terms, or lies outside the bounds.
        """
        where = f"{where}.{self.name}"
        wants_terms = isinstance(self.default, tuple)
        if isinstance(value, list | tuple) != wants_terms or (wants_terms and not value):
            expected = "a list of numbers" if wants_terms else "a number"
            raise MaterialError(f"{where}: expected {expected}, got {value!r}")
        numbers = tuple(as_number(term, where) for term in (value if wants_terms else (value,)))
        for number in numbers:
            if not self.bounds.low < number < self.bounds.high:
                limits = f"{self.bounds.low:g} and {self.bounds.high:g}"
                raise MaterialError(f"{where}: must lie between {limits}, got {number:g}")
            if self.bounds.nonzero and number == 0:
                raise MaterialError(f"{where}: must not be 0, the limit of its formula")
        return numbers if wants_terms else numbers[0]


@dataclass(frozen=True)
class Material:
    """One entry of the catalogue.

    Attributes:
        name: The name scenes use.
        formula: The first line of the docstring, ψ.
        notes: The rest of the docstring.
        source: Where the energy is defined, with equation or table number.
        parameters: Those with numerical values.
        options: Choices by name, with the allowed names; the first is the default.
        pair: The parameters that calibration solves for, unless told otherwise.
        lame: Closed form (λ_Lamé, μ_Lamé) of the source as corrected, a function of the parameters, or None.
        inverts: Whether ψ is defined for J <= 0.
        objective: See `Energy`.
    """

    name: str
    function: Callable[..., Any]
    formula: str
    notes: str
    source: str
    parameters: tuple[Parameter, ...]
    options: Mapping[str, tuple[str, ...]]
    pair: tuple[str, ...]
    lame: Callable[..., tuple[Any, Any]] | None
    inverts: bool
    objective: bool

    @property
    def defaults(self) -> dict[str, Value]:
        """Parameter values when none are given."""
        return {parameter.name: parameter.default for parameter in self.parameters}

    def check(self, given: Mapping[str, Any]) -> tuple[dict[str, Value], dict[str, str]]:
        """Checked parameter values and options, without the defaults.

        Raises:
            MaterialError: If a name is unknown or a value impossible.
        """
        known = {parameter.name: parameter for parameter in self.parameters}
        values, options = {}, {}
        for name, value in given.items():
            if name in self.options:
                if value not in self.options[name]:
                    raise MaterialError(
                        f"{self.name}.{name}: expected one of {', '.join(self.options[name])}, got {value!r}"
                    )
                options[name] = value
            elif name in known:
                values[name] = known[name].check(value, self.name)
            else:
                names = ", ".join([*known, *self.options]) or "none"
                raise MaterialError(f"{self.name}: unknown parameter {name!r}; it has {names}")
        complete = self.defaults | values
        lengths = {name: len(value) for name, value in complete.items() if isinstance(value, tuple)}
        if len(set(lengths.values())) > 1:
            names = ", ".join(lengths)
            raise MaterialError(f"{self.name}: expected as many terms in each of {names}, got {lengths}")
        return values, options

    def energy(self, **given: Any) -> Energy:
        """The energy with the given parameters and options, defaults for the rest.

        Raises:
            MaterialError: If a name is unknown or a value impossible.
        """
        values, options = self.check(given)

        def parts(measures: PrincipalStretches, named: Values) -> Parts:
            own = {parameter.name: named[parameter.name] for parameter in self.parameters}
            result = self.function(measures, **own, **options)
            return result if isinstance(result, Parts) else Parts(result)

        return Energy(self.name, parts, {**self.defaults, **values}, self.inverts, self.objective)


CATALOGUE: dict[str, Material] = {}


def material(
    name: str,
    source: str,
    *,
    inverts: bool,
    lame: Callable[..., tuple[Any, Any]] | None = None,
    pair: Iterable[str] = (),
    objective: bool = True,
    **options: Iterable[str],
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Registers a function `psi(measures, parameters..., *, options...)` that returns ψ or its `Parts`.

    Raises:
        TypeError: If the signature does not declare what the catalogue needs.
    """

    def register(function: Callable[..., Any]) -> Callable[..., Any]:
        entry = describe(function, name, source, inverts=inverts, pair=pair, options=options)
        if not entry.formula:
            raise TypeError(f"{name}: the docstring must begin with ψ")
        CATALOGUE[name] = replace(entry, lame=lame, objective=objective)
        return function

    return register


def describe(
    function: Callable[..., Any],
    name: str,
    source: str = "",
    *,
    inverts: bool,
    pair: Iterable[str] = (),
    options: Mapping[str, Iterable[str]] | None = None,
) -> Material:
    """What a function's signature and docstring say of its material.

    The annotations of the parameters carry their bounds, the defaults their values.

    Raises:
        TypeError: If the signature does not declare them.
    """
    choices = {key: tuple(values) for key, values in (options or {}).items()}
    parameters = []
    for entry in list(inspect.signature(function, eval_str=True).parameters.values())[1:]:
        if entry.kind is entry.KEYWORD_ONLY:
            if entry.name not in choices or entry.default != choices[entry.name][0]:
                raise TypeError(f"{name}: option {entry.name} must default to its first declared choice")
            continue
        bounds = [extra for extra in get_args(entry.annotation) if isinstance(extra, Bounds)]
        if not bounds or entry.default is entry.empty:
            raise TypeError(f"{name}: parameter {entry.name} needs a bounds annotation and a default")
        parameters.append(Parameter(entry.name, entry.default, bounds[0]))
    formula, _, notes = inspect.cleandoc(function.__doc__ or "").partition("\n")
    return Material(
        name,
        function,
        formula,
        notes.strip(),
        source,
        tuple(parameters),
        choices,
        tuple(pair) or tuple(p.name for p in parameters if p.name in ("lam", "mu")),
        None,
        inverts,
        True,
    )
