"""Brings a tangled body home: first as a more compressible material, then as its own.

What holds a tangled body back is volume. The stable neo-Hookean energy μ/2 (I₁ - 3) - μ (J - 1) + λ/2 (J - 1)² has
two parts. The first is convex, and its only minimum pulls every cell together; the others are functions of J,
which a cell has to carry through zero to be turned right side out. In a heap of inverted cells every cell can
lower its volume energy at once by small changes of shape, and then resists all larger ones with λ: at ν = 0.49
λ is 25 μ, the heap sets like glass, and Newton's method ends in one of its many false minima, or crawls. At
ν = 0.3 λ is 2.5 μ. Tangled cells then give way: the convex part contracts the heap until neighbours share one
orientation, and from there J grows to one everywhere, led by the pinned points. Below ν = 0.2 the contraction
would win for good: F = 0 is a minimum of its own (Smith et al., Section 3.3). Between both lies a range of ν in
which every start met so far gets home; 0.3 is the fastest. Once no cell has less than half its volume no two of
its sides can change places any more, and the material's own λ finishes in a few steps. At no point is the shape
at rest looked up: energy decreases from step to step within each stage.

Three things make the way short. Steps come from the tangent made positive semi-definite point by point, which
is never in doubt about where down is. Such a step is too stiff along directions whose negative curvature was
removed, and these are the ones in which a heap unfolds: it is doubled as long as the energy falls, which costs
energies, not factorisations (`Merit.search`). And no node may move farther than half the body at once: early
forces are a thousand times those at the end, and a wild first step only makes another heap.

A body collapsed onto a line feels no force across it, a saddle that an exact Newton step never leaves (Smith et
al., Section 3.3: "meta-stable"). So a state in balance is asked for its inertia, and where the tangent has a
negative eigenvalue the body goes along its eigenvector as far as the energy falls (`escape`). Where the line
search stalls, the trust region takes over, which follows negative curvature by itself.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from elastune.app.body.body import Body
from elastune.app.body.unknowns import State
from elastune.app.solvers.minimizer import Minimizer

# The least volume ratio at which the softened material has done its work.
UNTANGLED = 0.5


def recover(body: Body, minimizer: Minimizer, shape: State, prove: bool = False) -> State:
    """The minimiser from a shape with inverted and collapsed cells.

    Args:
        body: At the shape's load.
        minimizer: Of the body.
        shape: Its prescribed displacements right.
        prove: See `Minimizer.minimize`.

    Raises:
        NotConverged: If the body does not get home.
    """
    # A long way is no reason to change the method.
    patience = minimizer.options.max_iterations
    if any(part.solid.softened is not None for part in body.parts):
        with _softened(body):
            shape = minimizer.minimize(shape, lambda: body.volume.least_J() > UNTANGLED, patience)
        # The same place, of which nothing is known any more.
        shape = State(shape.values.copy(), shape.load)
    return minimizer.minimize(shape, patience=patience, prove=prove)


@contextmanager
def _softened(body: Body) -> Iterator[None]:
    """The same materials with another ν: their parameters are run-time constants, so that nothing is compiled."""
    kept = []
    for part in body.parts:
        if part.solid.softened is not None:
            parameters = part.strain.parameters
            kept.append((parameters, parameters.value.copy()))
            parameters.value[:] = np.array(part.solid.softened.constants())
    body.assembly.forget()
    try:
        yield
    finally:
        for parameters, own in kept:
            parameters.value[:] = own
        body.assembly.forget()
