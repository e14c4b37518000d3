"""The free stretch of a compressible test: the branch of equilibria that sets out from rest, at all points at once."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from elastune.app.tuning.tests import Array

Balance = Callable[..., tuple[Any, ...]]

# Largest and smallest step in the logarithm of the loads, and how far the free stretch may move in one: farther away,
# even after the smallest step, is another branch of equilibria, to which a specimen would jump.
_STEP, _SMALLEST, _REACH = 0.05, 1e-7, 0.05
_NEWTON, _CLOSE = 8, 1e-9


def follow(equilibrium: Balance, loads: Array, columns: Sequence[Array], shape: tuple[int, ...]) -> Array:
    """Free stretches without stress, reached by loading gradually from rest.

    It is a local minimum of the energy, of which a material may have several; the branch ends where that minimum does.

    Args:
        equilibrium: ∂ψ/∂w at loads, w and constants, with its derivatives by w and the loads.
        loads: Stretches, shape (loads, n).
        columns: Constants, each of a shape that goes with (..., n).
        shape: Of the result, (..., n).

    Returns:
        Shape (..., n), not a number beyond the end of the branch.
    """
    goals = np.stack([np.broadcast_to(np.log(load), shape).ravel() for load in loads])
    constants = np.stack([np.broadcast_to(column, shape).ravel() for column in columns] or [np.empty(goals[0].shape)])
    length = np.abs(goals).max(axis=0)
    way, width = np.zeros(length.shape), np.zeros(length.shape)
    step = _STEP / np.maximum(length, _STEP)
    slope = _slope(equilibrium, goals, way, width, constants)
    open_ = np.ones(length.shape, dtype=bool)
    while open_.any():
        at = np.flatnonzero(open_)
        ahead = np.minimum(way[at] + step[at], 1.0)
        guess = width[at] + slope[at] * (ahead - way[at])
        found = _balanced(equilibrium, goals[:, at] * ahead, guess, constants[:, at])
        good = np.abs(found - width[at]) <= _REACH
        won, lost = at[good], at[~good]
        way[won], width[won] = ahead[good], found[good]
        slope[won] = _slope(equilibrium, goals[:, won], way[won], width[won], constants[:, won])
        step[won] = np.minimum(2 * step[won], _STEP / np.maximum(length[won], _STEP))
        step[lost] /= 4
        ended = lost[step[lost] * np.maximum(length[lost], _STEP) < _SMALLEST]
        width[ended] = np.nan
        open_[ended] = False
        open_[won[way[won] == 1]] = False
    return np.exp(width).reshape(shape)


def _slope(
    equilibrium: Callable[..., tuple[Any, ...]], goals: Array, way: Array, width: Array, constants: Array
) -> Any:
    """How fast the logarithm of the free stretch changes along the way."""
    x, w = np.exp(goals * way), np.exp(width)
    _, by_free, *by_loads = equilibrium(*x, w, *constants)
    with np.errstate(all="ignore"):
        change = -sum(x[i] * goals[i] * by_loads[i] for i in range(len(x))) / (by_free * w)
    return np.where(np.isfinite(change), np.broadcast_to(change, w.shape), 0.0)


def _balanced(equilibrium: Balance, logarithms: Array, start: Array, constants: Array) -> Array:
    """Newton's method in the logarithm of the free stretch; not a number where it finds no minimum near the start."""
    x, width = np.exp(logarithms), start
    with np.errstate(all="ignore"):
        for _ in range(_NEWTON):
            w = np.exp(width)
            balance, by_free, *_ = equilibrium(*x, w, *constants)
            move = np.broadcast_to(-balance / (by_free * w), w.shape)
            width = width + np.where(np.abs(move) <= _REACH, move, np.nan)
            if not np.nanmax(np.abs(move), initial=0.0) > _CLOSE * _CLOSE:
                break
        return np.where((np.abs(move) <= _CLOSE) & (np.broadcast_to(by_free, w.shape) > 0), width, np.nan)
