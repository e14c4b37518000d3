"""The assembled forms against UFL's, on every cell, straight and curved, in three dimensions and plane strain."""

import subprocess
import sys
from typing import Any

import basix
import numpy as np
import precise
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from elastune.forms import materials
from elastune.forms.energy import CATALOGUE, Energy
from elastune.forms.kinematics import GradientMeasures, deformation_gradient
from elastune.forms.normalize import linearize
from elastune.forms.spectral import SpectralError, SpectralForms, fastest
from elastune.forms.tuning import with_nonlinearity

# Speed is not what the reference is for.
QUICK = {"cffi_extra_compile_args": ["-O0", "-g0"]}
SOLIDS = {
    "P1 tet": ("tetrahedron", 1),
    "P2 tet": ("tetrahedron", 2),
    "Q1 hex": ("hexahedron", 1),
    "Q2 hex": ("hexahedron", 2),
}
PLANES = {
    "P1 triangle": ("triangle", 1),
    "P2 triangle": ("triangle", 2),
    "Q1 quadrilateral": ("quadrilateral", 1),
    "Q2 quadrilateral": ("quadrilateral", 2),
}


def one_cell(cell: str, geometry: int = 1, bent: float = 0.0) -> mesh.Mesh:
    """A single cell with its vertices moved at random, and of the nodes of a curved one all."""
    kind = getattr(basix.CellType, cell)
    nodes = basix.create_element(basix.ElementFamily.P, kind, geometry, basix.LagrangeVariant.gll_warped).points
    moved = nodes + bent * np.random.default_rng(4).uniform(-0.1, 0.1, nodes.shape)
    element = basix.ufl.element("Lagrange", cell, geometry, shape=(nodes.shape[1],))
    return mesh.create_mesh(MPI.COMM_SELF, np.arange(len(nodes))[None], x=moved, e=element)


def deformed(domain: mesh.Mesh, order: int, size: float = 0.15) -> fem.Function:
    """A generic displacement."""
    u = fem.Function(fem.functionspace(domain, ("Lagrange", order, (domain.geometry.dim,))))
    u.x.array[:] = np.random.default_rng(5).uniform(-size, size, u.x.array.size)
    return u


def assembled(forms: Any) -> tuple[float, np.ndarray, np.ndarray]:
    """Energy, residual vector and dense tangent of three compiled forms."""
    energy, residual, tangent = forms
    return (
        fem.assemble_scalar(energy),
        fem.assemble_vector(residual).array,
        fem.assemble_matrix(tangent).to_dense(),
    )


def spectral(forms: SpectralForms) -> tuple[float, np.ndarray, np.ndarray]:
    """The same of spectral forms."""
    return assembled((forms.energy, forms.residual, forms.tangent))


def by_ufl(energy: Energy, u: fem.Function, degree: int) -> tuple[float, np.ndarray, np.ndarray]:
    """The same by UFL's derivatives in u."""
    constants = fem.Constant(u.function_space.mesh, np.array(energy.constants()))
    values = energy.unpack([constants[i] for i in range(len(constants.value))])
    psi = energy.density(GradientMeasures(deformation_gradient(u)), values)
    potential = psi * ufl.dx(metadata={"quadrature_degree": degree})
    residual = ufl.derivative(potential, u)
    return assembled([fem.form(f, jit_options=QUICK) for f in (potential, residual, ufl.derivative(residual, u))])


def by_points(energy: Energy, u: fem.Function, degree: int) -> tuple[float, np.ndarray, np.ndarray]:
    """The same by UFL forms in which ψ, P and ∂P/∂F are fields with their 50-digit values at quadrature points."""
    domain = u.function_space.mesh
    cell = domain.basix_cell()
    points, _ = basix.make_quadrature(getattr(basix.CellType, cell.name), degree)
    expression = fem.Expression(ufl.grad(u), points)
    cells = np.arange(domain.topology.index_map(domain.topology.dim).size_local, dtype=np.int32)
    evaluated = expression.eval(domain, cells)
    fields = []
    for shape in ((), (3, 3), (9, 9)):
        element = basix.ufl.quadrature_element(cell.name, value_shape=shape, degree=degree)
        fields.append(fem.Function(fem.functionspace(domain, element)))
    values = [precise.response(energy, H) for H in evaluated.reshape(-1, 3, 3)]
    for field, column in zip(fields, zip(*values, strict=True), strict=True):
        field.x.array[:] = np.array([np.ravel(entry) for entry in column], dtype=np.float64).ravel()
    psi, P, D = fields
    dx = ufl.dx(metadata={"quadrature_degree": degree})
    v, w = ufl.TestFunction(u.function_space), ufl.TrialFunction(u.function_space)
    flat = [ufl.as_vector([ufl.grad(f)[i, j] for i in range(3) for j in range(3)]) for f in (v, w)]
    forms = (psi * dx, ufl.inner(P, ufl.grad(v)) * dx, ufl.dot(flat[0], ufl.dot(D, flat[1])) * dx)
    return assembled([fem.form(form, jit_options=QUICK) for form in forms])


