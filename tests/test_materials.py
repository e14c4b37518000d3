"""Every energy of the catalogue against a second formulation, in 50 digits, written from the sources."""

from collections.abc import Callable
from functools import partial
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import ufl

from elastune.forms.energy import Material
from elastune.forms.evaluation import as_numpy, evaluate
from elastune.forms.kinematics import GradientMeasures, PrincipalStretches
from elastune.forms.materials import CATALOGUE, get, make
from elastune.forms.normalize import linearize

mp.mp.dps = 50


# ---------------------------------------------------------------- the sources, in their own notation
# s: three stretches. A constant term that the papers drop or get wrong is subtracted by `rested`.
def rested(energy: Callable[..., Any]) -> Callable[..., Any]:
    return lambda s, **v: energy(s, **v) - energy([mp.mpf(1)] * 3, **v)


def first(s: Any) -> Any:
    return sum(x * x for x in s)


def second(s: Any) -> Any:
    return s[0] ** 2 * s[1] ** 2 + s[1] ** 2 * s[2] ** 2 + s[2] ** 2 * s[0] ** 2


def bower(s: Any, lam: Any, mu: Any) -> Any:
    return mu / 2 * (first(s) / mp.cbrt(mp.fprod(s)) ** 2 - 3) + lam / 2 * (mp.fprod(s) - 1) ** 2


def hill(f: Callable[[Any], Any], s: Any, lam: Any, mu: Any) -> Any:
    return mu * sum(f(x) ** 2 for x in s) + lam / 2 * sum(f(x) for x in s) ** 2


def green(s: Any, lam: Any, mu: Any) -> Any:
    E = (mp.diag([x * x for x in s]) - mp.eye(3)) / 2
    return mu * mp.norm(E, 2) ** 2 + lam / 2 * sum(E[i, i] for i in range(3)) ** 2


def stabilised(s: Any, lam: Any, pull: Any, shear: Any) -> Any:
    """Smith et al., Sec. 3.2: `shear` and λ/2 (J - α)², with α such that `pull` holds it at rest."""
    return shear + lam / 2 * (mp.fprod(s) - (1 + pull / lam)) ** 2


def stable(s: Any, lam: Any, mu: Any) -> Any:
    return stabilised(s, lam, mu, mu / 2 * (first(s) - 3)) - mu**2 / (2 * lam)


def peng(s: Any, E: Any) -> Any:
    logs = [mp.log(x) for x in s]
    return E * sum(mp.exp(y) - 1 - y - y**2 / 6 + y**3 / 18 - y**4 / 216 for y in logs)


def xu(s: Any, lam: Any, mu: Any, area: Any, f: str, g: str, h: str) -> Any:
    areas = [s[i] * s[j] for i in range(3) for j in range(i)]
    curve = FUNCTIONS
    return 2 * mu * sum(map(curve[f], s)) + area * sum(map(curve[g], areas)) + lam * curve[h](mp.fprod(s))


