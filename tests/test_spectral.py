"""The kernel at single points against 50 digits: ψ, P and ∂P/∂F of every material, where formulas usually fail."""

from functools import cache
from typing import Any

import numpy as np
import precise
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from elastune.forms import materials, tuning
from elastune.forms.energy import CATALOGUE, Energy
from elastune.forms.normalize import linearize
from elastune.forms.spectral import SpectralError, pointwise

I = np.eye(3)  # noqa: E741


@cache
def energies() -> dict[str, Energy]:
    """Every material, and the ways to tune and mix them."""
    hencky, stable = materials.make("hencky"), materials.make("stable-neo-hookean")
    corotational = materials.make("linear-corotational")
    return {
        **{name: materials.make(name) for name in CATALOGUE},
        "hencky, alpha 0.5": tuning.with_nonlinearity(hencky, 0.5),
        "stable-neo-hookean, alpha 2.5": tuning.with_nonlinearity(stable, 2.5),
        "corotational, alphas 1.5 and 0.7": tuning.with_separate_nonlinearity(corotational, 1.5, 0.7),
        "corotational with another volume": tuning.with_volume(corotational, stable, 1.3),
        "arap augmented": tuning.with_volume(materials.make("arap"), materials.make("neo-hookean-ogden"), 1.3),
        "fung, printed and stressed at rest": materials.make("fung", variant="printed"),
    }


NAMES = [*CATALOGUE, *(name for name in energies() if name not in CATALOGUE)]


def rotation(seed: int) -> np.ndarray:
    """A random rotation."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


def stretched(*s: float, seed: int = 1) -> np.ndarray:
    """H of a deformation with these stretches in random directions."""
    return rotation(seed) @ np.diag(s) @ rotation(seed + 100).T - I


GAPS = [10.0**-n for n in (2, 3, 4, 6, 8, 10, 12, 14, 16)]
STRAINS = [10.0**-n for n in (2, 3, 4, 6, 8, 10, 12)]
RANDOM = np.random.default_rng(0).normal(size=(3, 3))

# Deformations with J > 0, at which every energy is defined.
STATES = {
    "rest": 0 * I,
    **{f"{c:g} I": (c - 1) * I for c in (0.5, 2, 1e-3, 1e3)},
    "uniaxial": np.diag([0.5, 0, 0]),
    "equibiaxial": np.diag([0.5, 0.5, 0]),
    "a pair, rotated": stretched(1.5, 1.5, 0.7),
    **{f"gap {g:g}": stretched(1.5 + g, 1.5, 0.7) for g in GAPS},
    **{f"gap {g:g}, axes": np.diag([0.8, 0.5, 0.5 * (1 + g)]) - I for g in GAPS},
    **{f"all close, {g:g}": stretched(1.2, 1.2 + g, 1.2 - 2 * g) for g in (1e-3, 1e-7, 1e-11)},
    **{f"strain {e:g}": e * RANDOM for e in STRAINS},
    **{f"strain {e:g}, uniaxial": np.diag([e, 0, 0]) for e in STRAINS},
    **{f"strain {e:g}, rotated by 1 in 1000": stretched(1 + e, 1, 1 - e, seed=7) for e in (1e-2, 1e-4)},
    "isochoric": np.diag([1.01, 1 / 1.01, 1.0]) - I,
    "stretches 0.001, 1, 1000": np.diag([1e-3, 1, 1e3]) - I,
    "stretch 0.001, rotated": stretched(1e-3, 1, 1),
    "stretch 1000, rotated": stretched(1e3, 1, 1),
}
# Inverted and singular deformations, for energies defined there.
INVERTED = {
    "inverted": stretched(-0.5, 1, 1.3),
    "inverted, a pair": stretched(-0.5, 1.2, 1.2),
    "rank 2": np.diag([0, 1, 1.3]) - I,
}
# Where two stretches add up to zero: the tangent of an energy that is odd in single stretches has a pole there.
POLES = {
    "-I": -2 * I,
    "opposite": stretched(-0.5, 0.5, 1.3),
    **{f"opposite but {g:g}": stretched(-0.5, 0.5 + g, 1.3) for g in (1e-3, 1e-6, 1e-10)},
    "rank 1": np.diag([0, 0, 1.3]) - I,
    "rank 1, rotated": np.outer(RANDOM[0], RANDOM[1]) - I,
    "rank 0": -I,
}
ODD = ("linear-corotational", "arap", "fixed-corotational", "corotational with another volume")


def states(name: str) -> dict[str, np.ndarray]:
    """Where an energy is defined and finite in double precision."""
    energy = energies()[name]
    found = {**STATES, **(INVERTED if energy.inverts else {})}
    if energy.inverts and name not in ODD:
        found |= POLES
    if "fung" in name:
        found = {key: H for key, H in found.items() if np.abs(H).max() < 100}
    return found


def condition(H: np.ndarray) -> float:
    """How much more than their share small stretches see of a rounding of F: 1 if F's columns are orthogonal."""
    F = I + H
    columns = F / np.maximum(np.linalg.norm(F, axis=0), 1e-300)
    return float(1 / max(np.linalg.svd(columns)[1][-1], 1e-16))


