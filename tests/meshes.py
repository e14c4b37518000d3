"""What tests measure on meshes."""

import basix
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from elastune.geometry import Geometry

COMM = MPI.COMM_WORLD


def area(g: Geometry, name: str) -> float:
    """Area of a named face, length in 2D; one form for all faces, so that it is compiled once."""
    ds = ufl.Measure("ds", domain=g.mesh, subdomain_data=[(1, integration_entities(g, name))])
    form = fem.form(fem.Constant(g.mesh, 1.0) * ds(1))
    return float(COMM.allreduce(fem.assemble_scalar(form), op=MPI.SUM))


def degree(g: Geometry) -> int:
    """Order of the cells."""
    return int(g.mesh.ufl_domain().ufl_coordinate_element().basix_element.degree)


def integration_entities(g: Geometry, name: str) -> np.ndarray:
    """Pairs (cell, local facet) of a face."""
    topology = g.mesh.topology
    tdim = topology.dim
    topology.create_connectivity(tdim, tdim - 1)
    to_cells, to_facets = topology.connectivity(tdim - 1, tdim), topology.connectivity(tdim, tdim - 1)
    pairs = [(cell, facet) for facet in g.facets(name) for cell in to_cells.links(facet)]
    local = [(cell, int(np.flatnonzero(to_facets.links(cell) == facet)[0])) for cell, facet in pairs]
    return np.array(local, dtype=np.int32).reshape(-1)


def jacobians(g: Geometry) -> np.ndarray:
    """Determinants of the cells' maps on a lattice with the corners, shape (cells, points)."""
    element = g.mesh.ufl_domain().ufl_coordinate_element().basix_element
    tdim = g.mesh.topology.dim
    points = basix.create_lattice(element.cell_type, 4, basix.LatticeType.equispaced, True)
    gradients = element.tabulate(1, points)[1:, :, :, 0]
    x = g.mesh.geometry.x[:, :tdim][g.mesh.geometry.dofmap]
    return np.linalg.det(np.einsum("cni,jpn->cpij", x, gradients))
