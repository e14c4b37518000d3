"""The Python interface: lazy and typed; materials at a point, scenes, and bodies of one's own."""

import ast
import json
import os
import runpy
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ufl
from dolfinx.mesh import CellType, Mesh, create_box, create_rectangle, locate_entities_boundary, meshtags
from mpi4py import MPI

import elastune

ROOT = Path(__file__).parents[1]
NOTEBOOK = Path(__file__).with_name("notebook.py")
CATALOGUE = elastune.materials()
I = np.eye(3)  # noqa: E741

each_material = pytest.mark.parametrize("name", CATALOGUE)


def fresh(script: str) -> Any:
    """What a script prints as JSON, in an interpreter of its own."""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def example() -> str:
    lines = str(elastune.__doc__).splitlines()
    return textwrap.dedent("\n".join(line for line in lines if line.startswith("    ") or not line))


# ---------------------------------------------------------------- loading
@pytest.mark.parametrize(
    ("script", "without"),
    [
        ("elastune.__version__", {"dolfinx", "ufl", "numpy", "scipy", "pydantic", "mpi4py", "petsc4py", "rich"}),
        ("elastune.Clamp", {"dolfinx", "ufl", "pydantic", "mpi4py", "petsc4py"}),
        ("elastune.material('fung', 1, 0.4).uniaxial([1.1])", {"dolfinx", "pydantic", "mpi4py", "petsc4py"}),
        ("elastune.geometry.build", {"dolfinx", "gmsh", "numpy"}),
    ],
)
def test_nothing_is_loaded_before_it_is_used(script: str, without: set[str]) -> None:
    loaded = fresh(f"import elastune, json, sys\n{script}\nprint(json.dumps(list(sys.modules)))")
    assert not without & set(loaded)


