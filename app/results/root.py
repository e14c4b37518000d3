"""What only rank 0 does, with its failures told on every rank.

`geometry.session` and `forms.spectral.build` do likewise in their own words: they know nothing of app/ nor of each
other, and what fails there, a mesh or a compiler, has an error of its own.
"""

from collections.abc import Callable
from typing import TypeVar

from mpi4py import MPI

from elastune.app.errors import UserError

T = TypeVar("T")


def on_root(comm: MPI.Comm, where: object, task: Callable[[], T], kind: type[UserError] = UserError) -> T | None:
    """Runs a task on rank 0, which has its result; collective.

    Args:
        comm: Of the ranks.
        where: What is written, for the message.
        task: Writes it.
        kind: Of what is raised.

    Raises:
        UserError: On every rank, if it cannot be written.
    """
    result, reason, cause = None, None, None
    if comm.rank == 0:
        try:
            result = task()
        # Ranks that wait for rank 0 would wait for ever.
        except Exception as problem:
            reason = getattr(problem, "strerror", None) or " ".join(str(problem).split()) or type(problem).__name__
            cause = problem
    reason = comm.bcast(reason)
    # A full disk, HDF5's own errors, no h5py; anything else is a mistake of ours.
    if cause is not None and not isinstance(cause, OSError | RuntimeError | ImportError):
        raise cause
    if reason is not None:
        raise kind(f"{where}: cannot be written: {reason}") from cause
    return result
