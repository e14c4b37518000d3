"""What tests do with bodies on one rank."""

from typing import Any

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from elastune.app.body.body import Body
from elastune.app.body.unknowns import State
from elastune.app.run import Run, start
from elastune.app.scene.read import load
from elastune.app.solvers.tangent import Tangent


def made(given: Any) -> Body:
    """The body of a scene, at rest."""
    return start(given, MPI.COMM_SELF).body


def solved(given: Any) -> Run:
    """A run of a scene, or of a body, to full load."""
    run = ended(given)
    assert run.summary.failure is None, run.summary.failure
    return run


def ended(given: Any) -> Run:
    """The same wherever it ends."""
    return (Run(given) if isinstance(given, Body) else start(given, MPI.COMM_SELF)).finish()


def shipped(name: str, *overrides: str) -> Run:
    """A shipped scene to full load."""
    return solved(load(name, overrides))


def newton_steps(run: Run) -> int:
    """Of the whole run."""
    return sum(record.newton_iterations for record in run.summary.steps)


def nodal(body: Body) -> np.ndarray:
    """Displacements of the nodes, shape (nodes, d)."""
    return body.layout.nodal(body.state.values)


def out_of_balance(body: Body, values: np.ndarray) -> np.ndarray:
    """Forces at a vector's state, zero where the body is held."""
    return np.where(body.held, 0.0, body.assembly.residual(State(values)))


def free_stiffness(body: Body) -> np.ndarray:
    """The true tangent at the body's state between the displacements that are free, a dense matrix."""
    tangent = Tangent(body)
    tangent.assemble(body.state)
    indices, columns, values = tangent.matrix.getValuesCSR()
    free = ~body.held
    return csr_matrix((values, columns, indices)).toarray()[free][:, free]
