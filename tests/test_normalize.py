"""Calibration to E and ν, what it refuses, and the errata of the sources' table of Lamé pairs."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from elastune.forms.energy import PositiveModulus, material
from elastune.forms.kinematics import PrincipalStretches
from elastune.forms.materials import CATALOGUE, MaterialError, get, make
from elastune.forms.normalize import calibrate, check_rest, lame_pair, linearize

WITHOUT_LAMBDA = [name for name, entry in CATALOGUE.items() if not entry.energy().has_lambda]
WITH_LAMBDA = [name for name in CATALOGUE if name not in WITHOUT_LAMBDA]
RATIOS = (-0.3, 0.0, 0.2, 0.45, 0.499)


def assert_pair(energy: Any, E: float, nu: float) -> None:
    at_rest, (lame_lambda, lame_mu) = linearize(energy), lame_pair(E, nu)
    scale = abs(lame_lambda) + lame_mu
    assert abs(at_rest.energy) <= 1e-13 * scale and abs(at_rest.stress) <= 1e-13 * scale
    assert at_rest.lame_mu == pytest.approx(lame_mu, rel=1e-12)
    assert at_rest.lame_lambda == pytest.approx(lame_lambda, rel=1e-12, abs=1e-14 * scale)


def test_which_materials_lack_lambda() -> None:
    assert len(CATALOGUE) == 28
    expected = {"arap", "symmetric-arap", "symmetric-dirichlet", "ogden", "peng-landel"}
    assert set(WITHOUT_LAMBDA) == expected


# ---------------------------------------------------------------- E, ν and the Lamé pair
def test_moduli_both_ways() -> None:
    rng = np.random.default_rng(1)
    for E, nu in zip(rng.uniform(1e-3, 1e9, 50), rng.uniform(-0.99, 0.4999, 50), strict=True):
        lame_lambda, lame_mu = lame_pair(E, nu)
        assert lame_mu == pytest.approx(E / (2 + 2 * nu), rel=1e-14)
        # The bulk modulus by its own formula, an independent check on λ.
        assert lame_lambda + 2 * lame_mu / 3 == pytest.approx(E / (3 - 6 * nu), rel=1e-12)
        at_rest = linearize(make("hencky", lam=lame_lambda, mu=lame_mu))
        assert (at_rest.youngs_modulus, at_rest.poissons_ratio) == pytest.approx((E, nu), rel=1e-12)


@pytest.mark.parametrize("nu", RATIOS)
@pytest.mark.parametrize("name", WITH_LAMBDA)
def test_calibrated_pair(name: str, nu: float) -> None:
    for E in (1.0, 2.1e11):
        energy = calibrate(get(name), E, nu)
        assert_pair(energy, E, nu)
        check_rest(energy)


@pytest.mark.parametrize("name", WITHOUT_LAMBDA)
def test_calibrated_without_lambda(name: str) -> None:
    assert_pair(calibrate(get(name), 3.0, 0.0), 3.0, 0.0)
    augmented = calibrate(get(name), 3.0, 0.3, augmented=True)
    assert linearize(augmented).lame_mu == pytest.approx(3 / 2.6, rel=1e-12)
    for nu in (-0.3, 0.2, 0.45, 0.499):
        with pytest.raises(MaterialError, match=r'nu must be 0, .*volume = "neo-hookean-ogden"'):
            calibrate(get(name), 3.0, nu)


@pytest.mark.parametrize("terms", [1, 2, 3, 4, 5])
def test_ogden_of_any_length(terms: int) -> None:
    mu, alpha = [0.6, 0.3, -0.1, 0.02, 0.5][:terms], [2.0, 1.3, -2.0, 6.0, 3.0][:terms]
    energy = calibrate(get("ogden"), 5.0, 0.0, {"mu": mu, "alpha": alpha})
    assert_pair(energy, 5.0, 0.0)
    assert np.divide(energy.values["mu"], mu) == pytest.approx(energy.values["mu"][0] / mu[0])
    assert energy.values["alpha"] == tuple(alpha)


def test_given_parameters_are_kept() -> None:
    energy = calibrate(get("fung"), 2.0, 0.4, {"gamma": 0.3, "mu1": 0.7})
    assert_pair(energy, 2.0, 0.4)
    assert (energy.values["gamma"], energy.values["mu1"]) == (0.3, 0.7)
    # Far from the material's usual values: at the start of the calibration it is not even stable.
    energy = calibrate(get("valanis-landel-xu"), 1.0, 0.3, {"area": -1.0})
    assert_pair(energy, 1.0, 0.3)
    assert energy.values["area"] == -1.0


def test_parameters_not_given_keep_their_ratio_to_E() -> None:
    one, many = (calibrate(get("sts"), E, 0.3).values for E in (1.0, 50.0))
    assert {name: value * 50 for name, value in one.items()} == pytest.approx(many, rel=1e-13)


def test_named_pairs() -> None:
    energy = calibrate(get("mooney-rivlin"), 1.0, 0.4, {"C1": 0.1}, ("K", "C2"))
    assert_pair(energy, 1.0, 0.4)
    assert energy.values["C1"] == 0.1
    # C₁ and C₂ enter the Lamé pair by their sum alone.
    with pytest.raises(MaterialError, match="no value of C1 and C2 gives"):
        calibrate(get("mooney-rivlin"), 1.0, 0.4, solve_for=("C1", "C2"))
    # Nonlinear in the unknowns: the exponent of fung.
    assert_pair(calibrate(get("fung"), 1.0, 0.45, {"mu0": 0.3}, ("lam", "mu1")), 1.0, 0.45)


@pytest.mark.parametrize("name", ["fung", "arruda-boyce", "valanis-landel-xu", "mooney-rivlin", "hencky"])
def test_least_change(name: str) -> None:
    E, nu = 1.3, 0.42
    energy = calibrate(get(name), E, nu, solve_for="least")
    assert_pair(energy, E, nu)
    entry = get(name)
    assert entry.lame is not None
    scale = E / linearize(entry.energy()).youngs_modulus
    start = np.array([p.default * (scale if p.bounds.modulus else 1) for p in entry.parameters])
    found = np.array(energy.constants())
    meets = {"type": "eq", "fun": lambda ratios: np.subtract(entry.lame(*(ratios * start)), lame_pair(E, nu))}
    independent = minimize(
        lambda ratios: ((ratios - 1) ** 2).sum(),
        np.ones(len(start)),
        method="SLSQP",
        options={"ftol": 1e-15, "maxiter": 500},
        constraints=meets,
    )
    assert ((found / start - 1) ** 2).sum() <= independent.fun * (1 + 1e-5)


# ---------------------------------------------------------------- refusals
REFUSED: list[tuple[str, dict[str, Any], str]] = [
    ("neo-hookean", {"nu": 0.5}, "nu: must be below 0.5 for a displacement formulation, got 0.5"),
    ("neo-hookean", {"nu": -1}, "nu: must be above -1, got -1"),
    ("neo-hookean", {"nu": float("nan")}, "nu: must be"),
    ("neo-hookean", {"nu": "0.3"}, "nu: expected a number, got '0.3'"),
    ("neo-hookean", {"E": -1.0}, "E: must be a positive number, got -1"),
    ("neo-hookean", {"E": 0}, "E: must be a positive number"),
    ("neo-hookean", {"E": float("inf")}, "E: must be a positive number"),
    ("neo-hookean", {"E": True}, "E: expected a number, got True"),
    ("neo-hookean", {"given": {"mu": 2.0}}, "neo-hookean.mu: follows from E and nu"),
    ("arap", {"nu": 0, "given": {"scale": 2.0}}, "arap.scale: follows from E and nu"),
    ("arap", {"nu": 0, "solve_for": ("scale", "lam")}, "arap: has no λ part"),
    ("sts", {"given": {"mu5": 1.0}}, "sts: unknown parameter 'mu5'; it has lam, mu, mu4"),
    ("sts", {"given": {"mu4": "stiff"}}, "sts.mu4: expected a number, got 'stiff'"),
    ("sts", {"given": {"mu4": "0.5"}}, "sts.mu4: expected a number, got '0.5'"),
    ("sts", {"given": {"mu4": [1.0]}}, "sts.mu4: expected a number"),
    ("sts", {"given": {"mu4": float("nan")}}, "sts.mu4: must lie between -inf and inf, got nan"),
    ("hill", {"given": {"f": "cube"}}, "hill.f: expected one of log, biot, green, almansi, bazant, got"),
    ("seth-hill", {"given": {"alpha": 0}}, "seth-hill.alpha: must not be 0"),
    ("ogden", {"nu": 0, "given": {"alpha": [0.0], "mu": [1.0]}}, "ogden.alpha: must not be 0"),
    ("ogden", {"nu": 0, "given": {"mu": 1.0}}, "ogden.mu: expected a list of numbers"),
    ("ogden", {"nu": 0, "given": {"mu": []}}, "ogden.mu: expected a list of numbers"),
    ("ogden", {"nu": 0, "given": {"mu": [1.0, "x", 2.0]}}, "ogden.mu: expected a number, got 'x'"),
    ("ogden", {"nu": 0, "given": {"mu": [1.0]}}, "ogden: expected as many terms in each of mu, alpha"),
    ("ogden", {"nu": 0, "given": {"mu": [1.0], "alpha": [-2.0]}}, "ogden: expected positive shear and bulk"),
    ("fung", {"solve_for": "most"}, 'fung: calibrate must be "least" or two of lam, mu0, gamma, mu1'),
    ("fung", {"solve_for": ("lam",)}, 'fung: calibrate must be "least" or two of'),
    ("fung", {"solve_for": ("lam", "lam")}, 'fung: calibrate must be "least" or two of'),
    ("fung", {"solve_for": ("lam", "beta")}, 'fung: calibrate must be "least" or two of'),
    ("fung", {"given": {"gamma": 5.0}}, "fung, calibrated to E = 1, nu = 0.3.mu0: must lie between 0"),
    ("sts", {"solve_for": ("mu", "mu4")}, "sts: no value of mu and mu4 gives"),
]


@pytest.mark.parametrize(("name", "arguments", "message"), REFUSED)
def test_refused(name: str, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(MaterialError) as refusal:
        calibrate(get(name), **{"E": 1.0, "nu": 0.3, **arguments})
    assert str(refusal.value).startswith(message)
    assert "\n" not in str(refusal.value)


def test_unknown_material_names_the_nearest() -> None:
    with pytest.raises(MaterialError, match="unknown material 'neo-hokean'; did you mean neo-hookean"):
        get("neo-hokean")
    with pytest.raises(MaterialError, match=r"unknown material 'zzz'; `elastune materials` lists them"):
        get("zzz")


def test_a_new_material_is_one_block(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("elastune.forms.energy.CATALOGUE", catalogue := dict(CATALOGUE))

    @material("cubic", "nowhere", inverts=True)
    def cubic(s: PrincipalStretches, c: PositiveModulus = 1.0) -> Any:
        """ψ = c Σ(λᵢ - 1)² (1 + λᵢ)."""
        return c * sum((x - 1) ** 2 * (1 + x) for x in s.stretches)

    assert_pair(calibrate(catalogue["cubic"], 1.0, 0.0), 1.0, 0.0)

    def undocumented(s: PrincipalStretches) -> Any: ...
    def unbounded(s: PrincipalStretches, c: float = 1.0) -> Any: ...
    def undecided(s: PrincipalStretches, *, f: str = "b") -> Any: ...

    for function, expected in (
        (undocumented, "docstring"),
        (unbounded, "bounds annotation"),
        (undecided, "default to its first"),
    ):
        with pytest.raises(TypeError, match=expected):
            material("wrong", "nowhere", inverts=True, f=("a", "b"))(function)


# ---------------------------------------------------------------- errata: what is printed, at rest
def test_printed_energies_that_are_stressed_at_rest() -> None:
    """∂ψ/∂λᵢ, λ and μ of the printed energies, by closed forms of their own; calibration refuses them."""
    rng = np.random.default_rng(7)
    lam, mu, C1, C2, K, mu0, gamma, mu1 = rng.uniform(0.5, 2, 8)
    m, a = (0.6, -0.2), (1.3, -2.0)
    pull, origin = mu0 + gamma * mu1, mu * (1 - lam**2 / 4)
    printed: dict[str, tuple[dict[str, Any], tuple[float, float, float]]] = {
        "ogden": ({"mu": m, "alpha": a}, (0.4, 0, (0.6 * 0.3 + 0.2 * 3) / 2)),
        "mooney-rivlin": ({"C1": C1, "C2": C2, "K": K}, (2 * C1 + 4 * C2, -4 / 3 * (2 * C1 + 5 * C2), C1)),
        "wang-yang": ({"lam": lam, "mu": mu}, (lam / 2, (3 * lam - 4 * mu) / 6, mu - lam / 4)),
        "rivlin-penalty": ({"lam": lam, "mu": mu}, (mu, lam, mu / 2)),
        "stable-neo-hookean-barrier": (
            {"lam": lam, "mu": mu},
            (mu * (lam**2 - 1) / 4, lam + mu / 8 - origin, (3 * mu / 4 + origin) / 2),
        ),
        "fung": (
            {"lam": lam, "mu0": mu0, "gamma": gamma, "mu1": mu1},
            (-gamma * mu1 / 2, lam - pull + gamma * mu1**2 / 2, (mu0 + gamma * mu1 / 2 + pull) / 2),
        ),
    }
    for name, (parameters, expected) in printed.items():
        at_rest = linearize(make(name, variant="printed", **parameters))
        values = (at_rest.stress, at_rest.lame_lambda, at_rest.lame_mu)
        assert values == pytest.approx(expected, rel=1e-12, abs=1e-15)
        with pytest.raises(MaterialError, match=rf'{name}: stressed at rest, .* = [-\d.]+; .*"corrected"'):
            calibrate(get(name), 1.0, 0.0, {"variant": "printed"})
    assert {name for name, entry in CATALOGUE.items() if "variant" in entry.options} - set(printed) == {
        "symmetric-dirichlet",
        "valanis-landel",
        "valanis-landel-xu",
    }


def test_printed_energies_that_only_have_another_constant_or_pair() -> None:
    scale, lam, mu, area = 0.7, 1.3, 0.8, 0.4
    dirichlet = linearize(make("symmetric-dirichlet", variant="printed", scale=scale))
    original = linearize(make("valanis-landel", variant="printed", lam=lam, mu=mu))
    assert (dirichlet.energy, original.energy) == pytest.approx((3 * scale, -6 * mu))
    xu = linearize(make("valanis-landel-xu", variant="printed", lam=lam, mu=mu, area=area))
    assert (xu.stress, xu.lame_lambda, xu.lame_mu) == pytest.approx((0, lam + 2 * area, mu + 3 * area))
    for name, nu in (("symmetric-dirichlet", 0.0), ("valanis-landel", 0.3), ("valanis-landel-xu", 0.3)):
        at_rest = linearize(calibrate(get(name), 1.0, nu, {"variant": "printed"}))
        assert (at_rest.youngs_modulus, at_rest.poissons_ratio) == pytest.approx((1.0, nu), abs=1e-12)
    # The Young's modulus that peng-landel is named after is the incompressible solid's, not this one's.
    assert linearize(make("peng-landel", E=3.0)).youngs_modulus == pytest.approx(2.0)


def test_mooney_rivlin_without_its_bulk_term_has_no_bulk_modulus() -> None:
    at_rest = linearize(make("mooney-rivlin", C1=0.4, C2=0.3, K=1e-12))
    assert 3 * at_rest.lame_lambda + 2 * at_rest.lame_mu == pytest.approx(0, abs=1e-11)
    with pytest.raises(MaterialError, match="positive shear and bulk"):
        check_rest(make("stable-neo-hookean", lam=0.3, mu=1.0))


@pytest.mark.parametrize("nu", [0.13, 0.2, 0.3, 0.45, 0.49])
def test_lambda_taken_for_lame_lambda(nu: float) -> None:
    """The 18 % of Chen & Barbič, Fig. 1: stable neo-Hookean with Lamé's pair for its own parameters."""
    lam, mu = lame_pair(2.0, nu)
    naive = linearize(make("stable-neo-hookean", lam=lam, mu=mu))
    E, ratio = (8 * nu - 1) / (4 * nu * (1 + nu)), (4 * nu - 1) / (4 * nu)
    if nu == 0.2:
        assert (E, ratio) == pytest.approx((0.625, -0.25), rel=1e-14)
    assert (naive.youngs_modulus / 2, naive.poissons_ratio) == pytest.approx((E, ratio), rel=1e-12)


def test_lambda_taken_for_lame_lambda_can_lose_the_bulk_modulus() -> None:
    lam, mu = lame_pair(1.0, 0.12)
    with pytest.raises(MaterialError, match="positive shear and bulk moduli"):
        check_rest(make("stable-neo-hookean", lam=lam, mu=mu))
