"""A notebook in the form of a script: the whole Python interface from above to below, on any number of ranks."""

# %% Materials: formulas with their sources
import numpy as np
import ufl
from dolfinx.mesh import CellType, create_box, locate_entities_boundary, meshtags
from mpi4py import MPI

import elastune

catalogue = elastune.materials()
assert catalogue["hencky"].formula.startswith("ψ = μ Σ log²λᵢ")
assert all(entry.source for entry in catalogue.values())

# %% One of them, calibrated and stiffened, at a point
fung = elastune.material("fung", E=1.0, nu=0.45, alpha=1.5)
F = np.eye(3) + 0.1 * np.random.default_rng(1).normal(size=(5, 2, 3, 3))
psi, P, dPdF = fung.psi(F), fung.P(F), fung.dPdF(F)
assert (psi.shape, P.shape, dPdF.shape) == ((5, 2), (5, 2, 3, 3), (5, 2, 3, 3, 3, 3))
assert np.allclose([fung.E, fung.nu], [1.0, 0.45], rtol=1e-12)

# %% A tensile test of it
stretches = np.linspace(0.7, 1.6, 10)
stress, lateral = fung.uniaxial(stretches)
assert (np.diff(stress) > 0).all() and (np.diff(lateral) < 0).all()


# %% A formula of one's own
def gent(
    s, lam: elastune.Modulus = 1.0, mu: elastune.PositiveModulus = 1.0, limit: elastune.Number = 20.0
) -> elastune.Parts:
    """ψ = -μ limit/2 log(1 - (I₁ - 3)/limit) - μ log J + λ/2 (J - 1)²."""
    shear = -mu * limit / 2 * ufl.ln(1 - (s.I1 - 3) / limit) - mu * ufl.ln(s.J)
    return elastune.Parts(shear, lam, (s.J - 1) ** 2 / 2)


rubber = elastune.material(gent, E=2.0, nu=0.4, parameters={"limit": 5.0})
assert "gent" not in elastune.materials()

# %% A shipped scene with other numbers, step by step
scene = elastune.scene("cube-pull", {"mesh.cells": 3, "solve.steps": 3, "material.alpha": 0.5})
run = elastune.solve(scene)
loads, largest = [], []
for record in run:
    loads.append(record.load)
    values = run.fields("von_mises", "stress")
    assert values["stress"].shape == (*values["von_mises"].shape, 3, 3)
    largest.append(run.body.comm.allreduce(values["von_mises"].max(initial=0.0), op=MPI.MAX))
history = run.history
assert run.summary.status == "converged"
assert history["load"].tolist() == loads == [1 / 3, 2 / 3, 1.0]
assert (np.diff(history["energy"]) > 0).all() and (np.diff(largest) > 0).all()
assert np.allclose(history["reaction_left"], -history["reaction_right"], atol=1e-7)
figure = run.plot()
assert figure.axes[0].get_xlabel() == "displacement of the right face"

# %% Each rank a run of its own
alpha = 0.5 + MPI.COMM_WORLD.rank
own = elastune.solve(elastune.scene("cube-pull", {"mesh.cells": 2, "material.alpha": alpha}), comm=MPI.COMM_SELF)
energies = MPI.COMM_WORLD.allgather(own.history["energy"][-1])
assert (np.diff(energies) > 0).all()

# %% A mesh of one's own, with that rubber
mesh = create_box(MPI.COMM_WORLD, [[0.0, 0.0, 0.0], [2.0, 1.0, 1.0]], [4, 2, 2], CellType.hexahedron)
facets = [locate_entities_boundary(mesh, 2, lambda x, end=end: np.isclose(x[0], end)) for end in (0.0, 2.0)]
numbers = np.repeat(np.array([7, 8], dtype=np.int32), [len(end) for end in facets])
both = np.concatenate(facets)
order = np.argsort(both)
tags = meshtags(mesh, 2, both[order], numbers[order])
bar = elastune.Geometry(mesh, tags, {"wall": 7, "tip": 8})

conditions = {"wall": elastune.Clamp(), "tip": elastune.Translation((1.0, 0.0, 0.0))}
pulled = elastune.solve(elastune.body(bar, rubber, conditions), elastune.Options(steps=2)).finish()
assert pulled.summary.status == "converged"
assert pulled.summary.element == "Q2"
stretched = pulled.history["reaction_tip"][-1, 0]
assert 0.95 * rubber.uniaxial(1.5)[0] < stretched < 1.15 * rubber.uniaxial(1.5)[0]
