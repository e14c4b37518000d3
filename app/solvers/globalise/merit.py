"""How good a state is: Π with its gradient, and the line search that lowers it."""

import numpy as np
from mpi4py import MPI

from elastune.app.body.body import Array, Problem
from elastune.app.errors import NotConverged

# A filtered tangent is too stiff where it took negative curvature away: its step may be this many times too short.
LONGEST = 32.0

# Of the largest forces on the way, in the scale of what is small where they all vanish.
SHARE = 1e-2


class Merit:
    """Π and its gradient at the iterate, and the line search along a step.

    Without a potential (follower pressure) the residual's norm takes the energy's place.

    Attributes:
        values: The iterate.
        value: Π, or half the square of the residual's norm.
        gradient: Forces out of balance, zero at the prescribed displacements.
        scale: Norm of internal or external forces, whichever is larger, reactions among them; at least a share
            of the largest on the way, or of the body's stiffness if that is less, for a body that comes to rest.
    """

    def __init__(self, problem: Problem, values: Array) -> None:
        """Evaluates at the first iterate.

        Raises:
            NotConverged: If the energy is not finite there.
        """
        self.problem = problem
        self.conservative = problem.potential.loads.conservative
        self.values = values
        self.scale = self._largest = 0.0
        self.gradient = self._gradient(values)
        self.value = self._value(values, self.gradient)
        if not np.isfinite(self.value):
            raise NotConverged("undefined", "the energy is not finite at the start of the step", values)

    @property
    def error(self) -> float:
        """Norm of the forces out of balance, relative to the scale; zero where it is rounding."""
        norm = self.problem.norm(self.gradient)
        # Displacements are rounded relative to the body's extent.
        return 0.0 if norm <= 16 * np.finfo(np.float64).eps * self.problem.stiffness else norm / self.scale

    def _gradient(self, values: Array) -> Array:
        problem = self.problem
        gradient = problem.force_at(values, problem.potential.internal)
        scale = problem.norm(gradient)
        if problem.potential.external:
            external = problem.force_at(values, problem.potential.external)
            scale = max(scale, problem.norm(external))
            gradient = gradient + external
        self._largest = max(self._largest, scale)
        self.scale = max(scale, SHARE * min(self._largest, problem.stiffness))
        gradient[problem.held] = 0.0
        return gradient

    def _value(self, values: Array, gradient: Array) -> float:
        if self.conservative:
            return self.problem.energy_at(values)
        return 0.5 * self.problem.norm(gradient) ** 2

    def descends(self, step: Array) -> bool:
        """Whether a step goes downhill."""
        return not self.conservative or self.problem.dot(self.gradient, step) < 0

    def search(self, step: Array, filtered: bool) -> float | None:
        """Moves along a step; its accepted length, or None if no length lowers the merit.

        Backtracking with the sufficient decrease of Armijo; where the decrease drowns in the rounding of Π the
        slope decides instead (the approximate Wolfe condition of Hager & Zhang 2005), or the forces. The step of a
        filtered tangent knows nothing of what lies far away: it moves no node by more than half the body's size at
        first, and is doubled as long as Π falls.

        Args:
            step: A direction of descent.
            filtered: Whether a filtered tangent gave it.
        """
        problem = self.problem
        slope = problem.dot(self.gradient, step) if self.conservative else -2 * self.value
        rounding = 1e-13 * abs(self.value) + 1e-16
        length = min(1.0, problem.extent / 2 / _largest(problem, step)) if filtered else 1.0
        for _ in range(30):
            trial = self.values + length * step
            value = problem.energy_at(trial) if self.conservative else np.nan
            gradient = None
            if not self.conservative:
                gradient = self._gradient(trial)
                value = self._value(trial, gradient)
            if np.isfinite(value):
                accepted = value <= self.value + 1e-4 * length * slope
                if not accepted and self.conservative and value <= self.value + rounding:
                    gradient = self._gradient(trial)
                    accepted = abs(problem.dot(gradient, step)) <= 0.9 * abs(slope)
                    accepted = accepted or problem.norm(gradient) < problem.norm(self.gradient)
                if accepted:
                    if filtered and length == 1.0 and value < self.value - rounding:
                        length, gradient = self._extended(step, value), None
                    self._move(self.values + length * step, gradient)
                    return length
                curvature = 2 * (value - self.value - length * slope)
                best = -slope * length**2 / curvature if curvature > 0 else 0.5 * length
                length = float(np.clip(best, 0.1 * length, 0.5 * length))
            else:
                length *= 0.5
        return None

    def _extended(self, step: Array, value: float) -> float:
        """The length, a power of two, after which Π rises again."""
        length = 1.0
        while length < LONGEST:
            farther = self.problem.energy_at(self.values + 2 * length * step)
            if not farther < value:
                break
            length, value = 2 * length, farther
        return length

    def _move(self, values: Array, gradient: Array | None) -> None:
        self.values = values
        self.gradient = self._gradient(values) if gradient is None else gradient
        self.value = self._value(values, self.gradient)


def _largest(problem: Problem, step: Array) -> float:
    """The largest displacement of a node, along an axis; never zero."""
    return problem.comm.allreduce(float(np.abs(step).max(initial=1e-300)), op=MPI.MAX)