def test_editors_see_the_names_that_are_there() -> None:
    tree = ast.parse((ROOT / "__init__.py").read_text())
    (block,) = (node for node in tree.body if isinstance(node, ast.If) and isinstance(node.test, ast.Name))
    stubs = {
        alias.asname: node.module for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    homes = {name: f"elastune.{home}" for home, names in elastune._HOMES.items() for name in names}  # type: ignore[attr-defined]
    assert stubs == homes | {"geometry": "elastune"}
    assert set(stubs) <= set(dir(elastune))
    for name, home in homes.items():
        assert getattr(elastune, name) is getattr(sys.modules[home], name)
        assert getattr(elastune, name).__doc__


def test_a_name_that_is_none_is_an_error() -> None:
    with pytest.raises(AttributeError, match="module 'elastune' has no attribute 'materal'"):
        elastune.materal  # type: ignore[attr-defined]  # noqa: B018


def test_without_fenicsx_it_says_what_is_missing() -> None:
    script = "import sys; sys.modules['ufl'] = None\nimport elastune, json\n"
    script += "try: elastune.materials\nexcept ImportError as error: print(json.dumps(str(error)))"
    said = fresh(script)
    assert said.startswith("elastune.materials needs FEniCSx (dolfinx 0.9 or newer") and "ufl" in said


@pytest.mark.skipif("MYPYPATH" not in os.environ, reason="./run tells mypy where the package is")
def test_type_checkers_see_what_the_names_are(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import elastune\n"
        "material = elastune.material('fung', E=1, nu=0.4)\n"
        "reveal_type(material.P([[1.0]]))\n"
        "run = elastune.solve(elastune.scene('cube-pull', {'mesh.cells': 4}))\n"
        "reveal_type([record.energy for record in run])\n"
        "elastune.materal('fung')\n"
        "elastune.material('fung', alfa=1.0)\n"
    )
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--config-file=", script.name]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    # Where something is defined is told by some releases only.
    lines = [line for line in done.stdout.splitlines() if line.startswith("script.py") and " defined in " not in line]
    said = [line.split(":", 2)[1:] for line in lines]
    expected = {
        "3": "numpy.ndarray",
        "5": "float]",
        "6": 'has no attribute "materal"',
        "7": 'Unexpected keyword argument "alfa"',
    }
    assert [line for line, _ in said] == list(expected), done.stdout + done.stderr
    for line, text in said:
        assert expected[line] in text


# ---------------------------------------------------------------- materials
def calibrated(name: str, **more: Any) -> "elastune.Material":
    nu = 0.4 if CATALOGUE[name].energy().has_lambda else 0.0
    return elastune.material(name, E=2.5, nu=nu, **more)


def gradients(*shape: int) -> np.ndarray:
    """F at random, J between 0.8 and 1.25 but away from one, where a material has a kink of third order."""
    rng = np.random.default_rng(3)
    F = I + 0.1 * rng.normal(size=(*shape, 3, 3))
    wanted = rng.uniform(1.1, 1.25, size=shape) ** rng.choice([-1, 1], size=shape)
    return F * ((wanted / np.linalg.det(F)) ** (1 / 3))[..., None, None]


def differences(function: Callable[[np.ndarray], np.ndarray], F: np.ndarray, step: float) -> np.ndarray:
    """Central differences of a function of F, of fourth order: [..., k, l] is its derivative in F_kl."""
    result = []
    for index in np.ndindex(3, 3):
        E = np.zeros((3, 3))
        E[index] = step
        near, far = function(F + E) - function(F - E), function(F + 2 * E) - function(F - 2 * E)
        result.append((8 * near - far) / (12 * step))
    return np.stack(result, axis=-1).reshape(*result[0].shape, 3, 3)


@pytest.mark.parametrize(
    ("name", "alpha"), [(name, a) for name, m in CATALOGUE.items() for a in (1.0, 1.3) if a == 1 or m.objective]
)
def test_stress_and_tangent_are_the_derivatives_of_the_energy(name: str, alpha: float) -> None:
    material, F = calibrated(name, alpha=alpha), gradients(2, 3)
    P, dPdF = material.P(F), material.dPdF(F)
    assert (P.shape, dPdF.shape, material.psi(F).shape) == ((2, 3, 3, 3), (2, 3, 3, 3, 3, 3), (2, 3))
    scale = np.abs(dPdF).max()
    assert np.abs(differences(material.psi, F, 1e-3) - P).max() < 1e-8 * scale
    assert np.abs(differences(material.P, F, 1e-3) - dPdF).max() < 1e-8 * scale


def test_values_are_those_of_the_formulas() -> None:
    F = gradients(4)
    lam, mu = elastune.material("neo-hookean", 2.5, 0.4).lame
    assert (lam, mu) == pytest.approx((2.5 * 0.4 / (1.4 * 0.2), 2.5 / 2.8), rel=1e-14)
    J, inverse = np.linalg.det(F), np.linalg.inv(F)
    log, back = np.log(J)[:, None, None], inverse.transpose(0, 2, 1)
    material = elastune.material("neo-hookean", 2.5, 0.4)
    psi = mu / 2 * (np.einsum("nij,nij->n", F, F) - 3) - mu * np.log(J) + lam / 2 * np.log(J) ** 2
    assert material.psi(F) == pytest.approx(psi, rel=1e-13)
    assert material.P(F) == pytest.approx(mu * (F - back) + lam * log * back, rel=1e-12, abs=1e-13)
    tangent = mu * np.einsum("ik,jl->ijkl", I, I) + lam * np.einsum("nji,nlk->nijkl", inverse, inverse)
    tangent = tangent + np.einsum("n,nli,njk->nijkl", mu - lam * np.log(J), inverse, inverse)
    assert material.dPdF(F) == pytest.approx(tangent, rel=1e-12, abs=1e-12)

    E = (F.transpose(0, 2, 1) @ F - I) / 2
    S = 2 * mu * E + lam * np.trace(E, axis1=1, axis2=2)[:, None, None] * I
    assert elastune.material("st-venant-kirchhoff", 2.5, 0.4).P(F) == pytest.approx(F @ S, rel=1e-12, abs=1e-13)


def test_one_gradient_is_an_array_of_none() -> None:
    material, F = elastune.material("hencky", 1.0, 0.3), gradients(1)
    assert material.psi(F[0]).shape == ()
    assert material.P(F[0].tolist()).tolist() == material.P(F)[0].tolist()
    assert material.dPdF(np.empty((0, 3, 3))).shape == (0, 3, 3, 3, 3)


def test_where_a_material_is_undefined_it_says_so() -> None:
    inverted = np.diag([1.0, 1.0, -0.5])
    assert np.isnan(elastune.material("neo-hookean", 1.0, 0.3).psi([I, inverted])).tolist() == [False, True]
    assert np.isfinite(elastune.material("stable-neo-hookean", 1.0, 0.3).psi(inverted))


@each_material
def test_curves_set_out_with_youngs_modulus_and_poissons_ratio(name: str) -> None:
    material = calibrated(name, **({"alpha": 0.7} if CATALOGUE[name].objective else {}))
    stress, lateral = material.uniaxial([1 - 1e-4, 1.0, 1 + 1e-4])
    assert (stress[1], lateral[1]) == pytest.approx((0.0, 1.0), abs=1e-14)
    assert (stress[2] - stress[0]) / 2e-4 == pytest.approx(material.E, rel=1e-6) == pytest.approx(2.5, rel=1e-6)
    assert (lateral[0] - lateral[2]) / 2e-4 == pytest.approx(material.nu, rel=1e-6, abs=1e-6)


def test_parameters_are_those_that_are_solved_for_and_tuned() -> None:
    material = elastune.material("neo-hookean", 2.5, 0.4, alpha=1.5)
    lam, mu = material.lame
    assert material.parameters == pytest.approx({"lam": lam, "mu": mu, "nonlinearity": 1.5}, rel=1e-13)
    assert repr(material) == "<neo-hookean: E = 2.5, nu = 0.4, lam = 3.571, mu = 0.8929, nonlinearity = 1.5>"
    given = elastune.material("neo-hookean", parameters={"lam": 3.0, "mu": 2.0})
    assert (given.lame, given.energy.values) == ((3.0, 2.0), {"lam": 3.0, "mu": 2.0})
    assert elastune.material("arap", 1.0, 0.4, volume="neo-hookean").nu == pytest.approx(0.4, rel=1e-13)


# ---------------------------------------------------------------- materials of one's own
def mine(
    s: Any, lam: elastune.Modulus = 1.0, mu: elastune.PositiveModulus = 1.0, power: elastune.Exponent = 2.0
) -> elastune.Parts:
    """ψ = μ/2 (I₁ - 3) - μ log J + λ (J - 1)^n / 2."""
    return elastune.Parts(mu / 2 * (s.I1 - 3) - mu * ufl.ln(s.J), lam, (s.J - 1) ** power / 2)


def test_a_formula_of_ones_own_is_like_one_of_the_catalogue() -> None:
    F = gradients(3)
    own, shipped = elastune.material(mine, 2.5, 0.4), elastune.material("neo-hookean-ogden", 2.5, 0.4)
    assert (own.E, own.nu, *own.lame) == pytest.approx((2.5, 0.4, *shipped.lame), rel=1e-13)
    for method in ("psi", "P", "dPdF", "uniaxial"):
        argument = [0.8, 1.3] if method == "uniaxial" else F
        values, expected = (np.array(getattr(material, method)(argument)) for material in (own, shipped))
        assert values == pytest.approx(expected, rel=1e-12, abs=1e-12)
    tuned = elastune.material(mine, 2.5, 0.4, alpha=2.0)
    assert tuned.psi(F) == pytest.approx(elastune.material("neo-hookean-ogden", 2.5, 0.4, alpha=2.0).psi(F), rel=1e-12)
    assert own.formula.startswith("ψ = μ/2 (I₁ - 3) - μ log J + λ")
    assert "mine" not in elastune.materials()


def test_two_formulas_of_one_name_are_two_materials() -> None:
    def linear(stiffness: float) -> "elastune.Material":
        return elastune.material(lambda s: stiffness / 2 * sum((x - 1) ** 2 for x in s.stretches))

    F = np.diag([1.3, 1.0, 1.0])
    assert linear(2.0).psi(F) == pytest.approx(0.09, rel=1e-13)
    assert linear(4.0).psi(F) == pytest.approx(0.18, rel=1e-13)


def test_two_moduli_are_solved_for_whatever_their_names() -> None:
    def own(s: Any, kappa: elastune.PositiveModulus = 3.0, c: elastune.PositiveModulus = 1.0) -> elastune.Parts:
        return elastune.Parts(c * (s.J ** (-2 / 3) * s.I1 - 3), kappa, (s.J - 1) ** 2 / 2)

    material = elastune.material(own, 2.5, 0.4)
    assert material.parameters == pytest.approx({"kappa": 2.5 / 0.6, "c": 2.5 / 5.6}, rel=1e-12)


def test_a_formula_says_whether_it_is_defined_for_inverted_cells() -> None:
    def own(s: Any, c: elastune.PositiveModulus = 1.0) -> Any:
        return c * ((s.I1 - 3) / 2 - (s.J - 1) + (s.J - 1) ** 2)

    inverted = np.diag([1.0, 1.0, -0.5])
    assert np.isnan(elastune.material(own).psi(inverted))
    assert elastune.material(own, inverts=True).psi(inverted) == pytest.approx(-0.375 + 1.5 + 2.25, rel=1e-14)


def unbounded(s: Any, mu: float = 1.0) -> Any:
    return mu * ufl.ln(s.J) ** 2


def of_numpy(s: Any, mu: elastune.PositiveModulus = 1.0) -> Any:
    return mu * np.log(s.J) ** 2


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: elastune.material("fun"), "fung"),
        (lambda: elastune.material("fung", 1.0), "nu: missing"),
        (lambda: elastune.material("fung", -1.0, 0.3), "E: must be a positive number"),
        (lambda: elastune.material("fung", 1.0, 0.6), "0.6"),
        (lambda: elastune.material("fung", 1.0, 0.3, parameters={"mu2": 1}), "unknown parameter 'mu2'"),
        (lambda: elastune.material("fung", 1.0, 0.3, inverts=True), "inverts"),
        (lambda: elastune.material("fung", 1.0, 0.5).psi(I), "below 0.5"),
        (lambda: elastune.material("fung", 1.0, 0.5).volumetric([1.1]), "incompressible"),
        (lambda: elastune.material("fung", 1.0, 0.4).uniaxial([-1.1]), "positive stretches"),
        (lambda: elastune.material("fung", 1.0, 0.4).P(np.eye(2)), r"expected shape (..., 3, 3), got (2, 2)"),
        (lambda: elastune.material("fung", 1.0, 0.4).P("F"), "F: expected numbers"),
        (lambda: elastune.material(unbounded), "unbounded: parameter mu needs a bounds annotation"),
        (lambda: elastune.material(of_numpy), "of_numpy: "),
        (lambda: elastune.material(lambda s: s.I1), "stressed at rest"),
        (lambda: elastune.material(lambda s: (s.I1 - 3) / 2 - ufl.ln(s.J), 1.0, 0.0), "no modulus to calibrate"),
        (lambda: elastune.material(3), "3"),  # type: ignore[arg-type]
    ],
)
def test_what_cannot_be_is_told_in_a_line(make: Callable[[], Any], said: str) -> None:
    with pytest.raises(elastune.MaterialError) as caught:
        make()
    assert said in str(caught.value) and "\n" not in str(caught.value)


