"""Why a run stopped: what the state looks like where the last attempt ended, and what to try next."""

from typing import Any

import basix
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from elastune.app.body.body import Array, Problem
from elastune.forms.elements import ELEMENTS
from elastune.forms.normalize import linearize
from elastune.forms.spectral import pointwise

# Points whose tangent is examined on each rank: those of least volume and largest stretch.
EXAMINED = 500

# Shapes that a body can run away along, as exponents of one stretch t.
_RAYS = np.array([[1, 1, 1], [1, 0, 0], [1, 1, 0], [1, -1, 0], [1, -0.5, -0.5], [1, 1, -2]])


def diagnose(problem: Problem, values: Array | None, kind: str) -> dict[str, Any]:
    """What a person needs to know about a failure; collective.

    Args:
        problem: Its state is left as it is.
        values: Where the last attempt stopped; the problem's state if None.
        kind: Of the failure, see `NotConverged`.

    Returns:
        `inverted_cells` and the `worst_cells` with their places at rest, ranges of `J` and of the principal
        `stretches`, `residual` with its norm and the place of the largest force out of balance, `energy`,
        whether it is `unbounded_below`, the least eigenvalue of the acoustic tensor relative to μ
        (`ellipticity`, lost where negative), why `locking` is likely or None, and `advice`.
    """
    kept = problem.state
    problem.set_state(kept if values is None else values)
    try:
        found = _shape(problem) | {
            "residual": _residual(problem),
            "energy": problem.energy_at(problem.state),
            "unbounded_below": _unbounded(problem),
            "locking": _locking(problem),
        }
    finally:
        problem.set_state(kept)
    return found | {"advice": _advice(problem, kind, found)}


def _shape(problem: Problem) -> dict[str, Any]:
    """Volume ratios and stretches at the quadrature points, and where the material is not elliptic."""
    mesh, d, comm = problem.geometry.mesh, problem.dimension, problem.comm
    points, _ = basix.make_quadrature(mesh.basix_cell(), problem.quadrature)
    gradient = fem.Expression(ufl.grad(problem.u), points)
    cells = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local, dtype=np.int32)
    H = np.zeros((len(cells) * len(points), 3, 3))
    H[:, :d, :d] = np.asarray(gradient.eval(mesh, cells)).reshape(-1, d, d)
    finite = np.asarray(np.isfinite(H).all(axis=(1, 2)))
    F = np.where(finite[:, None, None], np.eye(3) + H, np.eye(3))
    J = np.where(finite, np.linalg.det(F), np.nan)
    stretches = np.linalg.svd(F, compute_uv=False)
    least = J.reshape(len(cells), len(points)).min(axis=1) if len(cells) else np.empty(0)
    centers = mesh.geometry.x[mesh.geometry.dofmap[cells]].mean(axis=1) if len(cells) else np.empty((0, 3))
    worst = [(float(least[i]), centers[i].tolist()) for i in np.argsort(least)[:5]]
    worst = sorted(entry for entries in comm.allgather(worst) for entry in entries)[:5]
    extremes = np.union1d(np.argsort(J)[:EXAMINED], np.argsort(-stretches[:, 0])[:EXAMINED])
    return {
        "inverted_cells": comm.allreduce(int(np.sum(least <= 0))),
        "worst_cells": [{"J": value, "center": center} for value, center in worst],
        "J": _range(problem, J),
        "stretches": _range(problem, stretches),
        "ellipticity": comm.allreduce(_ellipticity(problem, H[extremes[finite[extremes]]]), op=MPI.MIN),
    }


def _range(problem: Problem, values: Array) -> list[float]:
    low = problem.comm.allreduce(float(values.min(initial=np.inf)), op=MPI.MIN)
    return [low, problem.comm.allreduce(float(values.max(initial=-np.inf)), op=MPI.MAX)]