@pytest.mark.parametrize("name", NAMES)
def test_against_fifty_digits(name: str) -> None:
    """∂P/∂F to 1e-12, and P to 1e-14 at small strain, relative in the Frobenius norm at each point.

    The tangent's bound grows with the condition number of F with scaled columns where that exceeds 10: no more is
    in an F of doubles. Where P is not small it is held to 1e-14 of ‖∂P/∂F‖ (‖F‖ + ‖H‖), what one rounding of F does.
    """
    energy = energies()[name]
    chosen = states(name)
    found = pointwise(energy, np.array(list(chosen.values())))
    bad = []
    for (state, H), psi, P, D in zip(chosen.items(), *found, strict=True):
        exact_psi, exact_P, exact_D = precise.response(energy, H)
        ill = max(1.0, condition(H) / 10) if state not in POLES else 1.0
        tangent = precise.relative_error(D, exact_D)
        size = (precise.norm(exact_D) or 1.0) * (np.linalg.norm(I + H) + np.linalg.norm(H))
        stress = precise.distance(P, exact_P) / size
        if not (tangent <= 1e-12 * ill and stress <= 1e-14 * ill):
            bad.append(f"{state}: P {stress:.1e}, tangent {tangent:.1e}")
        if state.startswith("strain") and not state.endswith("1000") and "printed" not in name:
            small = precise.relative_error(P, exact_P), precise.relative_error(np.array(psi), np.array(exact_psi))
            if not max(small) <= 1e-14:
                bad.append(f"{state}: P {small[0]:.1e}, energy {small[1]:.1e} of itself")
    assert not bad, "; ".join(bad)


@pytest.mark.parametrize("name", ODD)
def test_poles_stay_finite(name: str) -> None:
    """At the poles of the tangent of odd energies all that is asked for is a finite number."""
    for values in pointwise(energies()[name], np.array(list(POLES.values()))):
        assert np.isfinite(values).all()


@given(
    st.sampled_from([name for name in NAMES if "fung" not in name]),
    st.lists(st.floats(-1.5, 1.5, allow_subnormal=False), min_size=9, max_size=9),
)
@settings(max_examples=200, deadline=None, derandomize=True)
def test_any_deformation(name: str, entries: list[float]) -> None:
    """P and ∂P/∂F to 1e-11 over the distance from what the energy is not defined at."""
    energy = energies()[name]
    H = np.array(entries).reshape(3, 3)
    s = np.linalg.svd(I + H)[1]
    J = np.linalg.det(I + H)
    near_pole = name in ODD and J <= 0 and min(s[1] - s[2], s[2]) < 1e-3
    if near_pole or (J <= 1e-3 and not energy.inverts):
        return
    _, P, D = (values[0] for values in pointwise(energy, H[None]))
    _, exact_P, exact_D = precise.response(energy, H)
    ill = max(1, condition(H) / 10)
    assert precise.relative_error(D, exact_D) <= 1e-12 * ill
    assert precise.distance(P, exact_P) <= 1e-13 * ill * precise.norm(exact_D)