def check(found: Any, expected: Any, tolerance: float = 1e-11) -> None:
    """Equal relative to the largest entry."""
    for a, b in zip(found, expected, strict=True):
        assert np.abs(a - b).max() <= tolerance * np.abs(b).max()


@pytest.mark.parametrize("name", CATALOGUE)
def test_every_material_equals_its_ufl_forms(name: str) -> None:
    """On an 8-node hexahedron, through UFL's derivatives of the whole form."""
    u = deformed(one_cell("hexahedron", bent=1), 1)
    forms = SpectralForms(materials.make(name), u)
    check(spectral(forms), by_ufl(materials.make(name), u, forms.quadrature_degree))


@pytest.mark.parametrize("name", CATALOGUE)
@pytest.mark.parametrize("element", SOLIDS)
def test_every_material_on_every_solid(element: str, name: str) -> None:
    """Through UFL forms of what the material says at the quadrature points."""
    cell, order = SOLIDS[element]
    u = deformed(one_cell(cell, bent=1), order, 0.05 if order == 2 else 0.15)
    # Eight points are enough to tell one material from another on the 27-node hexahedron.
    degree = 2 if element == "Q2 hex" else None
    forms = SpectralForms(materials.make(name), u, degree)
    check(spectral(forms), by_points(materials.make(name), u, forms.quadrature_degree))


ELEMENTS = {**SOLIDS, **PLANES, "P3 tet": ("tetrahedron", 3), "Q3 quadrilateral": ("quadrilateral", 3)}


@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("name", ["stable-neo-hookean", "neo-hookean"])
def test_every_element_equals_ufl(element: str, name: str) -> None:
    """UFL's derivatives of the whole form on each cell; plane strain in two dimensions."""
    cell, order = ELEMENTS[element]
    u = deformed(one_cell(cell, bent=1), order, 0.1 / order**2)
    forms = SpectralForms(materials.make(name), u)
    check(spectral(forms), by_ufl(materials.make(name), u, forms.quadrature_degree))


@pytest.mark.parametrize("name", ["linear-corotational", "linear-elasticity", "hencky"])
def test_plane_strain(name: str) -> None:
    """Stretches of plane strain, the third of which stays one."""
    u = deformed(one_cell("quadrilateral", bent=1), 1)
    forms = SpectralForms(materials.make(name), u)
    check(spectral(forms), by_ufl(materials.make(name), u, forms.quadrature_degree))


@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron", "triangle"])
def test_curved_cells(cell: str) -> None:
    """Geometry of second order with every node moved."""
    u = deformed(one_cell(cell, 2, bent=0.7), 2, 0.03)
    forms = SpectralForms(materials.make("stable-neo-hookean"), u, quadrature_degree=4)
    check(spectral(forms), by_ufl(materials.make("stable-neo-hookean"), u, 4))


def box() -> mesh.Mesh:
    """Some cells."""
    return mesh.create_unit_cube(MPI.COMM_SELF, 2, 3, 2, mesh.CellType.hexahedron)


@pytest.mark.parametrize("name", CATALOGUE)
def test_stiffness_at_rest(name: str) -> None:
    """The assembled tangent at u = 0 is that of linear elasticity."""
    energy = materials.make(name)
    at_rest = linearize(energy)
    linear = materials.make("linear-elasticity", lam=at_rest.lame_lambda, mu=at_rest.lame_mu)
    u = deformed(box(), 1, 0.0)
    expected = fem.assemble_matrix(SpectralForms(linear, u).tangent).data
    found = fem.assemble_matrix(SpectralForms(energy, u).tangent).data
    assert np.abs(found - expected).max() <= 1e-13 * np.abs(expected).max()


