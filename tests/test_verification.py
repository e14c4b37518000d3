"""Bodies whose solution is known: in closed form, by a differential equation of one variable, or manufactured."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bodies
import numpy as np
import pytest
import ufl
from mpi4py import MPI
from scipy.integrate import quad, solve_bvp

from elastune.app.body.body import Body
from elastune.app.body.unknowns import State
from elastune.app.results.quantities import force, moment
from elastune.app.run import Run
from elastune.app.scene.build import build, options
from elastune.app.scene.read import parse
from elastune.app.scene.schema import Scene
from elastune.app.solvers.options import Options
from elastune.app.studies.orders import fitted_order
from elastune.app.verify.exact import Follows, Manufactured, Waves, body_force
from elastune.forms import response
from elastune.forms.elements import ELEMENTS
from elastune.forms.energy import CATALOGUE
from elastune.forms.evaluation import as_numpy
from elastune.forms.kinematics import PrincipalStretches
from elastune.forms.normalize import lame_pair
from elastune.forms.tuned import tuned_energy

Tables = dict[str, Any]
MATERIALS = sorted(CATALOGUE)
OBJECTIVE = [name for name in MATERIALS if CATALOGUE[name].objective]
CELLS = {name: element.cells[0] for name, element in ELEMENTS.items()}


def material(name: str, nu: float = 0.3) -> Tables:
    """A calibrated material; those without a λ part take one."""
    given: Tables = {"name": name, "E": 1.0, "nu": nu}
    return given if len(CATALOGUE[name].pair) > 1 else given | {"volume": "neo-hookean-ogden"}


def scene(boundary: Tables, mesh: Tables, solve: Tables, given: Tables | None = None) -> Scene:
    data = {"mesh": mesh, "solve": {"steps": 1, **solve}, "material": given or material("neo-hookean")}
    return parse({**data, "boundary": boundary}, Path("test.toml"))


def solved(given: Scene) -> Body:
    return bodies.solved(given).body


CLAMPED: Tables = {"left": {"fix": True}, "right": {"move": [1.0, 0.0, 0.0]}}

# ---------------------------------------------------------------------- manufactured solutions

# By element: meshes, then per error the order of theory and a cap on the finest mesh. A continuous pressure of
# degree one beside P1-bubble has order one in theory; structured meshes give it one half more.
ORDERS: dict[str, tuple[tuple[int, ...], dict[str, tuple[float, float]]]] = {
    "P1": ((4, 6, 8), {"l2": (2, 6e-3), "h1": (1, 0.11), "stress": (1, 0.11)}),
    "P2": ((2, 3, 4), {"l2": (3, 9e-4), "h1": (2, 0.018), "stress": (2, 0.022)}),
    "P3": ((1, 2, 3), {"l2": (4, 1.3e-4), "h1": (3, 2.6e-3), "stress": (3, 2.7e-3)}),
    "Q1": ((3, 4, 6), {"l2": (2, 6e-3), "h1": (1, 0.065), "stress": (1, 0.08)}),
    "Q2": ((2, 3, 4), {"l2": (3, 3.5e-4), "h1": (2, 6e-3), "stress": (2, 8.5e-3)}),
    "P2-P1": ((2, 3, 4), {"l2": (3, 9e-4), "h1": (2, 0.018), "pressure": (2, 0.03)}),
    "Q2-P1d": ((2, 3, 4), {"l2": (3, 4.5e-4), "h1": (2, 6.5e-3), "pressure": (2, 0.03)}),
    "P1-bubble": ((3, 4, 6), {"l2": (2, 0.011), "h1": (1, 0.14), "pressure": (1.5, 0.2)}),
    "Q1-P0": ((3, 4, 6), {"l2": (2, 6e-3), "h1": (1, 0.065), "pressure": (1, 0.2)}),
}


def manufactured(element: str, cells: int, given: Tables | None = None) -> dict[str, float]:
    mesh = {"cells": cells, "cell": CELLS[element]}
    wanted = scene(CLAMPED, mesh, {"element": element, "tolerance": 1e-10}, given)
    problem = Manufactured(wanted, MPI.COMM_SELF)
    assert Run(problem.body, options(wanted)).finish().summary.failure is None
    return problem.errors()


@pytest.mark.parametrize("element", ORDERS)
def test_orders_of_the_elements(element: str) -> None:
    """Ciarlet 1978, Theorems 3.2.2, 3.2.5: k in H¹, k + 1 in L²; Boffi, Brezzi & Fortin 2013, Section 8: pressures."""
    meshes, expected = ORDERS[element]
    errors = [manufactured(element, cells) for cells in meshes]
    for name, (order, cap) in expected.items():
        fitted = fitted_order([1 / cells for cells in meshes], [error[name] for error in errors])
        # A better order than theory's is a gain of the structured mesh, not a fault.
        assert order - 0.1 < fitted < order + 0.5, (name, fitted)
        assert errors[-1][name] < cap, (name, errors[-1][name])


@pytest.mark.parametrize("name", MATERIALS)
def test_every_material_converges(name: str) -> None:
    """First order in the gradient of Q1, to a solution whose body force comes from the material itself."""
    coarse, fine = (manufactured("Q1", cells, material(name)) for cells in (2, 4))
    assert np.log2(coarse["h1"] / fine["h1"]) == pytest.approx(1.0, abs=0.12)
    assert np.log2(coarse["l2"] / fine["l2"]) == pytest.approx(2.0, abs=0.25)
    assert fine["h1"] < 0.12
    assert fine["l2"] < 0.025


@pytest.mark.parametrize("name", OBJECTIVE)
def test_body_force_is_the_divergence_of_stress(name: str) -> None:
    """-div P by central differences of P = U diag(∂ψ/∂λ) Vᵀ, with ∂ψ/∂λ by UFL and the stretches by numpy."""
    given = material(name)
    energy = tuned_energy(given["name"], given["E"], given["nu"], volume=given.get("volume"))
    stretches = [ufl.variable(ufl.as_ufl(1.0)) for _ in range(3)]
    psi = energy.density(PrincipalStretches(stretches))
    slopes = as_numpy([ufl.diff(psi, s) for s in stretches], stretches)
    exact = Waves(3)

    def stress(X: np.ndarray) -> np.ndarray:
        U, s, Vt = np.linalg.svd(np.eye(3) + exact.gradient(X))
        return (U * np.stack(np.broadcast_arrays(*slopes(*s.T)), axis=-1)[:, None, :]) @ Vt

    X = np.random.default_rng(1).random((20, 3))
    h = 1e-3
    divergence = np.zeros_like(X)
    for J, direction in enumerate(np.eye(3)):
        near, far = (stress(X + k * h * direction) - stress(X - k * h * direction) for k in (1, 2))
        divergence += ((8 * near - far) / (12 * h))[:, :, J]
    force = body_force(energy, exact, X)
    assert np.abs(force + divergence).max() < 1e-9 * max(1.0, np.abs(force).max())


# ---------------------------------------------------------------------- homogeneous deformation

HELD: Tables = {face: {"fix": True} for face in ("left", "right", "front", "back", "bottom", "top")}


def affine(given: Scene, H: np.ndarray, t: np.ndarray | None = None) -> Body:
    """A body whose boundary follows u = H X + t."""
    follows = Follows(lambda X: X @ H.T + (0 if t is None else t))
    return build(given, MPI.COMM_SELF, conditions=dict.fromkeys(HELD, follows))[0]


def run_of(body: Body, tolerance: float) -> Body:
    assert Run(body, Options(steps=1, tolerance=tolerance)).finish().summary.failure is None
    return body


def whole(body: Body, face: str) -> np.ndarray:
    """The traction's resultant on a face: edges that others hold too count in full."""
    forces = body.layout.nodal(body.assembly.residual(body.state))
    return force(body.u, forces, body.constraints.faces[face])


