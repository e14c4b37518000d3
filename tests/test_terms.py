"""Every term of Π: forces are the derivative of its energy, the tangent that of its forces."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from elastune.app.body.body import Body
from elastune.app.body.conditions.loads import BodyForce, Pressure, Pull
from elastune.app.body.conditions.motions import Clamp, Condition, Roller, Translation
from elastune.app.body.conditions.places import Everywhere
from elastune.app.body.regions.solids import Solid, Solids
from elastune.app.body.unknowns import State
from elastune.app.solvers.tangent import Tangent
from elastune.forms.energy import Energy
from elastune.forms.terms import Domain, Fields, Term
from elastune.forms.tuned import tuned_energy
from elastune.geometry import Geometry, build

COMM = MPI.COMM_SELF


def energy(name: str = "stable-neo-hookean", nu: float = 0.3) -> Energy:
    return tuned_energy(name, 1.5, nu, mixed=nu > 0.45)


def cube(cell: str = "hexahedron", cells: int = 2) -> Geometry:
    return build(COMM, "square" if cell in ("triangle", "quadrilateral") else "cube", 1.0, cells, cell)


HELD: dict[Any, Condition] = {"left": Clamp(), "right": Translation((0.1, 0.0, 0.0))}


def spring(fields: Fields, domain: Domain) -> list[Term]:
    """An elastic foundation on the top face, by its energy."""
    return [Term.from_energy("spring", 0.7 / 2 * ufl.inner(fields.u, fields.u) * domain.ds("top"), fields)]


class PointSpring(Term):
    """A spring between two corners of the top, with forces and stiffness that are no forms."""

    def __init__(self, fields: Fields) -> None:
        super().__init__("point_spring")
        self.u, self.k = fields.u, 0.9
        reach = fields.u.function_space.tabulate_dof_coordinates() @ np.array([[1.0, 1.0, 3.0], [-1.0, -1.0, 3.0]]).T
        self.ends = [3 * node + np.arange(3, dtype=np.int32) for node in reach.argmax(axis=0)]

    def _gap(self) -> np.ndarray:
        return self.u.x.array[self.ends[0]] - self.u.x.array[self.ends[1]]

    def own_energy(self) -> float:
        return self.k / 4 * float(self._gap() @ self._gap()) ** 2

    def own_forces(self) -> np.ndarray:
        forces = np.zeros(len(self.u.x.array))
        pull = self.k * float(self._gap() @ self._gap()) * self._gap()
        forces[self.ends[0]], forces[self.ends[1]] = pull, -pull
        return forces

    def own_stiffness(self) -> PETSc.Mat:
        n, gap = len(self.u.x.array), self._gap()
        block = self.k * (float(gap @ gap) * np.eye(3) + 2 * np.outer(gap, gap))
        matrix = PETSc.Mat().createAIJ((n, n), bsize=3, nnz=6, comm=COMM)
        ends = np.concatenate(self.ends).astype(np.int32)
        matrix.setValues(ends, ends, np.kron([[1, -1], [-1, 1]], block))
        matrix.assemble()
        return matrix


def solid(element: str = "Q1", conditions: Any = None, material: Energy | Solids | None = None, **more: Any) -> Body:
    cell = "tetrahedron" if element.startswith("P") else "hexahedron"
    return Body(cube(cell), material or energy(), element, HELD if conditions is None else conditions, **more)


def plane(element: str = "Q2", **more: Any) -> Body:
    return Body(cube("quadrilateral"), energy(), element, {"left": Clamp(), "right": Pull((0.1, 0.2))}, **more)


# A body of each kind, and the term that is looked at.
CASES: dict[str, tuple[Callable[[], Body], str]] = {
    "kernel": (solid, "strain"),
    "kernel on second-order tetrahedra": (lambda: solid("P2"), "strain"),
    "UFL": (lambda: solid("P1", assembly="ufl"), "strain"),
    "extended": (lambda: solid(material={None: Solid(energy("hencky"), 0.25)}), "strain"),
    "stretches": (lambda: solid(material=energy("linear-corotational")), "strain"),
    "plane strain": (plane, "strain"),
    "μ part of a mixed element": (lambda: solid("Q2-P1d", material=energy(nu=0.499)), "strain"),
    "pressures": (lambda: solid("Q2-P1d", material=energy(nu=0.5)), "pressure_field"),
    "continuous pressures": (lambda: solid("P2-P1", material=energy(nu=0.499)), "pressure_field"),
    "pressures of log J": (lambda: solid("Q2-P1d", material=energy("hencky", 0.499)), "pressure_field"),
    "traction": (lambda: solid(conditions={"left": Clamp(), "top": Pull((0.1, 0.2, -0.3))}), "dead_loads"),
    "body force": (lambda: solid(conditions=HELD | {Everywhere(): BodyForce((0.1, 0.2, -0.3))}), "body_force"),
    "plane traction": (plane, "dead_loads"),
    "spring": (lambda: solid(more=spring), "spring"),
    "a pattern of its own": (
        lambda: solid(conditions={"bottom": Clamp()}, more=lambda u, domain: [PointSpring(u)]),
        "point_spring",
    ),
}
EDGES_HELD: dict[Any, Condition] = {face: Clamp() for face in ("left", "right", "front", "back")}
SLIDING: dict[str, Condition] = {"left": Roller((0,)), "right": Roller((0,)), "front": Roller((1,)), "back": Clamp()}
CORNER: dict[str, Condition] = {"left": Roller((0,)), "front": Roller((1,)), "bottom": Roller((2,))}
ALL = ("left", "right", "front", "back", "bottom", "top")


def pressed(conditions: dict[str, Condition], faces: Sequence[str], element: str = "Q2") -> Body:
    return solid(element, conditions | {face: Pressure(0.8) for face in faces}, free=not conditions)


# Whether the pressure has a potential.
PRESSED: dict[str, tuple[Callable[[], Body], bool]] = {
    "edges clamped": (lambda: pressed(EDGES_HELD, ["top"]), True),
    "edges slide": (lambda: pressed(SLIDING, ["top"]), True),
    "closed by planes": (lambda: pressed(CORNER, ["right", "back", "top"], "P2"), True),
    "closed": (lambda: pressed({}, ALL, "Q1"), True),
    "one free edge": (lambda: pressed(EDGES_HELD | {"right": Pull((0.0, 0.0, 0.0))}, ["top"]), False),
    "free edges": (lambda: pressed({"bottom": Clamp()}, ["top"]), False),
    "two faces of one edge": (lambda: pressed({"left": Clamp(), "bottom": Clamp()}, ["top", "right"]), False),
}
CASES |= {f"pressure, {name}": (body, "follower_pressure") for name, (body, _) in PRESSED.items()}


class Alone:
    """One term of a body: what it adds at a state."""

    def __init__(self, body: Body, name: str) -> None:
        self.body = body
        # The pattern is that of all terms together.
        self.tangent = Tangent(body)
        self.tangent.assemble(body.state)
        (self.term,) = (term for term in body.terms if term.name == name)
        body.assembly.terms = body.terms = [self.term]
        body.assembly.forget()
        self.free = ~body.held

    def energy(self, x: np.ndarray) -> float:
        return self.body.assembly.energy(State(x.copy(), 0.7))

    def forces(self, x: np.ndarray) -> np.ndarray:
        return self.body.assembly.residual(State(x.copy(), 0.7))

    def product(self, x: np.ndarray, d: np.ndarray) -> np.ndarray:
        """The tangent times a direction that is zero where the body is held."""
        self.tangent.assemble(State(x.copy(), 0.7))
        into = self.tangent.vector()
        self.tangent.matrix.mult(self.tangent.vector(d), into)
        return np.where(self.free, into.array_r, 0.0)


def states(body: Body, count: int = 2) -> list[np.ndarray]:
    """Vectors without order, the first a small displacement from rest."""
    rng = np.random.default_rng(5)
    x, *rest = (np.where(body.held, 0.0, rng.normal(size=body.size)) for _ in range(count))
    return [0.03 * x, *rest]


@pytest.mark.parametrize("name", CASES)
def test_forces_and_tangent_are_derivatives(name: str) -> None:
    make, term = CASES[name]
    body = make()
    x, d = states(body)
    alone, step = Alone(body, term), 1e-5
    forces = alone.forces(x)
    if alone.term.conservative:
        slope = (alone.energy(x + step * d) - alone.energy(x - step * d)) / (2 * step)
        assert slope == pytest.approx(float(forces[alone.free] @ d[alone.free]), rel=1e-6)
    difference = (alone.forces(x + step * d) - alone.forces(x - step * d)) / (2 * step)
    expected = np.where(alone.free, difference, 0.0)
    if alone.term.linear:
        assert np.abs(expected).max() < 1e-12
        assert alone.term.tangent == {}
        return
    assert np.abs(alone.product(x, d) - expected).max() < 1e-6 * np.abs(expected).max()


@pytest.mark.parametrize("name", PRESSED)
def test_pressure_has_a_potential_where_its_edges_are_held(name: str) -> None:
    """Then its tangent is symmetric on what is free, and so are minimisation and inertia allowed."""
    make, expected = PRESSED[name]
    body = make()
    assert body.conservative == expected
    x, d, e = states(body, 3)
    alone = Alone(body, "follower_pressure")
    one, two = (float(a @ alone.product(x, b)) for a, b in ((d, e), (e, d)))
    asymmetry = abs(one - two) / np.abs(alone.product(x, d)).max()
    assert (asymmetry < 1e-10) == expected


def test_energy_of_a_pressure_is_that_of_the_enclosed_volume() -> None:
    """All around a body: the pressure times its change of volume, by the quadrature of J."""
    body = pressed({}, ALL, "Q1")
    (x, _) = states(body)
    state = State(x, 0.5)
    work = body.assembly.energies(state)["follower_pressure"]
    body.take(state)
    assert work == pytest.approx(0.5 * 0.8 * (body.volume.ratio() - 1), rel=1e-12)


def test_a_hole_under_pressure_is_closed(tmp_path: Path) -> None:
    """A cavity inside a block: no edge at all."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        occ.cut([(3, occ.addBox(0, 0, 0, 1, 1, 1))], [(3, occ.addSphere(0.5, 0.5, 0.5, 0.25))])
        occ.synchronize()
        inner = [tag for _, tag in gmsh.model.getEntities(2) if gmsh.model.getType(2, tag) == "Sphere"]
        low = gmsh.model.getEntitiesInBoundingBox(-1e-3, -1, -1, 1e-3, 2, 2, 2)
        gmsh.model.addPhysicalGroup(2, inner, name="hole")
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in low], name="wall")
        gmsh.model.addPhysicalGroup(3, [1], name="body")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.4)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(tmp_path / "hole.msh"))
    finally:
        gmsh.finalize()
    geometry = build(COMM, "file", path=str(tmp_path / "hole.msh"))
    body = Body(geometry, energy(), "P1", {"wall": Clamp(), "hole": Pressure(0.3)})
    assert body.conservative
    area = fem.assemble_scalar(fem.form(fem.Constant(geometry.mesh, 1.0) * ufl.Measure("ds", geometry.mesh)))
    assert area > 6


def test_linear_terms_are_assembled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[Any] = []
    assemble = fem.assemble_vector

    def counted(b: Any, form: Any) -> Any:
        calls.append(form)
        return assemble(b, form)

    monkeypatch.setattr("elastune.app.body.assembly.fem.assemble_vector", counted)
    # They are looked at when the body is made: an expression may be no number somewhere.
    body = solid(conditions={"left": Clamp(), "top": Pull((0.1, 0.2, -0.3))})
    (loads,) = (term for term in body.terms if term.linear)
    for k in range(4):
        state = State(0.01 * k * np.ones(body.size), k / 4)
        for _ in range(2):
            body.assembly.energy(state), body.assembly.residual(state)
    assert sum(form is loads.residual["u"] for form in calls) == 1
    # And what is known of a state is not asked for again.
    assert sum(form is body.parts[0].strain.residual["u"] for form in calls) == 4