@pytest.mark.parametrize("name", ["stable-neo-hookean", "hencky", "mooney-rivlin"])
def test_residual_has_no_noise_floor(name: str) -> None:
    """At a displacement of 1e-11 the residual is that of linear elasticity to 1e-10."""
    energy, size = materials.make(name), 1e-11
    u = deformed(box(), 1, 1.0)
    at_rest = linearize(energy)
    linear = SpectralForms(materials.make("linear-elasticity", lam=at_rest.lame_lambda, mu=at_rest.lame_mu), u)
    expected, work = fem.assemble_vector(linear.residual).array, fem.assemble_scalar(linear.energy)
    u.x.array[:] *= size
    forms = SpectralForms(energy, u)
    assert np.abs(fem.assemble_vector(forms.residual).array / size - expected).max() <= 1e-10 * np.abs(expected).max()
    assert abs(fem.assemble_scalar(forms.energy) / size**2 - work) <= 1e-10 * work


@pytest.mark.parametrize("name", [name for name in CATALOGUE if name != "linear-elasticity"])
def test_rigid_motion(name: str) -> None:
    """A rotation by 1 radian with a shift stores nothing and pulls at nothing."""
    u = deformed(box(), 1, 0.0)
    c, s = np.cos(1.0), np.sin(1.0)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    u.interpolate(lambda x: R @ x - x + np.array([[3.0], [-1.0], [2.0]]))
    forms = SpectralForms(materials.make(name), u)
    assert abs(fem.assemble_scalar(forms.energy)) <= 1e-28
    assert np.abs(fem.assemble_vector(forms.residual).array).max() <= 1e-14
    # Turning further costs nothing either.
    spin = fem.Function(u.function_space)
    spin.interpolate(lambda x: np.array([[0, -1, 0], [1, 0, 0], [0, 0, 0]]) @ R @ x)
    A = fem.assemble_matrix(forms.tangent).to_dense()
    assert np.abs(A @ spin.x.array).max() <= 1e-13 * np.abs(A).max()


def test_objectivity() -> None:
    """Turning a deformed body changes no energy and turns its forces."""
    R = np.linalg.qr(np.random.default_rng(6).normal(size=(3, 3)))[0]
    R *= np.linalg.det(R)
    u = deformed(box(), 1, 0.1)
    forms = SpectralForms(materials.make("linear-corotational"), u)
    energy, forces, _ = spectral(forms)
    x = u.function_space.tabulate_dof_coordinates()
    u.x.array[:] = ((x + u.x.array.reshape(-1, 3)) @ R.T - x).ravel()
    turned, turned_forces, _ = spectral(forms)
    assert abs(turned - energy) <= 1e-13 * energy
    assert np.abs(turned_forces.reshape(-1, 3) - forces.reshape(-1, 3) @ R.T).max() <= 1e-13 * np.abs(forces).max()


@pytest.mark.parametrize("element", SOLIDS | PLANES)
def test_tangent_is_symmetric(element: str) -> None:
    """To rounding, also where it is inverted and filtered."""
    cell, order = (SOLIDS | PLANES)[element]
    u = deformed(one_cell(cell, bent=1), order, 1.0)
    forms = SpectralForms(materials.make("stable-neo-hookean"), u)
    for name in ("none", "clamp", "absolute"):
        forms.filter = name
        A = fem.assemble_matrix(forms.tangent).to_dense()
        assert np.abs(A - A.T).max() <= 1e-14 * np.abs(A).max()
        if name != "none":
            assert np.linalg.eigvalsh(A)[0] >= -1e-12 * np.abs(A).max()


def test_constants_and_filter_change_at_run_time() -> None:
    """New parameters, an exponent among them, and another filter, with the forms that there are."""
    u = deformed(one_cell("hexahedron"), 1, 0.3)
    soft = with_nonlinearity(materials.make("stable-neo-hookean", lam=2.0, mu=1.0), 0.8)
    stiff = with_nonlinearity(materials.make("stable-neo-hookean", lam=50.0, mu=3.0), 1.7)
    forms = SpectralForms(soft, u)
    before = spectral(forms)
    forms.constants.value = stiff.constants()
    check(spectral(forms), spectral(SpectralForms(stiff, u)), 1e-15)
    forms.constants.value = soft.constants()
    check(spectral(forms), before, 1e-15)
    assert forms.filter == "none"


def test_extension_of_an_inverted_mesh() -> None:
    """Finite energy, and a residual that is its derivative."""
    u = deformed(box(), 1, 1.0)
    forms = SpectralForms(materials.make("neo-hookean"), u, extension=0.25)
    energy, residual, _ = spectral(forms)
    assert np.isfinite(energy) and np.isfinite(residual).all()
    assert not np.isfinite(fem.assemble_scalar(SpectralForms(materials.make("neo-hookean"), u).energy))
    start, direction, step = u.x.array.copy(), np.random.default_rng(7).normal(size=u.x.array.size), 1e-6
    ends = []
    for sign in (1, -1):
        u.x.array[:] = start + sign * step * direction
        ends.append(fem.assemble_scalar(forms.energy))
    assert abs((ends[0] - ends[1]) / (2 * step) - residual @ direction) <= 1e-6 * np.abs(residual).max()
    u.x.array[:] = start
    forms.extension = 0.5
    assert forms.extension == 0.5 and fem.assemble_scalar(forms.energy) != energy


