"""Shapes to come home from: scrambled, collapsed, turned inside out."""

import numpy as np

from elastune.app.body.body import Array, Problem
from elastune.app.scene.schema import Start


def started(problem: Problem, start: Start) -> Array:
    """The displacements of a start, a vector; right for what is owned and not prescribed."""
    d = problem.dimension
    points = problem.V.tabulate_dof_coordinates()[:, :d]
    low, high = problem.bounds
    center = (low + high) / 2
    axis = "xyz".index(start.axis)
    if start.shape == "scramble":
        box = (high - low) * start.volume ** (1 / d)
        target = center + box * (uniform(problem, start.seed) - 0.5)
    elif start.shape == "plane":
        target = points.copy()
        target[:, axis] = center[axis]
    elif start.shape == "line":
        target = np.tile(center, (len(points), 1))
        target[:, axis] = points[:, axis]
    elif start.shape == "point":
        target = np.tile(center, (len(points), 1))
    else:
        target = points.copy()
        target[:, axis] = 2 * center[axis] - points[:, axis]
    return problem.joined((target - points).ravel())


def uniform(problem: Problem, seed: int) -> Array:
    """A random number in [0, 1) for every displacement, the same however the mesh is distributed.

    Returns:
        Shape (nodes, d), right for owned nodes only.
    """
    d, comm = problem.dimension, problem.comm
    points = problem.V.tabulate_dof_coordinates()[:, :d]
    own = problem.owned_displacements // d
    parts = comm.allgather(points[:own])
    everywhere = np.concatenate(parts)
    # The order of the nodes in space, not in memory, decides which numbers they get.
    order = np.lexsort(np.round((everywhere - problem.bounds[0]) / problem.extent, 9).T)
    random = np.empty_like(everywhere)
    random[order] = np.random.default_rng(seed).random(everywhere.shape)
    first = sum(len(part) for part in parts[: comm.rank])
    numbers = np.zeros_like(points)
    numbers[:own] = random[first : first + own]
    return numbers
