"""Homogeneous tests against the compiled kernel, which knows F and no test, and against closed forms."""

from typing import Any

import numpy as np
import pytest

import elastune
from elastune.app.tuning.response import Response, respond
from elastune.app.tuning.tests import TESTS
from elastune.forms.energy import CATALOGUE, Energy, MaterialError
from elastune.forms.response import first
from elastune.forms.tuned import tuned_energy

X = np.array([0.7, 0.9, 1.0, 1.15, 1.35])
LOADS = {name: X for name in TESTS} | {"biaxial": np.array([X, X[::-1]]), "shear": X - 1}
each_material = pytest.mark.parametrize("name", CATALOGUE)


def tuned(name: str, alpha: float = 1.0) -> Energy:
    nu = 0.35 if CATALOGUE[name].energy().has_lambda else 0.0
    return tuned_energy(name, 1.5, nu, alpha if CATALOGUE[name].objective else 1.0)


def gradients(test: str, loads: np.ndarray, free: np.ndarray) -> np.ndarray:
    """F - I of a test, shape (n, 3, 3)."""
    x, one = np.atleast_2d(loads), np.ones(free.shape)
    if test == "shear":
        return np.array([[[0, gamma, 0], [0, 0, 0], [0, 0, 0]] for gamma in x[0]])
    diagonals = {
        "uniaxial": (x[0], free, free),
        "equibiaxial": (x[0], x[0], free),
        "planar": (x[0], one, free),
        "biaxial": (*x, free) if test == "biaxial" else (),
        "volumetric": (np.cbrt(x[0]),) * 3,
    }
    return np.array([np.diag(np.array(s) - 1) for s in np.transpose(diagonals[test])])


def measured(test: str, P: np.ndarray, F: np.ndarray) -> np.ndarray:
    """The nominal stress that a test measures, shape (loads, n)."""
    if test == "shear":
        return P[:, 0, 1][None]
    if test == "volumetric":
        return (np.einsum("nij,nij->n", P, F) / 3 / np.linalg.det(F))[None]
    return np.array([P[:, i, i] for i in range(len(TESTS[test].loads))])


@each_material
@pytest.mark.parametrize("alpha", [1.0, 0.8])
def test_stresses_are_those_of_the_kernel(name: str, alpha: float) -> None:
    energy = tuned(name, alpha)
    for test in TESTS:
        if test == "shear" and not energy.objective:
            continue
        curve = Response(energy, test).curve(LOADS[test])
        assert np.isfinite(curve.free).all()
        H = gradients(test, LOADS[test], curve.free)
        P = first(energy, H)[1]
        assert curve.stress == pytest.approx(measured(test, P, H + np.eye(3)), rel=1e-12, abs=1e-13)
        if TESTS[test].free is not None:
            assert np.abs(P[:, 2, 2]).max() < 1e-13


@each_material
@pytest.mark.parametrize("alpha", [1.0, 0.8])
def test_at_constant_volume_a_pressure_holds_the_free_direction(name: str, alpha: float) -> None:
    energy = tuned(name, alpha)
    if not energy.objective:
        with pytest.raises(MaterialError, match="not a function of stretches"):
            Response(energy, "uniaxial", incompressible=True)
        return
    for test in TESTS:
        if test == "volumetric":
            continue
        curve = Response(energy, test, incompressible=True).curve(LOADS[test])
        H = gradients(test, LOADS[test], curve.free)
        F = H + np.eye(3)
        assert np.linalg.det(F) == pytest.approx(1.0, rel=1e-14)
        P = first(energy.shear, H)[1]
        pressure = P[:, 2, 2] * F[:, 2, 2]
        P = P - pressure[:, None, None] * np.linalg.inv(F).transpose(0, 2, 1)
        assert curve.stress == pytest.approx(measured(test, P, F), rel=1e-12, abs=1e-13)