# ---------------------------------------------------------------- scenes
def coarse(**more: Any) -> "elastune.Scene":
    return elastune.scene("cube-pull", {"mesh.cells": 2, "solve.steps": 3, **more})


def test_changes_of_a_scene_are_those_of_the_command_line() -> None:
    from elastune.app.scene.read import load

    changes = {"mesh.cells": np.int64(3), "material.alpha": 0.5, "boundary.right": {"move": (0.5, 0, 0)}}
    changed = elastune.scene("cube-pull", changes)
    words = ["mesh.cells=3", "material.alpha=0.5", "boundary.right={move=[0.5, 0, 0]}"]
    assert changed == load("cube-pull", words) != load("cube-pull")
    assert elastune.scene(ROOT / "app/scene/shipped/cube-pull.toml") == load("cube-pull")


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: elastune.scene("cube-pul"), "did you mean cube-pull?"),
        (lambda: elastune.scene("cube-pull", {"mesh.cels": 3}), "mesh.cels: unknown key; did you mean cells?"),
        (lambda: elastune.scene("cube-pull", {"title.cells": 3}), "title.cells: title is not a table"),
        (lambda: elastune.scene("cube-pull", {"material.nu": 0.7}), "0.7"),
        (lambda: elastune.solve(coarse(), elastune.Options()), "solve.steps"),  # type: ignore[call-overload]
        (lambda: elastune.solve(coarse()).fields("mises"), "von_mises"),
    ],
)
def test_what_cannot_be_of_a_scene_is_told_in_a_line(make: Callable[[], Any], said: str) -> None:
    with pytest.raises(elastune.UserError) as caught:
        make()
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_a_run_is_solved_as_it_is_iterated() -> None:
    run = elastune.solve(coarse(), comm=MPI.COMM_SELF)
    records, J = [], []
    for record in run:
        records.append(record)
        J.append(run.fields("J")["J"].mean())
        assert len(run.history["load"]) == len(records)
    assert [record.load for record in records] == [1 / 3, 2 / 3, 1.0]
    # Cells of one size: the mean of their volume ratios is that of the body.
    assert [record.volume_ratio for record in records] == pytest.approx(J, rel=1e-10)
    assert run.history["energy"].tolist() == [record.energy for record in records]
    assert run.history["reaction_left"].tolist() == [record.reaction["left"] for record in records]


