"""Exponents, mixing and augmentation change no Lamé pair, and what they do change is what was asked for."""

import io
import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ufl
from matplotlib.image import imread
from rich.console import Console

from elastune.app.cli.catalogue import show, table
from elastune.app.tuning.response import respond
from elastune.forms.energy import Energy
from elastune.forms.evaluation import as_numpy, evaluate
from elastune.forms.kinematics import PrincipalStretches
from elastune.forms.materials import CATALOGUE, MaterialError, get, make
from elastune.forms.normalize import calibrate, lame_pair, linearize
from elastune.forms.tuning import with_nonlinearity, with_separate_nonlinearity, with_volume

STRETCHY = [name for name, entry in CATALOGUE.items() if entry.objective]
SPLIT = [name for name in STRETCHY if get(name).energy().has_lambda]
WHOLE = [name for name in STRETCHY if name not in SPLIT]
ALPHAS = (0.3, 0.5, 2, 3.5)
E, NU = 1.7, 0.4
LAME = lame_pair(E, NU)


def calibrated(name: str) -> Energy:
    return calibrate(get(name), E, 0.0 if name in WHOLE else NU)


def pair(energy: Energy) -> tuple[float, float]:
    at_rest = linearize(energy)
    assert abs(at_rest.energy) <= 1e-12 and abs(at_rest.stress) <= 1e-12
    return at_rest.lame_lambda, at_rest.lame_mu


def close(expected: tuple[float, float]) -> Any:
    return pytest.approx(expected, rel=1e-12, abs=1e-12)


def density(energy: Energy, s: Any) -> float:
    return evaluate(energy.density(PrincipalStretches(s)))


def third_derivative(energy: Energy) -> float:
    """∂₁₁₁ψ at rest."""
    s = [ufl.variable(ufl.as_ufl(1.0)) for _ in range(3)]
    psi = energy.density(PrincipalStretches(s))
    return float(as_numpy([ufl.diff(ufl.diff(ufl.diff(psi, s[0]), s[0]), s[0])], s)(1, 1, 1)[0])


# ---------------------------------------------------------------- exponents
@pytest.mark.parametrize("name", STRETCHY)
def test_alpha_leaves_the_pair(name: str) -> None:
    energy = calibrated(name)
    s = np.random.default_rng(1).uniform(0.6, 1.6, 3)
    for alpha in ALPHAS:
        tuned = with_nonlinearity(energy, alpha)
        assert pair(tuned) == close(pair(energy))
        assert density(tuned, s) == pytest.approx(density(energy, s**alpha) / alpha**2, rel=1e-13)
    assert with_nonlinearity(energy, 1) is energy


@pytest.mark.parametrize("name", SPLIT)
def test_separate_alphas_leave_the_pair(name: str) -> None:
    energy = calibrated(name)
    for alpha_lambda, alpha_mu in [(0.5, 2), (1, 0.3), (3.5, 1), (2, 2)]:
        assert pair(with_separate_nonlinearity(energy, alpha_lambda, alpha_mu)) == close(LAME)
    s = np.random.default_rng(2).uniform(0.6, 1.6, 3)
    once, twice = with_separate_nonlinearity(energy, 1.5, 1.5), with_nonlinearity(energy, 1.5)
    assert density(once, s) == pytest.approx(density(twice, s), rel=1e-13)


def test_the_families_within() -> None:
    s = np.random.default_rng(3).uniform(0.5, 1.8, 3)
    linear = make("linear-corotational", lam=1.4, mu=0.6)
    for alpha in (*ALPHAS, 1.3):
        family = make("seth-hill", lam=1.4, mu=0.6, alpha=alpha)
        assert density(family, s) == pytest.approx(density(with_nonlinearity(linear, alpha), s), rel=1e-13)
    kirchhoff = make("st-venant-kirchhoff", lam=1.4, mu=0.6)
    assert density(with_nonlinearity(linear, 2), s) == pytest.approx(density(kirchhoff, s), rel=1e-13)
    hencky = density(make("hencky", lam=1.4, mu=0.6), s)
    # First order in α: halving it halves the distance.
    distance = [density(make("seth-hill", lam=1.4, mu=0.6, alpha=a), s) / hencky - 1 for a in (2e-4, 1e-4)]
    assert abs(distance[1]) < 1e-4 and distance[0] / distance[1] == pytest.approx(2, rel=1e-2)