@pytest.mark.parametrize("element", ELEMENTS)
def test_patch(element: str) -> None:
    """Affine displacements of the boundary give the affine displacement on any mesh (Irons & Razzaque 1972)."""
    H = np.array([[0.2, 0.1, 0.0], [-0.05, -0.1, 0.08], [0.0, 0.06, 0.05]])
    mesh = {"cells": 3, "cell": CELLS[element]}
    problem = affine(scene(CLAMPED, mesh, {"element": element}), H)
    x = problem.geometry.mesh.geometry.x
    inside = ((x > 1e-9) & (x < 1 - 1e-9)).all(axis=1)
    x[inside] += np.random.default_rng(3).uniform(-0.08, 0.08, (inside.sum(), 3))
    # Nodes of higher order have moved with the vertices.
    points = problem.V.tabulate_dof_coordinates()
    problem.constraints.points[:] = points
    run_of(problem, 1e-13)
    assert np.abs(problem.u.x.array - (points @ H.T).ravel()).max() < 2e-12
    if problem.p is not None:
        assert np.ptp(problem.p.x.array) < 2e-11
    reaction = whole(problem, "right")
    _, P, _ = response.second(problem.parts[0].energy, H[None])
    assert reaction == pytest.approx(P[0, :, 0], abs=1e-11)


