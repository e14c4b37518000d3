"""Displacement-pressure elements: exact where they must be, free of locking and of wild pressures near ν = 0.5."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bodies
import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from elastune.app.body.body import Body
from elastune.app.body.unknowns import State
from elastune.app.errors import SceneError
from elastune.app.results.fields import Fields
from elastune.app.results.measures import Measures
from elastune.app.run import Run, start
from elastune.app.scene.read import parse
from elastune.app.scene.schema import Scene
from elastune.app.solvers.options import Options
from elastune.app.solvers.tangent import Tangent
from elastune.app.tuning.response import respond
from elastune.forms.elements import ELEMENTS, Element, Pressure, choose
from elastune.forms.energy import CATALOGUE, MaterialError
from elastune.forms.evaluation import as_numpy
from elastune.forms.kinematics import PrincipalStretches, deformation_gradient
from elastune.forms.materials.functions import ENERGIES
from elastune.forms.normalize import linearize
from elastune.forms.terms import mixed_response
from elastune.forms.tuned import tuned_energy
from elastune.forms.volumetric import split

Tables = dict[str, Any]
MIXED = [name for name, element in ELEMENTS.items() if element.pressure is not None]
STABLE = [name for name in MIXED if name != "Q1-P0"]
BAR: Tables = {"left": {"roller": ["x"]}, "front": {"roller": ["y"]}, "bottom": {"roller": ["z"]}}
PULL: Tables = {"left": {"fix": True}, "right": {"move": [1.0, 0.0, 0.0]}}


def scene(element: str, nu: float, boundary: Tables, cells: int = 2, **tables: Tables) -> Scene:
    data = {
        "mesh": {"cells": cells, **tables.pop("mesh", {})},
        "solve": {"element": element, "steps": 1, **tables.pop("solve", {})},
        "material": {"name": "stable-neo-hookean", "E": 1.5, "nu": nu, **tables.pop("material", {})},
        "boundary": boundary,
        **tables,
    }
    return parse(data, Path("test.toml"))


def problem(*arguments: Any, **tables: Any) -> Body:
    return bodies.made(scene(*arguments, **tables))


def newton_steps(given: Body, steps: int = 1, tolerance: float = 1e-11) -> int:
    """Solves; the Newton steps that it took."""
    run = Run(given, Options(steps=steps, tolerance=tolerance)).finish()
    assert run.summary.failure is None, run.summary.failure
    return bodies.newton_steps(run)


def reaction(given: Body) -> float:
    return Measures(given).reactions()["right"][0]


def distort(made: Body) -> None:
    """Moves the vertices within the body at random."""
    points = made.geometry.mesh.geometry.x
    d = made.dimension
    inner = ((points[:, :d] > 1e-9) & (points[:, :d] < 1 - 1e-9)).all(axis=1)
    assert inner.any()
    points[inner, :d] += np.random.default_rng(7).uniform(-0.12, 0.12, (inner.sum(), d))


# ---------------------------------------------------------------------- the split of an energy


@pytest.mark.parametrize("name", CATALOGUE)
@pytest.mark.parametrize("nu", [0.3, 0.4999, 0.5])
def test_every_material_is_split_or_refused_in_one_line(name: str, nu: float) -> None:
    way_out = {"volume": "neo-hookean-ogden"}
    given: Tables = {}
    try:
        split(tuned_energy(name, 1.5, nu, mixed=True))
    except MaterialError as refusal:
        assert "\n" not in str(refusal)
        assert 'volume = "neo-hookean-ogden"' in str(refusal)
        given = way_out
    if not CATALOGUE[name].objective:
        return
    energy = tuned_energy(name, 1.5, nu, mixed=True, **given)
    parts = split(energy)
    at_rest, whole = linearize(parts.shear), linearize(energy)
    assert abs(at_rest.lame_lambda) < 1e-12 and abs(at_rest.stress) < 1e-12
    assert at_rest.lame_mu == pytest.approx(1.5 / (2 * (1 + nu)), rel=1e-10)
    assert whole.poissons_ratio == pytest.approx(nu, rel=1e-9)
    assert parts.bulk == (np.inf if nu == 0.5 else pytest.approx(1.5 * nu / ((1 + nu) * (1 - 2 * nu)), rel=1e-9))


VOLUMES: list[Tables] = [
    *({"name": "valanis-landel-separable", "parameters": {"h": h}} for h in ENERGIES),
    {"name": "stable-neo-hookean", "alpha": 1.7},
    {"name": "neo-hookean", "alpha_lambda": 0.6, "alpha_mu": 2.0},
]


@pytest.mark.parametrize("material", VOLUMES, ids=lambda m: "-".join(map(str, m.values())))
def test_pressure_of_a_volume_ratio_gives_back_the_energy(material: Tables) -> None:
    """At p = λU'(J) the Lagrangian is ψ, and its derivative in F is P; both against UFL on ψ as a whole."""
    energy = tuned_energy(E=1.5, nu=0.4, mixed=True, **material)
    parts = split(energy)
    J = np.array([0.6, 0.9, 0.999, 1 - 1e-9, 1.0, 1.02, 2.0])
    pressures = parts.bulk * parts.derivatives(J)[1]
    stored, ratio, slope = parts.conjugate(pressures)
    assert np.abs(ratio - J).max() < 1e-11
    assert np.abs(stored - pressures * (J - 1) + parts.bulk * parts.derivatives(J)[0]).max() < 1e-12
    difference = parts.conjugate(pressures + 1e-6)[0] - parts.conjugate(pressures - 1e-6)[0]
    assert np.abs(difference / 2e-6 - (ratio - 1)).max() < 1e-7
    assert np.abs(slope * parts.bulk * parts.derivatives(J)[2] - 1).max() < 1e-9
    H = np.zeros((len(J), 3, 3))
    H[:, range(3), range(3)] = np.cbrt(J)[:, None] - 1
    psi, P = mixed_response(parts, H, pressures)
    stretch = ufl.variable(ufl.as_ufl(1.0))
    density = ufl.as_ufl(energy.density(PrincipalStretches([stretch] * 3)))
    expected = as_numpy([density, ufl.diff(density, stretch)], [stretch])(np.cbrt(J))
    assert np.abs(psi - expected[0]).max() < 1e-12
    assert np.abs(np.einsum("nii->n", P) - expected[1]).max() < 1e-10


