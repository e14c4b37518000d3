"""Where an increment starts from."""

import numpy as np

from elastune.app.body.conditions.motions import Rotation
from elastune.app.body.unknowns import State
from elastune.app.path.blend import Blend
from elastune.app.solvers.minimizer import Minimizer


def predict(minimizer: Minimizer, blend: Blend, state: State, load: float) -> State:
    """The guess at a new load: the tangent's for all that moves and pulls, then turned where faces turn.

    Args:
        minimizer: Of the body.
        blend: Of the body.
        state: In balance at its own load.
        load: The new load factor.

    Raises:
        NotConverged: If no tangent gives one.
    """
    body = minimizer.body
    if not blend.turning:
        return minimizer.predict(state, load)
    # What turns stays where it is until the rest has moved.
    prescribed = body.constraints.displacements(load, {Rotation: state.load})
    moving = np.abs(body.layout.joined(prescribed) - state.values)[body.held].max(initial=0.0)
    loaded = any(term.factor is not None for term in body.terms)
    if loaded or body.layout.total(moving > 1e-14 * body.extent):
        moved = minimizer.predict(state, load, prescribed)
    else:
        moved = State(state.values.copy(), load)
    return blend.turned(moved, state.load)
