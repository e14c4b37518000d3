"""Why a run stopped: what the state looks like where the last attempt ended, and what to try next."""

from typing import Any

import numpy as np
from mpi4py import MPI

from elastune.app.body.body import Array, Body
from elastune.app.body.conditions.loads import BodyForce, Force, Moment, NormalPull, Pull
from elastune.app.body.regions.parts import Part
from elastune.app.body.unknowns import State
from elastune.app.solvers.options import Options
from elastune.forms.elements import ELEMENTS
from elastune.forms.spectral import pointwise, stress

# Points of a part whose tangent is examined on each rank: those of least volume and largest stretch.
EXAMINED = 500

# Shapes that a body can run away along, as exponents of one stretch t.
_RAYS = np.array([[1, 1, 1], [1, 0, 0], [1, 1, 0], [1, -1, 0], [1, -0.5, -0.5], [1, 1, -2]])


def diagnose(body: Body, options: Options, state: State | None, kind: str, started: bool = False) -> dict[str, Any]:
    """What a person needs to know about a failure; collective.

    Args:
        body: Its state is left as it is.
        options: How it was solved.
        state: Where the last attempt stopped; the body's state if None.
        kind: Of the failure, see `NotConverged`.
        started: Whether the body set out from a shape other than that at rest.

    Returns:
        `inverted_cells` and the `worst_cells` with their places at rest, ranges of `J` and of the principal
        `stretches`, `residual` with its norm and the place of the largest force out of balance, `energy`,
        whether it is `unbounded_below`, the least eigenvalue of the acoustic tensor relative to μ
        (`ellipticity`, lost where negative), why `locking` is likely or None, and `advice`.
    """
    kept = body.state
    body.take(kept if state is None else state)
    try:
        found = _shape(body) | {
            "residual": _residual(body),
            "energy": body.assembly.energy(body.state),
            "unbounded_below": _unbounded(body),
            "locking": _locking(body),
        }
    finally:
        body.take(kept)
    return found | {"advice": _advice(body, options, started, kind, found)}


def _shape(body: Body) -> dict[str, Any]:
    """Volume ratios and stretches at the quadrature points, and where the material is not elliptic."""
    mesh, points, comm = body.geometry.mesh, body.quadrature_points, body.comm
    cells, H = points.owned, points.gradient(body.u)
    finite = np.asarray(np.isfinite(H).all(axis=(1, 2)))
    F = np.where(finite[:, None, None], np.eye(3) + H, np.eye(3))
    J, stretches = np.linalg.det(F), np.linalg.svd(F, compute_uv=False)
    # Where the displacement is no number there is nothing to tell: of the other cells there is.
    J[~finite], stretches[~finite] = np.nan, np.nan
    by_cell = J.reshape(len(cells), points.count)
    least = np.where(np.isfinite(by_cell).all(axis=1), by_cell.min(axis=1, initial=np.inf), np.inf)
    centers = mesh.geometry.x[mesh.geometry.dofmap[cells]].mean(axis=1) if len(cells) else np.empty((0, 3))
    worst = [(float(least[i]), centers[i].tolist()) for i in np.argsort(least)[:5] if np.isfinite(least[i])]
    worst = sorted(entry for entries in comm.allgather(worst) for entry in entries)[:5]
    return {
        "inverted_cells": comm.allreduce(int(np.sum(least <= 0))),
        "worst_cells": [{"J": value, "center": center} for value, center in worst],
        "J": _range(body, J),
        "stretches": _range(body, stretches),
        "ellipticity": comm.allreduce(_least_ellipticity(body, H, J, stretches[:, 0]), op=MPI.MIN),
    }


def _range(body: Body, values: Array) -> list[float]:
    """Least and largest of the numbers."""
    low, high = np.fmin.reduce(values, None, initial=np.inf), np.fmax.reduce(values, None, initial=-np.inf)
    return [body.comm.allreduce(float(low), op=MPI.MIN), body.comm.allreduce(float(high), op=MPI.MAX)]


def _least_ellipticity(body: Body, H: Array, J: Array, largest: Array) -> float:
    """Over the extreme quadrature points of each part on this rank; J and largest stretch are NaN where H is."""
    points, least = body.quadrature_points, np.inf
    numbers = np.arange(len(H)).reshape(len(points.owned), points.count)
    for part, own in body.parts.of(points.owned):
        places = numbers[own].ravel()
        places = places[np.isfinite(J[places])]
        extremes = np.union1d(np.argsort(J[places])[:EXAMINED], np.argsort(-largest[places])[:EXAMINED])
        least = min(least, _ellipticity(part, H[places[extremes]], body.dimension))
    return least