def test_pressures_that_no_volume_ratio_has_are_not_numbers() -> None:
    """U' = log J / J is 1/e at most."""
    parts = split(tuned_energy("neo-hookean", 1.5, 0.4, mixed=True))
    ratios = parts.conjugate(parts.bulk * np.array([0.36, 0.37, -50.0]))[1]
    assert np.isfinite(ratios).tolist() == [True, False, True]


@pytest.mark.parametrize(
    ("element", "tables", "words"),
    [
        ("P2", {}, ["nu", "below 0.5 for a displacement formulation", "P2-P1"]),
        ("Q2", {}, ["nu", "below 0.5 for a displacement formulation", "Q2-P1d"]),
        ("P2-P1", {"material": {"nu": 0.6}}, ["nu", "at most 0.5", "0.6"]),
        ("P2-P1", {"material": {"nu": 0.0}}, ["nu above 0"]),
        ("P2-P1", {"material": {"name": "linear-corotational"}}, ["function of J", 'volume = "neo-hookean-ogden"']),
        ("P2-P1", {"material": {"calibrate": "least"}}, ["calibrate"]),
        ("Q2-P1d", {"material": {"extension": 0.2}}, ["extension", "mixed"]),
        ("Q2-P1d", {"solve": {"method": "trust-region"}}, ["method", "mixed"]),
        ("P1-bubble", {"mesh": {"cell": "hexahedron"}}, ["tetrahedron"]),
    ],
)
def test_refusals_are_one_line(element: str, tables: Tables, words: list[str]) -> None:
    with pytest.raises(SceneError) as refusal:
        scene(element, 0.5, PULL, **tables)
    assert "\n" not in str(refusal.value)
    assert all(word in str(refusal.value) for word in words)


# ---------------------------------------------------------------------- the forms


@pytest.mark.parametrize("element", MIXED)
def test_tangent_is_the_derivative_of_the_residual_of_the_energy(element: str) -> None:
    made = problem(element, 0.5, PULL, cells=1, material={"name": "hencky"})
    rng = np.random.default_rng(3)
    x, d = 0.01 * rng.normal(size=(2, made.size))
    d[made.held] = 0.0
    tangent, step = Tangent(made), 1e-6
    tangent.assemble(State(x.copy()))
    product, direction = tangent.vector(), tangent.vector(d)
    tangent.matrix.mult(direction, product)

    def residual(at: np.ndarray) -> np.ndarray:
        return made.assembly.residual(State(at))

    difference = (residual(x + step * d) - residual(x - step * d)) / (2 * step)
    free = ~made.held
    assert np.abs(difference - product.array)[free].max() < 1e-7 * np.abs(difference).max()
    ends = [made.assembly.energy(State(x + sign * step * d)) for sign in (1, -1)]
    assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(d @ residual(x), rel=1e-7)


# ---------------------------------------------------------------------- homogeneous states