def test_a_run_that_is_not_iterated_is_solved_when_it_is_asked() -> None:
    expected = [record.energy for record in elastune.solve(coarse())]
    assert elastune.solve(coarse()).history["energy"].tolist() == pytest.approx(expected, rel=1e-12)
    fields = elastune.solve(coarse()).fields("displacement", "stretches")
    assert (fields["displacement"].shape, fields["stretches"].shape) == ((27, 3), (8, 3))
    assert fields["displacement"][:, 0].max() == pytest.approx(1.0, rel=1e-12)


def test_a_plot_is_the_curve_and_leaves_pyplot_alone() -> None:
    run = elastune.solve(coarse())
    (axes,) = run.plot().axes
    (line,) = (line for line in axes.lines if len(line.get_xdata()) == 4)
    assert line.get_xdata() == pytest.approx([0, 1 / 3, 2 / 3, 1])
    assert line.get_ydata()[1:] == pytest.approx(run.history["reaction_right"][:, 0])
    assert "matplotlib.pyplot" not in fresh(
        "import elastune, json, sys; elastune.solve(elastune.scene('cube-pull', {'mesh.cells': 1})).plot()\n"
        "print(json.dumps(list(sys.modules)))"
    )


def test_a_failure_ends_the_run_and_is_kept() -> None:
    run = elastune.solve(coarse(**{"solve.max_iterations": 1, "solve.smallest_step": 0.5})).finish()
    assert run.summary.status == "failed"
    assert run.summary.failure is not None and run.summary.failure.load > 0
    assert list(run) == []