STRAINS = {
    "log": mp.log,
    "biot": lambda x: x - 1,
    "green": lambda x: (x + 1) * (x - 1) / 2,
    "almansi": lambda x: (1 - 1 / x) * (1 + 1 / x) / 2,
    "bazant": lambda x: mp.sinh(mp.log(x)),
}
FUNCTIONS = {
    "quadratic": lambda x: (x - 1) ** 2 / 2,
    "log": lambda x: mp.log(x) ** 2 / 2,
    "green": lambda x: ((x * x - 1) / 2) ** 2 / 2,
    "neo": lambda x: (x * x - 1) / 4 - mp.log(x) / 2,
    "valanis": lambda x: x * (mp.log(x) - 1) + 1,
    "exponential": lambda x: mp.expm1((x - 1) ** 2) / 2,
}
SOURCES: dict[str, Callable[..., Any]] = {
    "linear-elasticity": lambda s, lam, mu: hill(lambda x: x - 1, s, lam, mu),
    "linear-corotational": lambda s, lam, mu: hill(lambda x: x - 1, s, lam, mu),
    "st-venant-kirchhoff": green,
    "hencky": lambda s, lam, mu: hill(mp.log, s, lam, mu),
    "seth-hill": lambda s, lam, mu, alpha: hill(lambda x: (x**alpha - 1) / alpha, s, lam, mu),
    "symmetric-seth-hill": lambda s, lam, mu, alpha: hill(lambda x: mp.sinh(alpha * mp.log(x)) / alpha, s, lam, mu),
    "hill": lambda s, lam, mu, f: hill(STRAINS[f], s, lam, mu),
    "st-venant-kirchhoff-kikuuwe": lambda s, lam, mu, kappa: (
        green(s, lam, mu) + kappa / 12 * max(0, (1 - mp.fprod(s)) / 6) ** 3
    ),
    "neo-hookean": lambda s, lam, mu: (
        mu / 2 * (first(s) - 3) - mu * mp.log(mp.fprod(s)) + lam / 2 * mp.log(mp.fprod(s)) ** 2
    ),
    "neo-hookean-ogden": lambda s, lam, mu: (
        mu / 2 * (first(s) - 3) - mu * mp.log(mp.fprod(s)) + lam / 2 * (mp.fprod(s) - 1) ** 2
    ),
    "sts": lambda s, lam, mu, mu4: SOURCES["neo-hookean"](s, lam, mu) + mu4 / 8 * sum((x**2 - 1) ** 4 for x in s),
    "neo-hookean-bower": bower,
    "wang-yang": lambda s, lam, mu, variant: bower(s, lam, mu),
    "rivlin-penalty": lambda s, lam, mu, variant: stable(s, lam, mu),
    "stable-neo-hookean": stable,
    "stable-neo-hookean-barrier": rested(
        lambda s, lam, mu, variant: stabilised(
            s, lam, 3 * mu / 4, mu / 2 * (first(s) - 3) - mu / 2 * mp.log(first(s) + 1)
        )
    ),
    "fung": rested(
        lambda s, lam, mu0, gamma, mu1, variant: stabilised(
            s,
            lam,
            mu0 + gamma * mu1,
            mu0 / 2 * (first(s) - 3) + gamma / 2 * mp.expm1(mu1 * (first(s) - 3)),
        )
    ),
    "arruda-boyce": rested(
        lambda s, lam, mu, beta1, beta2: stabilised(
            s,
            lam,
            mu * (1 + 3 * beta1 + 9 * beta2),
            mu * (first(s) / 2 + beta1 / 4 * first(s) ** 2 + beta2 / 6 * first(s) ** 3),
        )
    ),
    "fixed-corotational": lambda s, lam, mu: mu * sum((x - 1) ** 2 for x in s) + lam / 2 * (mp.fprod(s) - 1) ** 2,
    "valanis-landel": rested(
        lambda s, lam, mu, variant: 2 * mu * sum(x * (mp.log(x) - 1) for x in s) + lam / 2 * mp.log(mp.fprod(s)) ** 2
    ),
    "valanis-landel-separable": lambda s, lam, mu, f, h: (
        2 * mu * sum(FUNCTIONS[f](x) for x in s) + lam * FUNCTIONS[h](mp.fprod(s))
    ),
    "valanis-landel-xu": lambda s, variant, **v: xu(s, **v),
    "peng-landel": peng,
    "arap": lambda s, scale: scale * sum((x - 1) ** 2 for x in s),
    "symmetric-arap": lambda s, mu: mu / 2 * sum((x - 1) ** 2 + (1 / x - 1) ** 2 for x in s),
    "symmetric-dirichlet": rested(lambda s, scale, variant: scale / 2 * (first(s) + first([1 / x for x in s]))),
    "ogden": lambda s, mu, alpha, variant: sum(
        m / a * (sum(x**a for x in s) - 3) - m * mp.log(mp.fprod(s)) for m, a in zip(mu, alpha, strict=True)
    ),
    "mooney-rivlin": lambda s, C1, C2, K, variant: (
        C1 * (first(s) / mp.cbrt(mp.fprod(s)) ** 2 - 3)
        + C2 * (second(s) / mp.cbrt(mp.fprod(s)) ** 4 - 3)
        + K / 2 * (mp.fprod(s) - 1) ** 2
    ),
}

# Every material with its usual options, and with every other choice of each, apart from what is as printed.
CASES: list[tuple[str, dict[str, str]]] = [(name, {}) for name in CATALOGUE] + [
    (name, {option: choice})
    for name, entry in CATALOGUE.items()
    for option, choices in entry.options.items()
    for choice in choices[1:]
    if option != "variant"
]
each_case = pytest.mark.parametrize(("name", "options"), CASES, ids=str)
each_material = pytest.mark.parametrize("entry", CATALOGUE.values(), ids=list(CATALOGUE))


def random_parameters(entry: Material, rng: np.random.Generator) -> dict[str, Any]:
    def vary(value: Any) -> Any:
        return tuple(map(vary, value)) if isinstance(value, tuple) else float(value * rng.uniform(0.5, 1.5))

    return {parameter.name: vary(parameter.default) for parameter in entry.parameters}