def _ellipticity(problem: Problem, H: Array) -> float:
    """Least eigenvalue of the acoustic tensor n·∂P/∂F·n over directions n and points, relative to μ.

    Args:
        problem: Gives the energy.
        H: Displacement gradients, shape (n, 3, 3).
    """
    energy = problem.energy
    if not energy.objective or not len(H):
        return np.inf
    with np.errstate(all="ignore"):
        tangent = pointwise(energy, H, problem.scene.material.extension)[2].reshape(-1, 3, 3, 3, 3)
    tangent = tangent[np.asarray(np.isfinite(tangent).all(axis=(1, 2, 3, 4)))]
    # Fibonacci's points on the half sphere.
    k = np.arange(60)
    z, angle = (k + 0.5) / 60, k * np.pi * (3 - np.sqrt(5))
    n = np.column_stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z])
    acoustic = np.einsum("piJkL,dJ,dL->pdik", tangent, n, n, optimize=True)
    return float(np.linalg.eigvalsh(acoustic).min(initial=np.inf) / linearize(energy).lame_mu)


def _residual(problem: Problem) -> dict[str, Any]:
    """Norm of the forces out of balance, and where the largest of them is."""
    residual = problem.residual_at(problem.state)
    residual[problem.held] = 0.0
    d, own = problem.dimension, problem.owned_displacements
    forces = np.linalg.norm(residual[:own].reshape(-1, d), axis=1)
    place = int(np.argmax(forces)) if len(forces) else None
    points = problem.V.tabulate_dof_coordinates()
    largest = (0.0, [0.0] * 3) if place is None else (float(forces[place]), points[place].tolist())
    force, at = max(problem.comm.allgather(largest))
    return {"norm": problem.norm(residual), "largest_force": force, "at": at}


def _unbounded(problem: Problem) -> bool:
    """Whether the body can lower its energy without end: by itself, or slower than a dead load does work."""
    energy, scene = problem.energy, problem.scene
    if not energy.objective:
        return False
    far = np.array([1e-4, 1e-3, 1e3, 1e4])
    diagonals = (far[:, None, None] ** _RAYS).reshape(-1, 3)
    H = np.einsum("ni,ij->nij", diagonals - 1, np.eye(3))
    with np.errstate(all="ignore"):
        psi = np.nan_to_num(pointwise(energy, H, scene.material.extension)[0], nan=np.inf) / linearize(energy).lame_mu
    if psi.min() < -1e2:
        return True
    pulled = scene.body is not None or any(condition.kind == "pull" for condition in scene.boundary.values())
    return pulled and bool((psi / diagonals.max(axis=1))[diagonals.max(axis=1) >= 1e4].min() < 1e-2)


def _locking(problem: Problem) -> str | None:
    at_rest, element = linearize(problem.energy), ELEMENTS[problem.element]
    nu = at_rest.poissons_ratio
    limit = 0.45 if problem.element == "P1" else 0.495
    if element.degree > 1 or nu < limit:
        return None
    return f"{problem.element} at nu = {nu:.4g}: the cells have too few motions that keep their volume"


def _advice(problem: Problem, kind: str, found: dict[str, Any]) -> list[str]:
    """Next things to try, the most promising first."""
    solve, advice = problem.scene.solve, []
    if kind == "undefined" and not problem.energy.inverts and problem.scene.material.extension is None:
        advice.append("give material.extension = 0.25, which continues the energy through J = 0")
    if found["unbounded_below"]:
        advice.append("take another material or a smaller load: this energy has no minimum to find")
    if found["ellipticity"] < 0:
        advice.append("take another material: this one loses ellipticity there, and the mesh decides what folds")
    if found["locking"]:
        advice.append('set solve.element = "P2" or "Q2", or a mixed one: "P2-P1", "Q2-P1d"')
    if not problem.potential.can_filter:
        advice.append('set solve.assembly = "spectral", whose tangent can be filtered')
    if kind == "time":
        advice.append(f"raise solve.time_limit above {solve.time_limit:g} s, or take fewer cells")
    if kind == "iterations":
        advice.append(f"raise solve.max_iterations above {solve.max_iterations}")
    if problem.scene.start is None and kind != "time":
        advice.append(f"raise solve.steps above {solve.steps}, or lower solve.smallest_step")
    if solve.method == "line-search" and kind in ("stalled", "iterations", "indefinite"):
        advice.append('set solve.method = "trust-region"')
    return advice or ["refine the mesh around the worst cells"]