# ---------------------------------------------------------------- bodies
def pulled(geometry: "elastune.Geometry", **faces: str) -> "elastune.Body":
    """On three rollers and pulled at a face: every point is in uniaxial tension."""
    conditions: dict[str, Any] = {faces[axis]: elastune.Roller((number,)) for number, axis in enumerate("xyz")}
    conditions[faces["pulled"]] = elastune.Pull((0.3, 0.0, 0.0))
    return elastune.body(geometry, elastune.material(mine, 1.0, 0.3, alpha=1.2), conditions)


def own_geometry(mesh: Mesh, size: tuple[float, ...]) -> "elastune.Geometry":
    """As a person tags a mesh: the sides x = 0, y = 0 and z = 0, and the end."""
    dim = mesh.topology.dim - 1
    planes = [(axis, 0.0) for axis in range(dim + 1)] + [(0, size[0])]
    found = [locate_entities_boundary(mesh, dim, lambda x, a=a, at=at: np.isclose(x[a], at)) for a, at in planes]
    facets = np.concatenate(found)
    tags = np.repeat(np.arange(11, 11 + len(found), dtype=np.int32), [len(own) for own in found])
    order = np.argsort(facets)
    names = [*["west", "south", "below"][: dim + 1], "east"]
    numbers = dict(zip(names, range(11, 11 + len(found)), strict=True))
    return elastune.Geometry(mesh, meshtags(mesh, dim, facets[order], tags[order]), numbers)


@pytest.mark.parametrize("cell", [CellType.hexahedron, CellType.tetrahedron], ids=["hexahedra", "tetrahedra"])
def test_a_mesh_and_a_material_of_ones_own_follow_the_materials_curve(cell: CellType) -> None:
    size = (2.0, 1.0, 0.5)
    mesh = create_box(MPI.COMM_SELF, [(0.0, 0.0, 0.0), size], [2, 1, 1], cell)
    body = pulled(own_geometry(mesh, size), x="west", y="south", z="below", pulled="east")
    run = elastune.solve(body, elastune.Options(steps=2)).finish()
    assert (run.summary.status, body.element) == ("converged", {"h": "Q2", "t": "P2"}[cell.name[0]])
    material = elastune.material(mine, 1.0, 0.3, alpha=1.2)
    places = run.fields("displacement")["displacement"]
    stretch = 1 + places[:, 0].max() / size[0]
    stress, lateral = material.uniaxial([stretch])
    assert stress[0] == pytest.approx(0.3, rel=1e-7)
    assert 1 + places[:, 1].min() / size[1] == pytest.approx(lateral[0], rel=1e-7)
    assert run.fields("stretches")["stretches"][0] == pytest.approx([stretch, lateral[0], lateral[0]], rel=1e-7)


