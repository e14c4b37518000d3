"""Newton's method for mixed elements: Π(u, p) is least in the displacement and greatest in the pressure."""

from collections.abc import Callable
from functools import cached_property
from typing import Literal

import numpy as np
import ufl
from dolfinx import fem

from elastune.app.body.body import Array, Problem
from elastune.app.errors import NotConverged
from elastune.app.solvers.linear.blocks import Blocks, Convexity
from elastune.app.solvers.tangent import Count, Deadline
from elastune.forms.terms.mixed import MixedPotential

# A step that is shorter than this, of a whole one, comes from a tangent that says nothing about where it leads.
SHORTEST = 1e-3


class SaddlePoint:
    """Finds the equilibrium of least energy under prescribed displacements and the pressure's constraint.

    A step is a direction of descent where the tangent, with its n displacements and m pressures, has exactly m
    negative eigenvalues: the displacement block is then positive definite on the motions that the pressures
    leave. Where there are more, or a step leads nowhere, the displacement block is made more convex.

    The step's length is chosen by the augmented Lagrangian Π(u, p̂) + γ/2 |∂Π/∂p (u, p̂)|² at the pressure p̂ that
    the step aims at. Newton's direction is a direction of descent of it for large enough γ, and its own Newton
    direction, so that steps end up whole; unlike the energy with the pressure eliminated, it does not punish a
    step for the volume that it changes to second order with an infinite λ.

    Reference:
        Nocedal & Wright 2006, Numerical Optimization, Theorem 16.3 and Sections 17.3, 18.4.
    """

    def __init__(self, problem: Problem) -> None:
        """Compiles what the steps need."""
        if not isinstance(problem.potential, MixedPotential):
            raise TypeError("expected a problem with pressures")
        self.problem, self.potential = problem, problem.potential
        self.tangent = Blocks(problem, problem.potential)
        self._deadline = Deadline(problem)
        gradient = ufl.grad(problem.u)
        self._distortion = fem.form(ufl.inner(gradient, gradient) * ufl.dx)

    @property
    def count(self) -> Count:
        """What has been spent."""
        return self.tangent.count

    # ------------------------------------------------------------------ the steps of a load increment

    def predict(self, values: Array, load: float) -> Array:
        """First-order prediction of the state at a new load.

        Args:
            values: State in balance at the load the potential holds now.
            load: The new load factor; the potential takes it.

        Raises:
            NotConverged: If no tangent gives one.
        """
        problem = self.problem
        increment = np.where(problem.held, problem.prescribed(load) - values, 0.0)
        problem.potential.load.value = load
        residual = problem.residual_at(values)
        residual[problem.held] = 0.0
        for convexity in self._ladder:
            if not self.tangent.fresh or convexity is not self._ladder[0]:
                self.tangent.assemble(convexity)
            step = self.tangent.solve(problem.lift(increment) - residual, 1e-4)
            if step is not None:
                guess = values + increment + step
                # A pressure may be predicted that no volume ratio of the material has.
                defined = np.isfinite(problem.norm(problem.residual_at(guess)))
                return guess if defined else problem.with_displacements(values, problem.displacements(guess))
        raise NotConverged("indefinite", "the prediction's tangent has negative eigenvalues, however filtered", values)

    @cached_property
    def _ladder(self) -> list[Convexity]:
        """From the true tangent to more and more convex ones."""
        filtering: Literal["none", "clamp"] = "clamp" if self.potential.can_filter else "none"
        return [Convexity("none", 0.0), *(Convexity(filtering, share) for share in (0.0, 0.25, 1.0, 4.0, 16.0))]

    def minimize(self, values: Array) -> Array:
        """The equilibrium from a state whose prescribed displacements are right.

        Raises:
            NotConverged: With the kind of failure; the problem's state is then of no use.
        """
        problem, solve = self.problem, self.problem.scene.solve
        problem.set_state(values)
        values = problem.state
        self._scale = 0.0
        previous, rung = None, 0
        for iteration in range(solve.max_iterations + 1):
            self._deadline.check()
            residual, error = self._residual(values)
            if not np.isfinite(error):
                raise NotConverged("undefined", "the forces are not finite at the start of the step", values)
            if error <= solve.tolerance:
                self.tangent.fresh = rung == -1
                return values
            if iteration == solve.max_iterations:
                raise NotConverged("iterations", f"{iteration} Newton steps, residual {error:.1e}", values)
            # As exact as a quadratic step deserves, and no more than the tolerance asks for.
            wanted = 1e-2 if previous is None else 0.1 * (error / previous) ** 2
            forcing = min(1e-2, max(wanted, 0.1 * solve.tolerance / error))
            values, rung = self._step(values, residual, error, forcing, rung)
            self.count.newton += 1
            previous = error
        raise AssertionError("unreachable")

    def _residual(self, values: Array) -> tuple[Array, float]:
        """Forces out of balance and volume strains, and the larger of the two relative to their scales.

        Forces relative to the largest on the way, those at the prescribed displacements among them; strains
        relative to the displacement's gradient.
        """
        problem = self.problem
        residual = problem.residual_at(values)
        for forms in (problem.potential.internal, problem.potential.external):
            if forms:
                self._scale = max(self._scale, problem.norm_displacements(problem.force_at(values, forms)))
        residual[problem.held] = 0.0
        n = problem.owned_displacements
        force = problem.norm_displacements(residual) / (self._scale or 1.0)
        distortion = problem.comm.allreduce(float(fem.assemble_scalar(self._distortion)))
        strain = np.sqrt(self._squared(residual[n : problem.owned]) / (distortion or 1.0))
        return residual, float(np.maximum(force, strain))

    def _squared(self, strains: Array) -> float:
        """Square of a volume strain's norm, ∫θ² of its values at the pressures' nodes."""
        return self.problem.comm.allreduce(float(strains @ (strains / self.tangent.volumes)))

    def _step(self, values: Array, residual: Array, error: float, forcing: float, rung: int) -> tuple[Array, int]:
        """The state after a step, and the rung of the ladder to start from where the true tangent fails next."""
        for number in (0, *range(max(1, rung), len(self._ladder))):
            self.problem.set_state(values)
            self.tangent.assemble(self._ladder[number])
            step = self.tangent.solve(-residual, forcing)
            length = None if step is None else self._length(values, step, error)
            if step is not None and length is not None:
                return values + length * step, number - 1
        raise NotConverged("stalled", "no step lowers the augmented energy, however convex the tangent is made", values)

    def _length(self, values: Array, step: Array, error: float) -> float | None:
        """The length of a step that lowers the merit by Armijo's rule; None if there is none.

        Without a potential (follower pressure) the relative error is the merit. The step's pressures are cut, in
        place, where they aim at what no volume ratio of the material has.
        """
        if not self.potential.loads.conservative:
            return _backtrack(lambda length: self._residual(values + length * step)[1], error, -error, 0.0)
        problem = self.problem
        n, owned = problem.owned_displacements, problem.owned
        motion = problem.joined(problem.displacements(step))
        residual = np.full_like(step, np.nan)
        for _ in range(30):
            aim = values + step - motion
            residual = problem.residual_at(aim)
            if np.isfinite(problem.norm(residual)):
                break
            step[n:owned] *= 0.5
        slope = problem.dot(residual, motion)
        squared = self._squared(residual[n:owned])
        weight = self.potential.shear_modulus
        if slope > 0:
            # Of a tangent whose eigenvalues nobody counted, a large weight is a sign that they are wrong.
            limit = np.inf if self.tangent.direct else 10 * weight
            weight = max(weight, 2 * slope / squared) if squared > 0 else np.inf
            if not weight < limit:
                return None

        def merit(length: float) -> float:
            trial = aim + length * motion
            strains = problem.residual_at(trial)[n:owned]
            return problem.energy_at(trial) + weight / 2 * self._squared(strains)

        start = problem.energy_at(aim) + weight / 2 * squared
        return _backtrack(merit, start, slope - weight * squared, 1e-13 * abs(start) + 1e-16)


def _backtrack(merit: Callable[[float], float], start: float, slope: float, rounding: float) -> float | None:
    """The first of 1 and shorter lengths, but not too short ones, that lowers a merit by Armijo's rule, or None."""
    length = 1.0
    while length > SHORTEST:
        value = merit(length)
        if not np.isfinite(value):
            length *= 0.5
            continue
        if value <= start + 1e-4 * length * slope + rounding:
            return length
        # The minimum of the parabola through what is known.
        curvature = 2 * (value - start - length * slope)
        best = -slope * length**2 / curvature if curvature > 0 else 0.5 * length
        length = float(np.clip(best, 0.1 * length, 0.5 * length))
    return None