def test_alpha_does_not_always_stiffen() -> None:
    """Errata 6: what α does at first is ∂α ∂₁₁₁ψ_α = ∂₁₁₁ψ + 3 ∂₁₁ψ at α = 1, of either sign."""
    lam, mu = 0.8, 0.6
    expected = {
        "hencky": ({"lam": lam, "mu": mu}, 0.0),
        "symmetric-arap": ({"mu": mu}, 0.0),
        "symmetric-dirichlet": ({"scale": mu}, 0.0),
        "symmetric-seth-hill": ({"lam": lam, "mu": mu, "alpha": 0.7}, 0.0),
        "seth-hill": ({"lam": lam, "mu": mu, "alpha": -1.0}, -(6 * mu + 3 * lam)),
        "linear-corotational": ({"lam": lam, "mu": mu}, 6 * mu + 3 * lam),
    }
    for name, (parameters, change) in expected.items():
        energy, step = make(name, **parameters), 1e-4
        ends = [third_derivative(with_nonlinearity(energy, 1 + sign * step)) for sign in (1, -1)]
        assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(change, abs=1e-6)
        at_rest = linearize(energy)
        curvature = at_rest.lame_lambda + 2 * at_rest.lame_mu
        assert third_derivative(energy) + 3 * curvature == pytest.approx(change, abs=1e-12)
    almansi = make("seth-hill", lam=0.0, mu=1.0, alpha=-1.0)
    pull = [respond(with_nonlinearity(almansi, alpha), "uniaxial", [1.5])[0][0] for alpha in (1, 2)]
    assert pull == pytest.approx([0.296, 0.165], abs=5e-4)
    s = np.array([1.3, 0.8, 1.1])
    hencky = make("hencky")
    assert density(with_nonlinearity(hencky, 3), s) == pytest.approx(density(hencky, s), rel=1e-13)


def test_alpha_moves_the_pair_of_an_energy_stressed_at_rest() -> None:
    """Errata 6: the shift of ∂₁₁ψ is ((α - 1)/α) times the stress at rest, that of ∂₁₂ψ none."""
    printed = make("ogden", mu=(0.6,), alpha=(1.3,), variant="printed")
    before, after = linearize(printed), linearize(with_nonlinearity(printed, 2.5))
    shift = (2.5 - 1) / 2.5 * before.stress
    assert before.stress == pytest.approx(0.6)
    assert after.lame_lambda == pytest.approx(before.lame_lambda, abs=1e-14)
    assert after.lame_mu - before.lame_mu == pytest.approx(shift / 2, rel=1e-12)


# ---------------------------------------------------------------- mixing
@pytest.mark.parametrize("name", SPLIT)
def test_parts_have_the_unit_pairs(name: str) -> None:
    """Eq. 19: ψ_λ has the pair (1, 0), and ψ_μ, times μ, has (0, μ)."""
    energy = calibrated(name)
    none = make("neo-hookean-ogden")
    assert pair(with_volume(energy, none, 0.0)) == close((0.0, LAME[1]))
    nothing = calibrate(get("arap"), 1.0, 0.0).with_values({"scale": 0.0})
    assert pair(with_volume(nothing, energy, 1.0)) == close((1.0, 0.0))


@pytest.mark.parametrize("name", SPLIT)
def test_mixing_leaves_the_pair(name: str) -> None:
    energy = calibrated(name)
    for other in SPLIT:
        assert pair(with_volume(energy, make(other), LAME[0])) == close(LAME)
    s = np.random.default_rng(4).uniform(0.6, 1.6, 3)
    assert density(with_volume(energy, energy, LAME[0]), s) == pytest.approx(density(energy, s), rel=1e-11)


def test_mixed_energies_known_by_name() -> None:
    s = np.random.default_rng(5).uniform(0.6, 1.6, 3)
    lam, mu = LAME
    mixed = with_volume(make("linear-corotational", lam=9.0, mu=mu), make("neo-hookean-ogden"), lam)
    fixed = make("fixed-corotational", lam=lam, mu=mu)
    assert density(mixed, s) == pytest.approx(density(fixed, s), rel=1e-13)
    # Errata 7: the factor ½ of the unit part.
    ogden = make("neo-hookean-ogden")
    unit = evaluate(ogden.parts(PrincipalStretches(list(s)), ogden.values).volume)
    assert unit == pytest.approx((np.prod(s) - 1) ** 2 / 2, rel=1e-13)