def test_a_body_is_what_a_scene_of_it_is() -> None:
    scene = coarse()
    cube = elastune.geometry.build(MPI.COMM_SELF, shape="cube", cells=2)
    material = elastune.material(scene.material.name, scene.material.E, scene.material.nu, alpha=scene.material.alpha)
    ends = {"left": elastune.Clamp(), "right": elastune.Translation((1.0, 0.0, 0.0))}
    body = elastune.body(cube, material, ends, element=scene.solve.element)
    own = elastune.solve(body, elastune.Options(steps=3)).history
    expected = elastune.solve(scene).history
    assert own["energy"] == pytest.approx(expected["energy"], rel=1e-10)
    assert own["reaction_left"] == pytest.approx(expected["reaction_left"], rel=1e-7, abs=1e-9)


def test_plane_strain_and_incompressible_bodies() -> None:
    mesh = create_rectangle(MPI.COMM_SELF, [(0.0, 0.0), (1.0, 1.0)], [2, 2], CellType.quadrilateral)
    geometry = own_geometry(mesh, (1.0, 1.0))
    sides = {"west": elastune.Roller((0,)), "south": elastune.Roller((1,)), "east": elastune.Pull((0.4, 0.0))}
    body = elastune.body(geometry, elastune.material("neo-hookean", 3.0, 0.5), sides)
    assert body.element == "Q2-P1d"
    places = elastune.solve(body, elastune.Options(steps=2)).fields("displacement")["displacement"]
    stretch = 1 + places[:, 0].max()
    # Plane strain without volume change: P = μ (λ - 1/λ³), μ = E/3.
    assert stretch - stretch**-3 == pytest.approx(0.4, rel=1e-6)
    assert (1 + places[:, 1].min()) * stretch == pytest.approx(1.0, rel=1e-7)


def _body(element: str = "auto", nu: float = 0.3, face: str = "left", **more: Any) -> Any:
    cube = elastune.geometry.build(MPI.COMM_SELF, shape="cube", cells=1)
    held = {face: more.pop("condition", elastune.Clamp())}
    faces = cube.faces | more.pop("faces", {})
    geometry = elastune.Geometry(cube.mesh, more.pop("tags", cube.facet_tags), faces)
    return elastune.solve(elastune.body(geometry, elastune.material("hencky", 1.0, nu), held, element=element), **more)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: _body(face="wall"), "unknown face"),
        (lambda: _body(face="wall", faces={"wall": 99}), "'wall': no facet has its tag, 99"),
        (lambda: _body(element="P2"), "expected one of Q1, Q2, Q3, Q1-P0, Q2-P1d on hexahedron cells"),
        (lambda: _body(element="Q9"), 'element = "Q9"'),
        (lambda: _body(condition=elastune.Pull((1.0, 0.0, 0.0))), "nothing holds the body"),
        (lambda: _body(condition=elastune.Translation((1.0, 0.0))), "expected 3 components"),
        (lambda: _body(comm=MPI.COMM_SELF), "comm: expected none with a body"),
        (lambda: _body(element="Q2", nu=0.5), "nu = 0.5 needs a mixed element, got Q2"),
    ],
)
def test_what_cannot_be_of_a_body_is_told_in_a_line(make: Callable[[], Any], said: str) -> None:
    with pytest.raises((elastune.UserError, elastune.MaterialError)) as caught:
        make()
    assert said in str(caught.value) and "\n" not in str(caught.value)


# ---------------------------------------------------------------- as a person uses it
def test_example_of_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(example(), names)
    assert len(capsys.readouterr().out.splitlines()) == 10
    assert (tmp_path / "curve.png").read_bytes().startswith(b"\x89PNG")
    # The pull of 0.1 on the unit face is carried by the other.
    assert names["forces"][-1] == pytest.approx([-0.1, 0.0, 0.0], abs=1e-7)


def test_notebook() -> None:
    runpy.run_path(str(NOTEBOOK))


def test_notebook_on_two_ranks() -> None:
    command = ["mpirun", "-n", "2", sys.executable, str(NOTEBOOK)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert (done.returncode, done.stderr) == (0, "")