def pulled(stress: float) -> Tables:
    return {**BAR, "right": {"pull": [stress, 0.0, 0.0]}}


@pytest.mark.parametrize("element", MIXED)
@pytest.mark.parametrize("nu", [0.5, 0.4999])
def test_uniaxial_tension_is_exact_on_distorted_meshes(element: str, nu: float) -> None:
    """Without a change of volume the nominal stress is μ (λ - λ⁻²)."""
    stretch, mu = 1.6, 1.5 / 3
    stress, width = mu * (stretch - stretch**-2), stretch**-0.5
    if nu < 0.5:
        stresses, widths = respond(tuned_energy("stable-neo-hookean", 1.5, nu), "uniaxial", [stretch])
        stress, width = float(stresses[0]), float(widths[0])
    made = problem(element, nu, pulled(stress), solve={"tolerance": 1e-11})
    distort(made)
    newton_steps(made)
    points = made.V.tabulate_dof_coordinates()
    u = made.u.x.array.reshape(-1, 3)
    assert np.abs(u - points * np.array([stretch - 1, width - 1, width - 1])).max() < 1e-8
    assert Measures(made).min_J() == pytest.approx(stretch * width**2, rel=1e-8)
    if nu == 0.5:
        cells = Fields(made).cells(["stress", "pressure", "energy"])
        assert np.abs(cells["stress"] - np.diag([stretch * stress, 0.0, 0.0])).max() < 1e-8
        assert np.abs(cells["pressure"] + stretch * stress / 3).max() < 1e-8
        assert np.abs(cells["energy"] - mu / 2 * (stretch**2 + 2 / stretch - 3)).max() < 1e-8


@pytest.mark.parametrize("element", MIXED)
def test_plane_strain_tension(element: str) -> None:
    """Nominal stress μ (λ - λ⁻³), with the third stretch held at one."""
    stretch, mu = 1.4, 1.5 / 3
    pull = {"pull": [mu * (stretch - stretch**-3), 0.0]}
    section = {"left": {"roller": ["x"]}, "bottom": {"roller": ["y"]}, "right": pull}
    made = problem(element, 0.5, section, mesh={"shape": "square"}, solve={"tolerance": 1e-11})
    distort(made)
    newton_steps(made)
    points = made.V.tabulate_dof_coordinates()[:, :2]
    exact = points * np.array([stretch - 1, 1 / stretch - 1])
    assert np.abs(made.u.x.array.reshape(-1, 2) - exact).max() < 1e-8


def test_follower_pressure_on_an_incompressible_bar() -> None:
    """Cauchy stress μ (λ² - 1/λ), minus the pressure."""
    pressure, mu = 0.3, 1.5 / 3
    made = problem("Q2-P1d", 0.5, {**BAR, "right": {"pressure": pressure}}, cells=1, solve={"tolerance": 1e-11})
    newton_steps(made)
    stretch = 1 + made.u.x.array.reshape(-1, 3)[np.argmax(made.V.tabulate_dof_coordinates()[:, 0]), 0]
    assert mu * (stretch**2 - 1 / stretch) == pytest.approx(-pressure, rel=1e-8)


@pytest.mark.parametrize("name", ["hencky", "fixed-corotational", "mooney-rivlin", "ogden"])
def test_other_materials_under_uniaxial_tension(name: str) -> None:
    """The μ part may read the stretches, repeated here; the stress is the derivative of W(λ, λ^-½, λ^-½)."""
    stretch = 1.5
    material = {"name": name, **({"volume": "neo-hookean-ogden"} if name == "ogden" else {})}
    parts = split(tuned_energy(E=1.5, nu=0.5, mixed=True, **material))

    def energy(axial: float) -> float:
        H = np.diag([axial, axial**-0.5, axial**-0.5]) - np.eye(3)
        return float(mixed_response(parts, H[None], np.zeros(1))[0][0])

    stress = (energy(stretch + 1e-4) - energy(stretch - 1e-4)) / 2e-4
    made = problem("P2-P1", 0.5, pulled(stress), cells=1, material=material)
    newton_steps(made)
    length = 1 + made.u.x.array.reshape(-1, 3)[np.argmax(made.V.tabulate_dof_coordinates()[:, 0]), 0]
    assert length == pytest.approx(stretch, rel=1e-6)


# ---------------------------------------------------------------------- near ν = 0.5


def strain_of_volume(made: Body) -> float:
    """‖J - 1‖ in L²."""
    J = ufl.det(deformation_gradient(made.u))
    return float(np.sqrt(fem.assemble_scalar(fem.form((J - 1) ** 2 * ufl.dx(metadata={"quadrature_degree": 4})))))