@pytest.mark.parametrize("name", WHOLE)
def test_augmentation(name: str) -> None:
    energy = calibrate(get(name), E, NU, augmented=True)
    s = np.random.default_rng(6).uniform(0.6, 1.6, 3)
    for other in SPLIT:
        augmented = with_volume(energy, make(other), LAME[0])
        assert pair(augmented) == close(LAME)
        assert augmented.inverts == (energy.inverts and make(other).inverts)
    augmented = with_volume(energy, make("neo-hookean"), LAME[0])
    expected = density(energy, s) + LAME[0] / 2 * np.log(np.prod(s)) ** 2
    assert density(augmented, s) == pytest.approx(expected, rel=1e-13)
    assert pair(with_separate_nonlinearity(augmented, 2, 0.5)) == close(LAME)


STEPS = {
    "alpha": lambda energy: with_nonlinearity(energy, 1.7),
    "separate": lambda energy: with_separate_nonlinearity(energy, 0.6, 2.2),
    "stable": lambda energy: with_volume(energy, with_nonlinearity(make("stable-neo-hookean"), 0.8), LAME[0]),
    "seth-hill": lambda energy: with_volume(energy, make("seth-hill", alpha=-0.4), LAME[0]),
}


@pytest.mark.parametrize("order", list(itertools.product(STEPS, repeat=2)), ids="-".join)
def test_steps_follow_one_another(order: tuple[str, str]) -> None:
    for name in ("stable-neo-hookean", "seth-hill"):
        energy = calibrated(name)
        for step in order:
            energy = STEPS[step](energy)
        assert pair(energy) == close(LAME)
    twice = with_nonlinearity(with_nonlinearity(energy, 2.0), 1.5)
    s = np.random.default_rng(7).uniform(0.6, 1.6, 3)
    assert density(twice, s) == pytest.approx(density(with_nonlinearity(energy, 3.0), s), rel=1e-12)


def test_refused() -> None:
    linear, arap, stable = (make(name) for name in ("linear-elasticity", "arap", "stable-neo-hookean"))
    for alpha in (0, -1.0, float("nan"), float("inf"), "2"):
        with pytest.raises(MaterialError, match=r"^alpha: (must be a positive|expected a) number, got"):
            with_nonlinearity(stable, alpha)  # type: ignore[arg-type]
        with pytest.raises(MaterialError, match=r"^alpha_mu: "):
            with_separate_nonlinearity(stable, 1.0, alpha)  # type: ignore[arg-type]
    with pytest.raises(MaterialError, match="linear-elasticity: not a function of stretches"):
        with_nonlinearity(linear, 2.0)
    with pytest.raises(MaterialError, match="linear-elasticity: not a function of stretches"):
        with_volume(stable, linear, 1.0)
    for wrong in (lambda: with_volume(stable, arap, 1.0), lambda: with_separate_nonlinearity(arap, 1, 2)):
        with pytest.raises(MaterialError, match=r'arap: has no λ part; .*volume = "neo-hookean-ogden"'):
            wrong()


# ---------------------------------------------------------------- uniaxial curves
X = np.linspace(0.5, 2.0, 31)


def test_uniaxial_closed_forms() -> None:
    def check(name: str, stress: Any, lateral: Any, **options: Any) -> None:
        got = respond(calibrate(get(name), E, NU, options), "uniaxial", X)
        assert got[0] == pytest.approx(stress, rel=1e-11, abs=1e-13)
        assert got[1] == pytest.approx(lateral, rel=1e-12)

    check("linear-corotational", E * (X - 1), 1 - NU * (X - 1))
    check("linear-elasticity", E * (X - 1), 1 - NU * (X - 1))
    check("hencky", E * np.log(X) / X, X**-NU)
    for alpha in (-1.0, 0.5):
        check(
            "seth-hill",
            E * X ** (alpha - 1) * (X**alpha - 1) / alpha,
            (1 - NU * (X**alpha - 1)) ** (1 / alpha),
            alpha=alpha,
        )