@pytest.mark.parametrize("name", OBJECTIVE)
def test_simple_shear(name: str) -> None:
    """σ₁₁ - σ₂₂ = γ σ₁₂ for every isotropic material (Rivlin 1948; Truesdell & Noll 1965, Eq. 54.15)."""
    gamma = 0.4
    H = np.zeros((3, 3))
    H[0, 1] = gamma
    problem = run_of(affine(scene(CLAMPED, {"cells": 2}, {}, material(name)), H), 1e-12)
    # With J = 1, σ = P Fᵀ; the columns of P are forces on faces.
    P = np.stack([whole(problem, face) for face in ("right", "back", "top")], axis=1)
    cauchy = P @ (np.eye(3) + H).T
    assert cauchy == pytest.approx(cauchy.T, abs=1e-10)
    assert cauchy[0, 0] - cauchy[1, 1] == pytest.approx(gamma * cauchy[0, 1], abs=1e-10)
    assert cauchy[0, 1] > 0.05


def test_equibiaxial_tension() -> None:
    """Log neo-Hookean: σ₃ = 0 gives s₃ by μ(s₃² - 1) + λ log(s² s₃) = 0, then P₁ = μ(s - 1/s) + λ log(s² s₃)/s."""
    stretch, (lam, mu) = 1.5, lame_pair(1.0, 0.3)
    thickness = 1.0
    for _ in range(60):
        value = mu * (thickness**2 - 1) + lam * np.log(stretch**2 * thickness)
        thickness -= value / (2 * mu * thickness + lam / thickness)
    stress = mu * (stretch - 1 / stretch) + lam * np.log(stretch**2 * thickness) / stretch
    boundary = {
        "left": {"roller": ["x"]},
        "front": {"roller": ["y"]},
        "bottom": {"roller": ["z"]},
        "right": {"pull": [stress, 0.0, 0.0]},
        "back": {"pull": [0.0, stress, 0.0]},
    }
    problem = solved(scene(boundary, {"cells": 2}, {"tolerance": 1e-12, "steps": 4}))
    corner = problem.V.tabulate_dof_coordinates().sum(axis=1).argmax()
    expected = [stretch - 1, stretch - 1, thickness - 1]
    assert problem.u.x.array.reshape(-1, 3)[corner] == pytest.approx(expected, abs=1e-9)


# ---------------------------------------------------------------------- rigid motion


@pytest.mark.parametrize("degrees", [1e-6, 30.0, 90.0, 180.0, 359.0])
@pytest.mark.parametrize(("assembly", "rounding"), [("spectral", 1e-22), ("ufl", 1e-15)])
@pytest.mark.parametrize("element", ["P1", "P2", "Q1", "Q2"])
def test_rigid_motion_costs_nothing(element: str, assembly: str, rounding: float, degrees: float) -> None:
    """A turn about an oblique axis and a shift by 1e3 lengths.

    Displacements of size 1e3 carry rounding of 1e-13, and their gradient some 1e-12 at node distances of a sixth;
    the kernel's energy is E times its square, and a nodal force E times that on a tenth of a face. UFL's energy is
    a difference of numbers of the size of E.
    """
    axis = np.array([1.0, 2.0, -2.0]) / 3
    cross = np.cross(np.eye(3), axis)
    angle = np.deg2rad(degrees)
    H = -np.sin(angle) * cross + 2 * np.sin(angle / 2) ** 2 * (cross @ cross)
    t = 1e3 * np.array([0.6, -0.64, 0.48])
    solve = {"element": element, "assembly": assembly}
    problem = affine(scene(CLAMPED, {"cells": 3, "cell": CELLS[element]}, solve), H, t)
    moved = State((problem.points @ H.T + t).ravel())
    assert abs(problem.assembly.energy(moved)) < rounding
    assert np.abs(problem.assembly.residual(moved)).max() < 4e-12


# ---------------------------------------------------------------------- Rivlin's torsion