@pytest.mark.parametrize("name", ["stable-neo-hookean", "hencky", "linear-elasticity", "st-venant-kirchhoff-kikuuwe"])
def test_reference_is_the_derivative_of_the_energy(name: str) -> None:
    """The 50-digit P and ∂P/∂F are differences of the 50-digit ψ, which knows neither."""
    energy, H, step = energies()[name], stretched(1.4, 0.9, 0.8), 2.0**-40
    _, P, D = precise.response(energy, H)
    for k in range(9):
        change = np.zeros((3, 3))
        change[k // 3, k % 3] = step
        up, down = precise.response(energy, H + change), precise.response(energy, H - change)
        assert abs((up[0] - down[0]) / (2 * step) - P.ravel()[k]) <= 1e-20
        assert max(abs((up[1] - down[1]).ravel() / (2 * step) - D[:, k])) <= 1e-20


@pytest.mark.parametrize("name", [name for name in NAMES if "printed" not in name])
def test_stiffness_at_rest(name: str) -> None:
    """At F = I the tangent is that of linear elasticity."""
    energy = energies()[name]
    at_rest = linearize(energy)
    delta = np.eye(3)
    shear = np.einsum("ik,jl->ijkl", delta, delta) + np.einsum("il,jk->ijkl", delta, delta)
    expected = at_rest.lame_mu * shear + at_rest.lame_lambda * np.einsum("ij,kl->ijkl", delta, delta)
    psi, P, D = (values[0] for values in pointwise(energy, np.zeros((1, 3, 3))))
    assert np.abs(D - expected.reshape(9, 9)).max() <= 1e-13 * np.abs(expected).max()
    assert np.abs(P).max() == 0
    # The printed constants of some variants are not corrected, but those are not in this list.
    assert abs(psi) <= 1e-16


def random_deformations(energy: Energy, n: int = 10_000) -> np.ndarray:
    """Half of them inverted where the energy survives that, some nearly singular."""
    F = np.random.default_rng(2).normal(size=(n, 3, 3))
    flip = np.linalg.det(F) < 0
    if energy.inverts:
        flip ^= np.arange(n) % 2 == 0
    F[flip, :, 0] *= -1
    return F - I


@pytest.mark.parametrize("kind", ["clamp", "absolute"])
@pytest.mark.parametrize("name", NAMES)
def test_filters(name: str, kind: str) -> None:
    """Semi-definite, unchanged where it already was, and the eigenvalues clamped or made positive otherwise."""
    energy = energies()[name]
    H = random_deformations(energy)
    raw, filtered = pointwise(energy, H)[2], pointwise(energy, H, filter=kind)[2]
    values, vectors = np.linalg.eigh(raw)
    size = np.linalg.norm(raw, axis=(1, 2))
    assert (np.linalg.eigvalsh(filtered)[:, 0] >= -1e-12 * size).all()
    definite = values[:, 0] >= 0
    assert definite.any()
    assert np.abs(filtered - raw)[definite].max() <= 1e-12 * size[definite].max()
    target = np.maximum(values, 0) if kind == "clamp" else np.abs(values)
    expected = np.einsum("nik,nk,njk->nij", vectors, target, vectors)
    assert (np.abs(filtered - expected).max(axis=(1, 2)) <= 1e-11 * size).all()


def singular() -> list[str]:
    """The energies with something to extend."""
    return [name for name in NAMES if not energies()[name].inverts]


THRESHOLD = 0.25


@pytest.mark.parametrize("name", singular())
def test_extension_is_continuous(name: str) -> None:
    """Across the threshold, by one, two and three stretches, also with others already below: to 1e-10."""
    energy = energies()[name]
    t = THRESHOLD
    crossings = [
        lambda x: (x, 0.9, 1.3),
        lambda x: (x, 0.1, 1.3),
        lambda x: (x, -0.6, 1.3),
        lambda x: (x, 0.1, 0.2),
        lambda x: (x, x + 1e-3, 1.3),
        lambda x: (x, x, x),
    ]
    for crossing in crossings:
        sides = [stretched(*crossing(t * (1 + side * 1e-13)), seed=3) for side in (-1, 1)]
        values = pointwise(energy, np.array(sides), extension=t)
        for found in values:
            below, above = found
            assert np.abs(below - above).max() <= 1e-10 * np.abs(above).max()


@pytest.mark.parametrize("name", singular())
def test_extension_is_consistent_and_finite(name: str) -> None:
    """Stress and tangent are derivatives of the extended energy; nothing is infinite, nothing moves above."""
    energy = energies()[name]
    signs = np.where(np.arange(60) % 2, 1, -1)[:, None, None]
    H = np.concatenate([random_deformations(energy, 60) * signs, [-I, -2 * I, -101 * I, 100 * RANDOM]])
    _, P, D = pointwise(energy, H, extension=THRESHOLD)
    assert np.isfinite(P).all() and np.isfinite(D).all()
    regular = slice(0, 60)
    step = 1e-6
    size = np.abs(D[regular]).max(axis=(1, 2))
    for k in range(9):
        change = np.zeros((3, 3))
        change[k // 3, k % 3] = step
        up, down = (pointwise(energy, H[regular] + sign * change, extension=THRESHOLD) for sign in (1, -1))
        slope = (up[0] - down[0]) / (2 * step)
        assert (np.abs(slope - P[regular, k // 3, k % 3]) <= 1e-7 * np.maximum(size, np.abs(up[0]))).all()
        curve = (up[1] - down[1]).reshape(-1, 9) / (2 * step)
        gap = np.abs(np.linalg.svd(I + H[regular])[1][:, 1] - np.linalg.svd(I + H[regular])[1][:, 2])
        assert (np.abs(curve - D[regular, :, k]).max(axis=1) <= 1e-7 * size / np.minimum(gap, 1) ** 2).all()
    plain = [H for H in STATES.values() if np.linalg.svd(I + H)[1][-1] > THRESHOLD and np.abs(H).max() < 10]
    extended, unextended = (pointwise(energy, np.array(plain), threshold) for threshold in (THRESHOLD, None))
    for with_it, without in zip(extended, unextended, strict=True):
        assert np.abs(with_it - without).max() <= 1e-12 * np.abs(without).max()


@pytest.mark.parametrize("gap", [1e-3, 1e-5, 1e-7, 1e-9, 1e-11])
def test_extension_of_close_stretches(gap: float) -> None:
    """The divided difference of two stretches on either side of the threshold, where the third derivative jumps."""
    energy = energies()["neo-hookean"]
    H = np.diag([THRESHOLD * (1 + gap), THRESHOLD * (1 - 0.3 * gap), 1.3]) - I
    s = [precise.mp.mpf(float(x)) + 1 for x in np.diag(H)]
    t = precise.mp.mpf(THRESHOLD)
    _, p, h = precise.in_stretches(energy, [s[0], t, s[2]])
    third = precise.mp.diff(lambda x: precise.in_stretches(energy, [x, t, s[2]])[2][1][1], s[0])
    d = s[1] - t
    # p_0 and p_1 of the extended energy, Taylor in the stretch below: ψ_0 + ψ_01 d + ψ_011 d²/2, ψ_1 + ψ_11 d.
    p0, p1 = p[0] + h[0][1] * d + third * d**2 / 2, p[1] + h[1][1] * d
    exact = (p0 - p1) / (s[0] - s[1])
    D = pointwise(energy, H[None], extension=THRESHOLD)[2][0].reshape(3, 3, 3, 3)
    assert abs(D[0, 1, 0, 1] + D[0, 1, 1, 0] - exact) <= 1e-12 * abs(exact)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"H": np.zeros((3, 3))}, "shape (n, 3, 3)"),
        ({"filter": "clip"}, "none, clamp, absolute"),
        ({"extension": 0.0}, "above 0"),
        ({"extension": 0.95}, "at most 0.9"),
    ],
)
def test_refusals(arguments: dict[str, Any], message: str) -> None:
    """One line with what was expected."""
    with pytest.raises(SpectralError) as refusal:
        pointwise(energies()["neo-hookean"], **{"H": np.zeros((1, 3, 3)), **arguments})
    assert message in str(refusal.value) and "\n" not in str(refusal.value)