def oscillation(made: Body) -> float:
    """What a local average takes away from the pressure, relative to its variation: ‖p - Ap‖ / ‖p - mean p‖.

    Ap has the average of p over each vertex's patch as its vertex values: O(h) away from a smooth p, while of
    a pressure that alternates between neighbours nothing is left.
    """
    mesh, p = made.geometry.mesh, made.p
    average = fem.Function(fem.functionspace(mesh, ("Lagrange", 1)))
    v = ufl.TestFunction(average.function_space)
    weighted, weights = (fem.assemble_vector(fem.form(form)).array for form in (p * v * ufl.dx, v * ufl.dx))
    average.x.array[:] = weighted / weights

    def integral(form: Any) -> float:
        return float(fem.assemble_scalar(fem.form(form * ufl.dx)))

    mean = integral(p) / integral(fem.Constant(mesh, 1.0))
    return float(np.sqrt(integral((p - average) ** 2) / integral((p - mean) ** 2)))


# The reaction, which several elements and graded meshes agree on to 0.1 %, with E = 1.5.
LIMITS = {0.3: 1.5 * 0.7053, 0.4999: 1.5 * 0.6738, 0.5: 1.5 * 0.6738}
PULLED = {"P2-P1": (2, 4), "Q2-P1d": (2, 4), "Q1-P0": (4, 8), "P1-bubble": (4, 8)}


@pytest.mark.parametrize("element", MIXED)
def test_nothing_degrades_towards_one_half(element: str) -> None:
    """Cube pulled to twice its length: reaction, volume and Newton steps at ν = 0.3, 0.4999 and 0.5."""
    errors, volumes, steps = {}, {}, {}
    for nu, limit in LIMITS.items():
        made = [problem(element, nu, PULL, cells) for cells in PULLED[element]]
        steps[nu] = sum(newton_steps(each, 2, 1e-8) for each in made)
        errors[nu] = [reaction(each) / limit - 1 for each in made]
        volumes[nu] = [strain_of_volume(each) for each in made]
    for nu in (0.4999, 0.5):
        assert steps[nu] <= 1.5 * steps[0.3]
        coarse, fine = errors[nu]
        order, at_03 = np.log2(coarse / fine), np.log2(errors[0.3][0] / errors[0.3][1])
        assert 0 < fine and order > at_03 - 0.5
        assert volumes[nu][1] < 0.65 * volumes[nu][0]
    assert errors[0.5][1] == pytest.approx(errors[0.4999][1], abs=1e-3)


# A block between walls that bulges under its own weight on its free side.
HEAVY: Tables = {"left": {"roller": ["x"]}, "bottom": {"roller": ["y"]}}
WEIGHT: Tables = {"mesh": {"shape": "square"}, "body": {"force": [0.0, -0.9]}}


@pytest.mark.parametrize("nu", [0.4999, 0.5])
@pytest.mark.parametrize("element", MIXED)
def test_pressures_do_not_oscillate(element: str, nu: float) -> None:
    coarse, fine = (problem(element, nu, HEAVY, cells, **WEIGHT) for cells in (4, 8))
    for made in (coarse, fine):
        newton_steps(made)
    assert oscillation(fine) < (0.1 if element in STABLE else 0.2)
    assert oscillation(fine) < 0.55 * oscillation(coarse)
    assert strain_of_volume(fine) < 0.7 * strain_of_volume(coarse)