def reference(entry: Material, parameters: dict[str, Any], options: dict[str, str]) -> Callable[..., Any]:
    """ψ(s₁, s₂, s₃) of the source."""
    exact = {k: tuple(map(mp.mpf, v)) if isinstance(v, tuple) else mp.mpf(v) for k, v in parameters.items()}
    usual = {option: choices[0] for option, choices in entry.options.items()}
    energy = partial(SOURCES[entry.name], **exact, **{**usual, **options})
    return lambda *s: energy(list(s))


@each_case
def test_energy_and_stress_are_those_of_the_source(name: str, options: dict[str, str]) -> None:
    rng = np.random.default_rng(1)
    for _ in range(3):
        parameters, s = random_parameters(get(name), rng), rng.uniform(0.5, 1.8, 3)
        exact, at = reference(get(name), parameters, options), [mp.mpf(x) for x in s]
        energy = make(name, **parameters, **options)
        expected = float(exact(*at))
        value = evaluate(energy.density(PrincipalStretches(list(s))))
        assert value == pytest.approx(expected, rel=1e-14, abs=1e-14)
        variables = [ufl.variable(ufl.as_ufl(1.0)) for _ in s]
        psi = energy.density(PrincipalStretches(variables))
        values = as_numpy([psi, *(ufl.diff(psi, x) for x in variables)], variables)(*s)
        slopes = [float(mp.diff(exact, at, tuple(int(i == j) for j in range(3)))) for i in range(3)]
        assert values == pytest.approx([expected, *slopes], rel=1e-13, abs=1e-13)


@each_case
def test_rest_state_is_that_of_the_source(name: str, options: dict[str, str]) -> None:
    rng = np.random.default_rng(2)
    for _ in range(3):
        parameters = random_parameters(get(name), rng)
        exact, rest = reference(get(name), parameters, options), [mp.mpf(1)] * 3
        stretch, mixed = mp.diff(exact, rest, (2, 0, 0)), mp.diff(exact, rest, (1, 1, 0))
        at_rest = linearize(make(name, **parameters, **options))
        scale = float(abs(stretch))
        assert abs(exact(*rest)) < 1e-45 and abs(mp.diff(exact, rest, (1, 0, 0))) < 1e-20
        assert abs(at_rest.energy) <= 1e-15 * scale and abs(at_rest.stress) <= 1e-14 * scale
        expected = [float(mixed), float(stretch - mixed) / 2]
        assert [at_rest.lame_lambda, at_rest.lame_mu] == pytest.approx(expected, rel=1e-13, abs=1e-14 * scale)


@each_case
def test_closed_form_of_the_lame_pair(name: str, options: dict[str, str]) -> None:
    rng = np.random.default_rng(3)
    entry = get(name)
    assert entry.lame is not None
    for _ in range(5):
        parameters = random_parameters(entry, rng)
        at_rest = linearize(entry.energy(**parameters, **options))
        scale = abs(at_rest.lame_lambda) + at_rest.lame_mu
        expected = pytest.approx(entry.lame(**parameters), rel=1e-13, abs=1e-14 * scale)
        assert (at_rest.lame_lambda, at_rest.lame_mu) == expected


# ---------------------------------------------------------------- domain, and dependence on F
def derivatives(name: str, options: dict[str, str], stretches: tuple[float, ...]) -> np.ndarray:
    """ψ with its first and second derivatives in the stretches, not a number where there is none."""
    s = [ufl.variable(ufl.as_ufl(1.0)) for _ in range(3)]
    psi = make(name, **options).density(PrincipalStretches(s))
    slopes = [ufl.diff(psi, x) for x in s]
    return np.array(as_numpy([psi, *slopes, *(ufl.diff(p, x) for p in slopes for x in s)], s)(*stretches))


@each_material
def test_inverts_is_what_the_energy_does(entry: Material) -> None:
    flat_or_inverted = [(1.2, 0.9, 0.0), (1.2, 0.9, -0.4), (0.0, 0.0, 0.0), (-1.1, -0.8, -0.3)]
    cases = [options for name, options in CASES if name == entry.name]
    finite = [np.isfinite(derivatives(entry.name, options, s)).all() for options in cases for s in flat_or_inverted]
    assert all(finite) if entry.inverts else not all(finite)


def gradient(rng: np.random.Generator, stretches: Any) -> np.ndarray:
    """F of these stretches between two random rotations."""
    U, V = (np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2))
    return np.linalg.det(U) * np.linalg.det(V) * U @ np.diag(stretches) @ V.T


