"""What "in balance" means."""

import numpy as np
from mpi4py import MPI

from elastune.app.body.body import Body
from elastune.app.body.unknowns import Array, State

# Of the largest forces on the way, in the scale of what is small where they all vanish.
SHARE = 1e-2

# Of rounding in the forces of a strain of one: displacements are rounded relative to the body's extent.
ROUNDING = 16 * np.finfo(np.float64).eps


class Balance:
    """Forces out of balance, and volume strains that are left, relative to what is large.

    Forces are relative to the norm of the internal or the external ones, whichever is larger, reactions among them;
    at least to a share of the largest of the iterates so far, or of the body's stiffness if that is less: a body may
    come to rest. Volume strains are relative to the displacement's gradient.
    """

    def __init__(self, body: Body) -> None:
        """Knows no forces yet."""
        self.body = body
        self._largest = 0.0

    def out_of_balance(self, state: State) -> Array:
        """A new vector of the forces that are not in balance, zero where the body is held, and of volume strains."""
        residual = self.body.assembly.residual(state)
        residual[self.body.held] = 0.0
        return residual

    def parts(self, state: State) -> tuple[float, float]:
        """Norms of the forces out of balance and of the volume strains."""
        forces, strains = self.body.layout.split(self.out_of_balance(state))
        return self.body.layout.norm(forces), float(np.sqrt(self.body.pressures.squared(strains)))

    def scales(self, state: State) -> tuple[float, float]:
        """What the two are relative to at a state."""
        body = self.body
        own = self._forces(state)
        force = max(own, SHARE * min(max(self._largest, own), body.stiffness))
        return force or 1.0, 1.0 if body.p is None else float(np.sqrt(body.assembly.distortion(state))) or 1.0

    def error(self, state: State) -> float:
        """The larger of the two relative to its scale; zero where forces are rounding."""
        (force, strain), (force_scale, strain_scale) = self.parts(state), self.scales(state)
        relative = 0.0 if force <= self._rounding(state) else force / force_scale
        return float(np.maximum(relative, strain / strain_scale))

    def accept(self, state: State) -> None:
        """Counts a state among the iterates."""
        self._largest = max(self._largest, self._forces(state))

    def _rounding(self, state: State) -> float:
        """Forces that are rounding: of the softest part, or of the stiffest.

        A stiff one counts by how far it moves, as its displacements are rounded; but in full with pressures, which come
        from volume ratios near one.
        """
        body, factor = self.body, self.body.parts.contrast
        if factor > 1 and body.p is None:
            own = float(np.abs(body.layout.split(state.values)[0]).max(initial=0.0))
            factor *= min(body.comm.allreduce(own, op=MPI.MAX) / body.extent, 1.0)
        return float(ROUNDING * body.stiffness * max(1.0, factor))

    def _forces(self, state: State) -> float:
        layout = self.body.layout
        return max(layout.norm(forces) for forces in self.body.assembly.forces(state))