@pytest.mark.parametrize(("element", "cells", "accuracy"), [("Q2-P1d", [6, 2], 1e-3), ("P2-P1", [8, 3], 2e-2)])
def test_torsion_of_an_incompressible_cylinder(element: str, cells: list[int], accuracy: float) -> None:
    """Torque πμκa⁴/2 and axial force -πμκ²a⁴/4 of a neo-Hookean cylinder twisted by κ a length (Rivlin 1948).

    The ends turn rigidly and keep their distance, as in the closed form: the solution has no end effect. The force,
    of second order in κ, is the harder of the two.
    """
    radius, height, degrees = 0.5, 0.5, 30.0
    kappa, mu = np.deg2rad(degrees) / height, 1 / 3
    boundary = {
        "bottom": {"fix": True},
        "top": {"rotate": {"axis": [0.0, 0.0, 1.0], "center": [0.0, 0.0, 0.0], "angle": degrees}},
    }
    mesh = {"shape": "cylinder", "size": [radius, height], "cells": cells, "cell": CELLS[element], "order": 2}
    given = {"name": "neo-hookean", "E": 1.0, "nu": 0.5}
    problem = solved(scene(boundary, mesh, {"element": element}, given))
    forces, top = problem.layout.nodal(problem.assembly.residual(problem.state)), problem.constraints.faces["top"]
    assert moment(problem.u, forces, top)[2] == pytest.approx(np.pi * mu * kappa * radius**4 / 2, rel=1e-3)
    assert force(problem.u, forces, top)[2] == pytest.approx(-np.pi * mu * kappa**2 * radius**4 / 4, rel=accuracy)


# ---------------------------------------------------------------------- inflation