def density(name: str, F: np.ndarray) -> float:
    return evaluate(make(name).density(GradientMeasures(ufl.as_matrix(F.tolist()))))


@each_material
def test_energy_of_a_gradient_is_that_of_its_stretches(entry: Material) -> None:
    rng = np.random.default_rng(4)
    for s in ((1.4, 1.1, 0.7), (0.9, 0.6, 1.7), (1.2, 1.2, 0.8), (1.3, 0.9, 0.9), (1.1, 1.1, 1.1), (1, 1, 1)):
        expected = evaluate(entry.energy().density(PrincipalStretches(s)))
        value = density(entry.name, gradient(rng, s))
        if entry.objective:
            assert value == pytest.approx(expected, rel=1e-12, abs=1e-13)
        else:
            assert abs(value - expected) > 1e-3, "a rotation should have changed it"


@each_material
def test_energies_of_invariants_use_no_eigenvalues_and_see_inversion(entry: Material) -> None:
    measures = GradientMeasures(ufl.as_matrix(gradient(np.random.default_rng(5), (1.4, 1.1, -0.7)).tolist()))
    psi = entry.energy().density(measures)
    if entry.inverts and entry.objective and not measures.uses_eigenvalues:
        expected = evaluate(entry.energy().density(PrincipalStretches((1.4, 1.1, -0.7))))
        assert evaluate(psi) == pytest.approx(expected, rel=1e-13)
    in_invariants = {"neo-hookean", "neo-hookean-ogden", "neo-hookean-bower", "wang-yang", "mooney-rivlin"}
    in_invariants |= {"stable-neo-hookean", "stable-neo-hookean-barrier", "fung", "arruda-boyce"}
    in_invariants |= {"rivlin-penalty", "st-venant-kirchhoff", "st-venant-kirchhoff-kikuuwe"}
    in_invariants |= {"symmetric-dirichlet"}
    assert measures.uses_eigenvalues == (entry.objective and entry.name not in in_invariants)


def test_measures_of_a_gradient_and_their_powers() -> None:
    s = np.array([0.7, 1.1, 1.4])
    F = gradient(np.random.default_rng(6), s)
    for alpha in (1, 0.5, 2, 3.5):
        of_gradient = GradientMeasures(ufl.as_matrix(F.tolist()))
        measures = of_gradient if alpha == 1 else of_gradient.power(alpha)
        values = [measures.I1, measures.I2, measures.J, *measures.stretches, *measures.areas]
        a, b, c = s**alpha
        areas = [a * b, b * c, c * a]
        expected = [a * a + b * b + c * c, sum(x * x for x in areas), a * b * c, a, b, c, *areas]
        assert [evaluate(value) for value in values] == pytest.approx(expected, rel=1e-13)


def test_every_function_of_ufl_has_its_value() -> None:
    """A new material may use what the catalogue does not."""

    def all_of(x: Any, y: Any) -> list[Any]:
        names = "ln exp sqrt sin cos tan sinh cosh tanh asin acos atan sign".split()
        conditions = [ufl.lt(x, y), ufl.gt(x, y), ufl.le(x, y), ufl.ge(x, y), ufl.eq(x, y), ufl.ne(x, y)]
        conditions += [ufl.And(ufl.lt(x, y), ufl.gt(x, 0.5)), ufl.Or(ufl.lt(x, y), ufl.gt(x, 0.5))]
        conditions += [ufl.Not(ufl.lt(x, y))]
        values = [getattr(ufl, name)(x) for name in names]
        values += [abs(x - y), x / y, x**y, ufl.min_value(x, y), ufl.max_value(x, y), ufl.atan2(x, y)]
        return values + [ufl.conditional(condition, x, y) for condition in conditions]

    x, y = (ufl.variable(ufl.as_ufl(1.0)) for _ in range(2))
    function = as_numpy(all_of(x, y), (x, y))
    expected = np.transpose([list(map(evaluate, all_of(*at))) for at in ((0.3, 0.7), (0.7, 0.3))])
    assert np.array(function(0.3, 0.7)) == pytest.approx(expected[:, 0], rel=1e-15)
    together = np.array(function(np.array([0.3, 0.7]), np.array([0.7, 0.3])))
    assert together == pytest.approx(expected, rel=1e-15)
    with pytest.raises(NotImplementedError, match="BesselJ"):
        as_numpy([ufl.bessel_J(1, x)], [x])