@each_material
@pytest.mark.parametrize("incompressible", [False, True])
def test_derivatives_are_those_of_the_stresses(name: str, incompressible: bool) -> None:
    energy = tuned(name, 0.8)
    if not energy.objective and incompressible:
        return
    constants, rng = np.array(energy.constants()), np.random.default_rng(1)
    for test in TESTS:
        if (test == "volumetric" and incompressible) or (test == "shear" and not energy.objective):
            continue
        # One has a third derivative that jumps at J = 1.
        response, loads = Response(energy, test, incompressible), np.delete(np.atleast_2d(LOADS[test]), 2, axis=1)
        curve, slopes = response.slopes(loads)
        assert curve.stress == pytest.approx(response.curve(loads).stress, rel=1e-13, abs=1e-14)
        for exact, start, change in (
            *((slopes.loads[:, i], loads, np.eye(len(loads))[i][:, None]) for i in range(len(loads))),
            (None, constants, rng.normal(size=constants.shape)),
        ):
            exact = np.einsum("kin,k->in", slopes.constants, change) if exact is None else exact

            steps = 1e-3 * np.array([-2, -1, 1, 2])
            moved = [(loads, start + h * change) if start is constants else (start + h * change,) for h in steps]
            a, b, c, d = (response.curve(*at).stress for at in moved)
            # Richardson: fourth order.
            once, twice = (c - b) / 2e-3, (d - a) / 4e-3
            assert exact == pytest.approx((4 * once - twice) / 3, rel=1e-7, abs=1e-8)


def test_many_parameters_at_once_are_each_alone() -> None:
    energy = tuned("fung", 0.8)
    many = np.array(energy.constants()) * np.random.default_rng(2).uniform(0.8, 1.2, (2, 3, 5))
    for incompressible in (False, True):
        for test in set(TESTS) - ({"volumetric"} if incompressible else set()):
            response = Response(energy, test, incompressible)
            curve, slopes = response.slopes(LOADS[test], many)
            assert curve.free.shape == (2, 3, 5) and slopes.constants.shape == (2, 3, 5, len(response.test.loads), 5)
            alone, of_it = response.slopes(LOADS[test], many[1, 2])
            assert curve.stress[1, 2] == pytest.approx(alone.stress, rel=1e-13, abs=1e-15)
            assert slopes.constants[1, 2] == pytest.approx(of_it.constants, rel=1e-11, abs=1e-13)


def test_closed_forms() -> None:
    rubber, mu = elastune.material("neo-hookean", 3.0, 0.5), 1.0
    assert rubber.uniaxial(X)[0] == pytest.approx(mu * (X - X**-2), rel=1e-14, abs=1e-15)
    assert rubber.equibiaxial(X)[0] == pytest.approx(mu * (X - X**-5), rel=1e-14, abs=1e-15)
    assert rubber.planar(X)[0] == pytest.approx(mu * (X - X**-3), rel=1e-14, abs=1e-15)
    assert rubber.shear(X - 1) == pytest.approx(mu * (X - 1), rel=1e-13, abs=1e-15)
    y = X[::-1]
    expected = mu * np.array([X - X**-3 * y**-2, y - y**-3 * X**-2])
    assert rubber.biaxial(X, y)[0] == pytest.approx(expected, rel=1e-13, abs=1e-14)
    assert rubber.uniaxial(X)[1] == pytest.approx(X**-0.5, rel=1e-15)
    soft = elastune.material("neo-hookean-ogden", 1.5, 0.25)
    lam, mu = soft.lame
    assert soft.volumetric(X) == pytest.approx((mu * (np.cbrt(X) ** 2 - 1) / X + lam * (X - 1)), rel=1e-13, abs=1e-14)


@pytest.mark.parametrize(
    ("test", "loads", "said"),
    [
        ("uniaxial", [1.0, 0.0], "positive stretches"),
        ("equibiaxial", [np.nan], "positive stretches, got nan"),
        ("shear", [np.inf], "finite numbers, got inf"),
        ("biaxial", [1.0, 2.0], "stretch_1 and stretch_2 of one shape"),
        ("planar", [[1.0], [2.0]], "stretch of one shape"),
        ("shear", "much", "expected numbers"),
    ],
)
def test_loads_that_cannot_be(test: str, loads: Any, said: str) -> None:
    with pytest.raises(MaterialError, match=f"^{test}: .*{said}"):
        respond(tuned("fung"), test, loads)
    with pytest.raises(MaterialError, match="incompressible; expected another test"):
        Response(tuned("fung"), "volumetric", incompressible=True)