def test_default_quadrature() -> None:
    """Full integration on tensor cells, 2(k - 1) on simplices."""
    degrees = {}
    for element, (cell, order) in (SOLIDS | PLANES).items():
        forms = SpectralForms(materials.make("arap"), deformed(one_cell(cell), order))
        degrees[element] = forms.quadrature_degree
    assert list(degrees.values()) == [1, 2, 2, 4, 1, 2, 2, 4]


RANKS = """
from mpi4py import MPI
import numpy as np
from dolfinx import fem, la, mesh
from elastune.forms import materials
from elastune.forms.spectral import SpectralForms
domain = mesh.create_unit_cube(MPI.COMM_WORLD, 4, 4, 4, mesh.CellType.hexahedron)
u = fem.Function(fem.functionspace(domain, ("Lagrange", 1, (3,))))
u.interpolate(lambda x: np.array([0.2 * x[1] ** 2, 0.1 * np.sin(3 * x[2]), 0.3 * x[0] * x[1]]))
forms = SpectralForms(materials.make("valanis-landel"), u)
energy = domain.comm.allreduce(fem.assemble_scalar(forms.energy))
b = fem.assemble_vector(forms.residual)
b.scatter_reverse(la.InsertMode.add)
squared = domain.comm.allreduce(float(np.sum(b.array[: 3 * u.function_space.dofmap.index_map.size_local] ** 2)))
A = fem.assemble_matrix(forms.tangent)
A.scatter_reverse()
size = A.squared_norm()
if domain.comm.rank == 0:
    print(repr(energy), repr(squared), repr(size))
"""


def test_ranks_agree() -> None:
    """Energy, residual and tangent of one and of two ranks, which compile once."""
    runs = []
    for ranks in (1, 2):
        command = ["mpirun", "-n", str(ranks), sys.executable, "-c", RANKS]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
        assert done.returncode == 0, done.stderr
        runs.append([float(word) for word in done.stdout.split()])
    assert np.allclose(runs[0], runs[1], rtol=1e-13, atol=0)


def _space(cell: str, family: str, order: int, components: int) -> fem.Function:
    return fem.Function(fem.functionspace(one_cell(cell), (family, order, (components,))))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("interval", "Lagrange", 1, 1), "expected triangle"),
        (("tetrahedron", "Lagrange", 1, 2), "3 components"),
        (("triangle", "Lagrange", 1, 3), "2 components"),
        (("tetrahedron", "DG", 1, 3), "continuous Lagrange"),
    ],
)
def test_refused_spaces(arguments: tuple[str, str, int, int], message: str) -> None:
    """Cells, families and numbers of components that no kernel is made for."""
    with pytest.raises(SpectralError, match=message):
        SpectralForms(materials.make("arap"), _space(*arguments))


def test_refused_settings() -> None:
    """A filter, a threshold, and an extension of what has no stretches."""
    u = deformed(one_cell("tetrahedron"), 1)
    with pytest.raises(SpectralError, match="none, clamp, absolute"):
        SpectralForms(materials.make("arap"), u).filter = "abs"
    with pytest.raises(SpectralError, match="above 0"):
        SpectralForms(materials.make("hencky"), u, extension=-1.0)
    with pytest.raises(SpectralError, match="no function of stretches"):
        SpectralForms(materials.make("linear-elasticity"), u, extension=0.25)
    with pytest.raises(SpectralError, match="when the forms are made"):
        SpectralForms(materials.make("hencky"), u).extension = 0.25


def test_fastest() -> None:
    """UFL where invariants serve, but for tangents; the kernel for stretches, on hexahedra and for an extension."""
    tet, hexahedron, triangle = (deformed(one_cell(cell), 1) for cell in ("tetrahedron", "hexahedron", "triangle"))
    stable, corotational = materials.make("stable-neo-hookean"), materials.make("linear-corotational")
    for u in (tet, triangle):
        assert fastest(stable, u) == {"energy": "ufl", "residual": "ufl", "tangent": "spectral"}
    for spectral_only in (fastest(stable, hexahedron), fastest(corotational, tet), fastest(stable, tet, True)):
        assert set(spectral_only.values()) == {"spectral"}