def _ellipticity(part: Part, H: Array, d: int) -> float:
    """Least eigenvalue of the acoustic tensor n·∂P/∂F·n over directions n and points, relative to μ.

    In plane strain directions and motions are those of the plane: nothing can fold out of it.

    Args:
        part: Gives the energy.
        H: Displacement gradients, shape (n, 3, 3).
        d: Dimension of the body.
    """
    energy = part.energy
    if not energy.objective or not len(H):
        return np.inf
    with np.errstate(all="ignore"):
        tangent = pointwise(energy, H, part.extension)[2].reshape(-1, 3, 3, 3, 3)
    tangent = tangent[np.asarray(np.isfinite(tangent).all(axis=(1, 2, 3, 4)))][:, :d, :d, :d, :d]
    k = np.arange(60)
    if d == 2:
        n = np.column_stack([np.cos(k * np.pi / 60), np.sin(k * np.pi / 60)])
    else:
        # Fibonacci's points on the half sphere.
        z, angle = (k + 0.5) / 60, k * np.pi * (3 - np.sqrt(5))
        n = np.column_stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z])
    acoustic = np.einsum("piJkL,dJ,dL->pdik", tangent, n, n, optimize=True)
    return float(np.linalg.eigvalsh(acoustic).min(initial=np.inf) / part.shear_modulus)


def _residual(body: Body) -> dict[str, Any]:
    """Norm of the forces out of balance, and where the largest of them is."""
    residual = np.where(body.held, 0.0, body.assembly.residual(body.state))
    forces = np.linalg.norm(body.layout.nodal(residual), axis=1)
    place = int(np.argmax(forces)) if len(forces) else None
    points = body.points
    largest = (0.0, [0.0] * 3) if place is None else (float(forces[place]), points[place].tolist())
    force, at = max(body.comm.allgather(largest))
    return {"norm": body.layout.norm(residual), "largest_force": force, "at": at}


def _unbounded(body: Body) -> bool:
    """Whether the body can lower its energy without end: by itself, or slower than a dead load does work."""
    dead = (BodyForce, Force, Moment, NormalPull, Pull)
    pulled = any(isinstance(condition, dead) for _, condition in body.acting())
    return any(_unbounded_part(part, pulled) for part in body.parts)


def _unbounded_part(part: Part, pulled: bool) -> bool:
    if not part.energy.objective:
        return False
    far = np.array([1e-4, 1e-3, 1e3, 1e4])
    diagonals = (far[:, None, None] ** _RAYS).reshape(-1, 3)
    H = np.einsum("ni,ij->nij", diagonals - 1, np.eye(3))
    with np.errstate(all="ignore"):
        psi = np.nan_to_num(stress(part.energy, H, part.extension)[0], nan=np.inf) / part.shear_modulus
    if psi.min() < -1e2:
        return True
    return pulled and bool((psi / diagonals.max(axis=1))[diagonals.max(axis=1) >= 1e4].min() < 1e-2)


def _locking(body: Body) -> str | None:
    part = max(body.parts, key=lambda part: part.at_rest.poissons_ratio)
    nu = part.at_rest.poissons_ratio
    limit = 0.45 if body.element == "P1" else 0.495
    if ELEMENTS[body.element].degree > 1 or nu < limit:
        return None
    where = "" if part.name is None else f" in region {part.name}"
    return f"{body.element} at nu = {nu:.4g}{where}: the cells have too few motions that keep their volume"


def _advice(body: Body, options: Options, started: bool, kind: str, found: dict[str, Any]) -> list[str]:
    """Next things to try, the most promising first."""
    if kind == "limit":
        return ['set solve.follow = "arc", which goes on through limits, or prescribe a motion instead of the load']
    advice = []
    undefined = [part for part in body.parts if not part.energy.inverts and part.extension is None]
    if kind == "undefined" and undefined:
        advice.append(f"give {undefined[0].key}.extension = 0.25, which continues the energy through J = 0")
    if found["unbounded_below"]:
        advice.append("take another material or a smaller load: this energy has no minimum to find")
    if found["ellipticity"] < 0:
        advice.append("take another material: this one loses ellipticity there, and the mesh decides what folds")
    if found["locking"]:
        advice.append('set solve.element = "P2" or "Q2", or a mixed one: "P2-P1", "Q2-P1d"')
    if not body.parts.can_filter:
        advice.append('set solve.assembly = "spectral", whose tangent can be filtered')
    if kind == "time":
        advice.append(f"raise solve.time_limit above {options.time_limit:g} s, or take fewer cells")
    if kind == "iterations":
        advice.append(f"raise solve.max_iterations above {options.max_iterations}")
    if not started and kind != "time":
        advice.append(f"raise solve.steps above {options.steps}, or lower solve.smallest_step")
    if options.method == "line-search" and kind in ("stalled", "iterations", "indefinite"):
        advice.append('set solve.method = "trust-region"')
    return advice or ["refine the mesh around the worst cells"]