@pytest.mark.parametrize(("pressure", "bound"), [(Pressure(1, True), 0.2), (Pressure(0, False), 0.7)])
def test_measure_tells_pairs_that_are_not_stable(
    pressure: Pressure, bound: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """P1-P1 and P1-P0 have too many pressures for their displacements, and the measure does not fall."""
    monkeypatch.setitem(ELEMENTS, "P2-P1", Element(1, ("triangle",), 2, pressure))
    coarse, fine = (problem("P2-P1", 0.4999, HEAVY, cells, **WEIGHT) for cells in (4, 8))
    for made in (coarse, fine):
        newton_steps(made)
    assert oscillation(fine) > max(bound, 0.7 * oscillation(coarse))


@pytest.mark.parametrize(("mixed", "plain"), [("P2-P1", "P2"), ("Q2-P1d", "Q2"), ("Q1-P0", "Q1")])
def test_mixed_and_displacement_elements_have_one_limit(mixed: str, plain: str) -> None:
    gaps = []
    for cells in (2, 4):
        made = [problem(element, 0.3, PULL, cells, material={"name": "neo-hookean"}) for element in (mixed, plain)]
        for each in made:
            newton_steps(each)
        gaps.append(abs(reaction(made[0]) / reaction(made[1]) - 1))
    assert gaps[1] < (0.003 if plain != "Q1" else 0.03)
    assert gaps[1] < 0.5 * gaps[0]


# ---------------------------------------------------------------------- solvers, ranks, load paths


def test_linear_solvers_agree() -> None:
    reactions = []
    for linear in ("direct", "iterative"):
        for element in ("P2-P1", "Q2-P1d"):
            run = bodies.solved(scene(element, 0.5, PULL, 3, solve={"linear": linear, "steps": 4, "tolerance": 1e-10}))
            reactions.append(run.summary.steps[-1].reaction["right"][0])
    assert reactions[:2] == pytest.approx(reactions[2:], rel=1e-9)


def test_ranks_agree(solved: Callable[..., Any]) -> None:
    settings = ("material.nu=0.5", "mesh.cells=2", "solve.steps=1", "solve.tolerance=1e-11")
    asked = 'output.fields=["displacement", "stress", "pressure"]'
    for element in ("P2-P1", "Q2-P1d"):
        runs = [solved("cube-pull", *settings, asked, *_on(element), ranks=ranks) for ranks in (1, 2)]
        one, two = (run["steps"][-1] for run in runs)
        assert runs[0]["element"] == element
        assert one["reaction"]["right"][0] == pytest.approx(two["reaction"]["right"][0], rel=1e-9)
        assert one["energy"] == pytest.approx(two["energy"], rel=1e-9)
        assert one["volume_ratio"] == pytest.approx(1, abs=1e-9)


def _on(element: str) -> tuple[str, str]:
    cell = "tetrahedron" if element.startswith("P") else "hexahedron"
    return f'solve.element="{element}"', f'mesh.cell="{cell}"'


def test_incompressible_twist() -> None:
    """Half a turn in one load step: the blended start is far from keeping its volume."""
    end = {"axis": [1.0, 0.0, 0.0], "center": [0.5, 0.5, 0.5], "angle": 180.0}
    boundary = {"left": {"fix": True}, "right": {"rotate": end}}
    made = problem("Q2-P1d", 0.5, boundary, 3, material={"name": "neo-hookean"})
    newton_steps(made)
    assert Measures(made).volume_ratio() == pytest.approx(1, abs=1e-9)
    assert Measures(made).min_J() > 0.5


def test_time_limit() -> None:
    failure = bodies.ended(scene("Q2-P1d", 0.5, PULL, solve={"time_limit": 1e-6})).summary.failure
    assert failure is not None and failure.kind == "time"


# ---------------------------------------------------------------------- the choice


@pytest.mark.parametrize(
    ("nu", "tables", "expected"),
    [
        (0.3, {}, "Q2"),
        (0.49, {}, "Q2"),
        (0.499, {}, "Q2-P1d"),
        (0.5, {}, "Q2-P1d"),
        (0.3, {"mesh": {"cell": "tetrahedron"}}, "P2"),
        (0.499, {"mesh": {"cell": "tetrahedron"}}, "P2-P1"),
        (0.499, {"material": {"name": "linear-corotational"}}, "Q2"),
        (0.499, {"material": {"name": "hencky", "extension": 0.2}}, "Q2"),
    ],
)
def test_automatic_choice(nu: float, tables: Tables, expected: str) -> None:
    run = start(scene("auto", nu, PULL, 1, **tables), MPI.COMM_SELF)
    assert run.body.element == expected
    assert run.reason


def test_automatic_choice_on_many_cells() -> None:
    names = [choose(cell, mixed, 10**6).element for cell in ("hexahedron", "tetrahedron") for mixed in (False, True)]
    assert names == ["Q1", "Q1-P0", "P1", "P1-bubble"]


def test_no_choice_where_a_mixed_element_would_be_refused() -> None:
    for solve in ({"filter": "clamp"}, {"method": "trust-region"}):
        assert problem("auto", 0.499, PULL, 1, solve=solve).element == "Q2"


def test_an_element_is_chosen_unless_one_is_named() -> None:
    made = scene("Q1-P0", 0.5, PULL).model_dump(exclude_unset=True)
    del made["solve"]["element"]
    assert parse(made, Path("test.toml")).element == "Q2-P1d"


def test_automatic_choice_is_told(elastune: Callable[..., Any]) -> None:
    settings = ("mesh.cells=1", "solve.steps=1", "material.nu=0.499", "solve.element=auto", "output.picture=false")
    done = elastune("run", "cube-pull", *[word for setting in settings for word in ("--set", setting)])
    assert "Q2-P1d (auto: nu from 0.495 up)" in " ".join(done.stdout.splitlines()[0:2])