def _gmsh(path: Path, draw: Callable[[Any], None]) -> str:
    """Writes what is drawn as a mesh of second-order cells."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        draw(gmsh.model)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return str(path)


def _quarter_ring(model: Any) -> None:
    """Radii 1 and 2 in the first quadrant, 4 by 6 quadrilaterals."""
    geo = model.geo
    centre = geo.addPoint(0, 0, 0)
    a, b, c, d = (geo.addPoint(*x, 0) for x in ((1, 0), (2, 0), (0, 2), (0, 1)))
    lines = geo.addLine(a, b), geo.addCircleArc(b, centre, c), geo.addLine(c, d), geo.addCircleArc(d, centre, a)
    surface = geo.addPlaneSurface([geo.addCurveLoop(lines)])
    geo.synchronize()
    for line, cells in zip(lines, (4, 6, 4, 6), strict=True):
        model.mesh.setTransfiniteCurve(line, cells + 1)
    model.mesh.setTransfiniteSurface(surface)
    model.mesh.setRecombine(2, surface)
    for name, line in zip(("bottom", "outer", "left", "inner"), lines, strict=True):
        model.addPhysicalGroup(1, [line], name=name)
    model.addPhysicalGroup(2, [surface], name="body")
    model.mesh.generate(2)


def test_inflation_of_an_incompressible_tube(tmp_path: Path) -> None:
    """The pressure ∫ μ(s² - s⁻²) dr/r of a neo-Hookean tube in plane strain, s = r/R, r² = R² + c.

    Ogden 1997, Non-Linear Elastic Deformations, Section 5.3.2.
    """
    inner, mu = 1.3, 1 / 3
    c = inner**2 - 1
    pressure, _ = quad(lambda R: mu * ((R**2 + c) / R**2 - R**2 / (R**2 + c)) * R / (R**2 + c), 1, 2, epsabs=1e-13)
    boundary = {"bottom": {"roller": ["y"]}, "left": {"roller": ["x"]}, "inner": {"pressure": pressure}}
    mesh = {"shape": "file", "path": _gmsh(tmp_path / "ring.msh", _quarter_ring)}
    given = {"name": "neo-hookean", "E": 1.0, "nu": 0.5}
    problem = solved(scene(boundary, mesh, {"element": "Q2-P1d", "steps": 4}, given))
    X = problem.V.tabulate_dof_coordinates()[:, :2]
    R, r = np.linalg.norm(X, axis=1), np.linalg.norm(X + problem.u.x.array.reshape(-1, 2), axis=1)
    assert np.abs(r - np.sqrt(R**2 + c)).max() < 5e-4


def _octant_of_a_shell(model: Any) -> None:
    """Radii 1 and 2, tetrahedra."""
    occ = model.occ
    outer, inner = (occ.addSphere(0, 0, 0, radius, angle1=0, angle3=np.pi / 2) for radius in (2, 1))
    occ.cut([(3, outer)], [(3, inner)])
    occ.synchronize()
    for _, tag in model.getEntities(2):
        low, high = np.array(model.getBoundingBox(2, tag)).reshape(2, 3)
        flat = np.flatnonzero(high - low < 1e-3)
        name = ("left", "front", "bottom")[flat[0]] if len(flat) else "inner" if high.max() < 1.5 else "outer"
        model.addPhysicalGroup(2, [tag], name=name)
    model.addPhysicalGroup(3, [tag for _, tag in model.getEntities(3)], name="body")
    model.mesh.setSize(model.getEntities(0), 0.45)
    model.mesh.generate(3)


def test_inflation_of_a_compressible_sphere(tmp_path: Path) -> None:
    """(R² P_R)' = 2 R P_θ for the radius r(R), log neo-Hookean, by scipy's collocation to 1e-10.

    The stretches are r' and r/R twice; inside the pressure acts on the deformed area, P_R = -p (r/R)²; outside P_R = 0.
    """
    pressure, (lam, mu) = 0.15, lame_pair(1.0, 0.3)

    def radial(slope: np.ndarray, hoop: np.ndarray) -> np.ndarray:
        return mu * (slope - 1 / slope) + lam * np.log(slope * hoop**2) / slope

    def equation(R: np.ndarray, y: np.ndarray) -> np.ndarray:
        r, slope = y
        hoop = r / R
        tangential = mu * (hoop - 1 / hoop) + lam * np.log(slope * hoop**2) / hoop
        # dP_R/dR = A r'' + B (r/R)'.
        A = mu * (1 + slope**-2) + lam * (1 - np.log(slope * hoop**2)) / slope**2
        B = 2 * lam / (slope * hoop)
        return np.vstack([slope, (2 * (tangential - radial(slope, hoop)) / R - B * (slope - hoop) / R) / A])

    def ends(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.array([radial(a[1], a[0]) + pressure * a[0] ** 2, radial(b[1], b[0] / 2)])

    R = np.linspace(1, 2, 60)
    exact = solve_bvp(equation, ends, R, np.vstack([R + 0.1 / R, np.ones_like(R)]), tol=1e-10, max_nodes=10_000)
    assert exact.success
    boundary = {
        "left": {"roller": ["x"]},
        "front": {"roller": ["y"]},
        "bottom": {"roller": ["z"]},
        "inner": {"pressure": pressure},
    }
    mesh = {"shape": "file", "path": _gmsh(tmp_path / "shell.msh", _octant_of_a_shell)}
    problem = solved(scene(boundary, mesh, {"element": "P2", "steps": 2}))
    X = problem.V.tabulate_dof_coordinates()
    distance = np.linalg.norm(X, axis=1)
    at_wall = np.abs(distance - 1) < 1e-6
    r = np.linalg.norm(X + problem.u.x.array.reshape(-1, 3), axis=1)[at_wall]
    assert exact.sol(1.0)[0] > 1.1
    assert r.mean() == pytest.approx(exact.sol(1.0)[0], rel=2e-3)
    assert np.ptp(r) < 1e-2


# ---------------------------------------------------------------------- Cook's membrane


def _cook(element: str, refine: int) -> float:
    path = Path(__file__).parents[1] / "app" / "studies" / "shipped" / "cook.msh"
    mesh = {"shape": "file", "path": str(path), "refine": refine}
    boundary = {"left": {"fix": True}, "right": {"pull": [0.0, 6.25]}}
    given = {"name": "neo-hookean", "E": 240.565, "nu": 0.4999}
    problem = solved(scene(boundary, mesh, {"element": element, "steps": 2}, given))
    tip = np.linalg.norm(problem.V.tabulate_dof_coordinates() - [48.0, 60.0, 0.0], axis=1).argmin()
    return float(problem.u.x.array.reshape(-1, 2)[tip, 1])


def test_cooks_membrane() -> None:
    """Geometry and load of Simo & Armero 1992, E = 240.565, ν = 0.4999, log neo-Hookean, plane strain.

    Two formulations agree on the tip, the mixed element on a mesh twice as coarse; the displacement element locks
    on the coarse one.
    """
    mixed, fine, locked = _cook("Q2-P1d", 2), _cook("Q3", 3), _cook("Q1", 2)
    assert mixed == pytest.approx(fine, rel=5e-3)
    assert locked < 0.7 * fine