def test_uniaxial_neo_hookean() -> None:
    for name in ("neo-hookean", "neo-hookean-ogden"):
        stress, lateral = respond(calibrate(get(name), E, NU), "uniaxial", X)
        # Whatever the function of J: without lateral stress it cancels from the difference of the two.
        assert stress == pytest.approx(LAME[1] * (X - lateral**2 / X), rel=1e-11, abs=1e-13)
        stress, lateral = respond(calibrate(get(name), 3.0, 0.4999), "uniaxial", X)
        assert stress == pytest.approx(X - X**-2.0, rel=1e-3, abs=1e-12)
        assert lateral == pytest.approx(X**-0.5, rel=1e-3)


@pytest.mark.parametrize("name", CATALOGUE)
def test_uniaxial_has_E_and_nu_at_rest(name: str) -> None:
    energy, step = calibrated(name), 1e-5
    for alpha in (1, 0.5, 2) if name in STRETCHY else (1,):
        stress, lateral = respond(with_nonlinearity(energy, alpha), "uniaxial", [1 + step, 1, 1 - step])
        assert (stress[1], lateral[1]) == (pytest.approx(0, abs=1e-13), pytest.approx(1, abs=1e-13))
        assert (stress[0] - stress[2]) / (2 * step) == pytest.approx(E, rel=1e-7)
        ratio = 0.0 if name in WHOLE else NU
        assert (lateral[2] - lateral[0]) / (2 * step) == pytest.approx(ratio, rel=1e-7, abs=1e-9)


def test_uniaxial_curves_end_where_equilibrium_does() -> None:
    kirchhoff = calibrate(get("st-venant-kirchhoff"), 1.0, 0.3)
    # w² = 1 - ν (λ² - 1) vanishes at λ² = 1 + 1/ν.
    end = np.sqrt(1 + 1 / 0.3)
    stress, lateral = respond(kirchhoff, "uniaxial", [2.5, 0.9 * end, 1.1])
    assert np.isnan([stress[0], lateral[0]]).all() and np.isfinite([stress[1:], lateral[1:]]).all()
    # Compressed, this one comes to a point where the sides would jump in: a bar's curve ends there.
    jumping = with_nonlinearity(calibrate(get("neo-hookean-bower"), 1.0, 0.3), 2.0)
    assert np.isnan(respond(jumping, "uniaxial", [0.4, 0.62, 0.63, 2.0])[1]).tolist() == [True, True, False, False]
    assert np.isnan(respond(jumping, "uniaxial", [0.62])).all()
    for wrong in ([1.0, 0.0], [-1.0], [np.nan]):
        with pytest.raises(ValueError, match="expected positive stretches"):
            respond(kirchhoff, "uniaxial", wrong)


# ---------------------------------------------------------------- what `elastune materials` shows
@pytest.mark.parametrize("width", [80, 100, 120, 160])
def test_table(width: int) -> None:
    console = Console(file=io.StringIO(), width=width)
    table(2e5, 0.3, console)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert all(name in text for name in CATALOGUE) and "…" not in text
    assert max(map(len, text.splitlines())) <= width
    assert text.count("0*") == len(WHOLE) and text.count("2e+05") >= len(CATALOGUE)


def test_show(tmp_path: Path) -> None:
    console = Console(file=io.StringIO(), width=80)
    for name, options in (
        ("stable-neo-hookean", {"alpha": 3.0}),
        ("arap", {}),
        ("arap", {"volume": "hencky"}),
        ("sts", {"parameters": {"mu4": 0.2}, "alpha_mu": 2.0}),
        ("linear-elasticity", {}),
    ):
        path = show(name, 1e6, 0.45, tmp_path / "new", options, console)
        assert path == tmp_path / "new" / f"{name}.png"
        assert imread(path).std() > 0.05, "an empty picture"
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert "lam = 3.44828e+06" in text and text.count("no λ part: shown at ν = 0") == 1
    with pytest.raises(MaterialError, match="stressed at rest"):
        show("ogden", 1e6, 0.0, tmp_path / "none.png", {"parameters": {"variant": "printed"}}, console)
    assert not (tmp_path / "none.png").exists()
