"""Forces out of balance, computed again by code that the solver does not use."""

import basix
import numpy as np
import ufl
from dolfinx import fem, la
from numpy.typing import NDArray

from elastune.app.body.body import Array, Body
from elastune.app.body.regions.parts import Part
from elastune.forms.energy import Energy
from elastune.forms.evaluation import as_numpy
from elastune.forms.kinematics import GradientMeasures, PrincipalStretches, deformation_gradient
from elastune.forms.spectral.choice import needs_eigenvalues


def out_of_balance(body: Body) -> float:
    """Norm of the residual at the body's state, without loads, over what is not prescribed.

    UFL's own derivative of ψ(F), or where ψ needs eigenvalues, whose closed form UFL cannot differentiate at
    repeated stretches, the singular values of F in numpy.
    """
    forces = np.sum([_forces(body, part) for part in body.parts], axis=0)
    return body.layout.norm(np.where(body.held, 0.0, body.layout.joined(forces)))


def _forces(body: Body, part: Part) -> Array:
    return _by_singular_values(body, part) if needs_eigenvalues(part.energy, body.u) else _by_ufl(body, part)


def _by_ufl(body: Body, part: Part) -> Array:
    mesh, metadata = body.geometry.mesh, {"quadrature_degree": body.quadrature}
    constants = fem.Constant(mesh, np.array(part.energy.constants()))
    named = part.energy.unpack([constants[i] for i in range(len(constants.value))])
    psi = part.energy.density(GradientMeasures(deformation_gradient(body.u)), named)
    energy = psi * ufl.Measure("dx", mesh, subdomain_data=[(1, _cells(body, part))], metadata=metadata)(1)
    b = fem.assemble_vector(fem.form(ufl.derivative(energy, body.u, ufl.TestFunction(body.V))))
    b.scatter_reverse(la.InsertMode.add)
    return b.array


def _cells(body: Body, part: Part) -> NDArray[np.int32]:
    return body.quadrature_points.owned if part.cells is None else part.cells


def _by_singular_values(body: Body, part: Part) -> Array:
    """∫P : ∂v/∂X dX with P = U diag(∂ψ/∂λ) Vᵀ, node by node."""
    mesh, V, d = body.geometry.mesh, body.V, body.dimension
    points, weights = basix.make_quadrature(mesh.basix_cell(), body.quadrature)
    cells = _cells(body, part)
    nodes = mesh.geometry.x[mesh.geometry.dofmap[cells]][:, :, :d]
    jacobian = np.einsum("cgi,kqg->cqik", nodes, _slopes(mesh.basix_cell(), mesh.geometry.cmap.degree, points))
    volumes = np.abs(np.linalg.det(jacobian)) * weights
    degree = V.element.basix_element.degree
    slopes = np.einsum("kqa,cqkj->cqaj", _slopes(mesh.basix_cell(), degree, points), np.linalg.inv(jacobian))
    dofs = V.dofmap.list[cells]
    displacements = body.u.x.array.reshape(-1, d)[dofs]
    H = np.zeros((*volumes.shape, 3, 3))
    H[..., :d, :d] = np.einsum("cai,cqaj->cqij", displacements, slopes)
    P = _first_piola_kirchhoff(part.energy, np.eye(3) + H)[..., :d, :d]
    forces = la.vector(V.dofmap.index_map, V.dofmap.index_map_bs)
    forces.array[:] = 0.0
    np.add.at(forces.array.reshape(-1, d), dofs, np.einsum("cqij,cqaj,cq->cai", P, slopes, volumes))
    forces.scatter_reverse(la.InsertMode.add)
    return forces.array


def _slopes(cell: basix.CellType, degree: int, points: Array) -> Array:
    """Gradients of the Lagrange basis on the reference cell, shape (d, points, nodes)."""
    family, variant = basix.ElementFamily.P, basix.LagrangeVariant.gll_warped
    return basix.create_element(family, cell, degree, variant).tabulate(1, points)[1:, :, :, 0]


def _first_piola_kirchhoff(energy: Energy, F: Array) -> Array:
    """P of an isotropic energy, shape of F, (..., 3, 3); the smallest stretch carries the sign of J."""
    U, stretches, Vt = np.linalg.svd(F)
    sign = np.sign(np.linalg.det(F))
    stretches[..., 2] *= sign
    U[..., :, 2] *= sign[..., None]
    s = [ufl.variable(ufl.as_ufl(1.0)) for _ in range(3)]
    constants = [ufl.as_ufl(float(value)) for value in energy.constants()]
    psi = ufl.as_ufl(energy.density(PrincipalStretches(s), energy.unpack(constants)))
    slopes = as_numpy([ufl.diff(psi, x) for x in s], s)(*np.moveaxis(stretches, -1, 0))
    p = np.stack([np.broadcast_to(slope, stretches.shape[:-1]) for slope in slopes], axis=-1)
    return (U * p[..., None, :]) @ Vt
