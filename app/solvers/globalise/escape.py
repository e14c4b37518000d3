"""Off a saddle point: along the direction in which Π curves downwards most."""

from elastune.app.body.body import Body
from elastune.app.body.unknowns import Array, State
from elastune.app.solvers.globalise.linesearch import lowering
from elastune.app.solvers.globalise.merit import moved

# The longest way to try, relative to the body's extent, and the shortest.
FIRST, LEAST = 0.1, 1e-6


def escape(body: Body, state: State, direction: Array) -> State | None:
    """A state of lower energy along a direction of negative curvature, or None if none was found.

    To a quadratic model such a direction has no end: lengths are halved from a tenth of the body down, as long as Π
    falls. A little noise and a trust region, the simpler way, fall back onto the saddle point where Π is flat.

    Args:
        body: Whose Π it is.
        state: Nearly in balance.
        direction: Zero where displacements are prescribed, its largest entry one.
    """
    assembly = body.assembly
    if body.layout.dot(assembly.residual(state), direction) > 0:
        direction = -direction

    def energy(length: float) -> float:
        trial = moved(state, direction, length)
        # A volume that pressures do not allow is no way down.
        return assembly.energy(trial) + body.pressures.work(assembly.strains(trial))

    length = lowering(energy, FIRST * body.extent, LEAST * body.extent, 0.1 * assembly.noise(state))
    return None if length is None else moved(state, direction, length)
