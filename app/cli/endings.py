"""How a command ends: its exit status, and the one line that says why."""

import os
import sys
import time
import traceback
from typing import NoReturn

from elastune.app import interrupts
from elastune.app.errors import UserError

OK, BAD_INPUT, NOT_CONVERGED = 0, 2, 3

# What a person may do after an interrupt, by command.
AFTERWARDS = {
    "run": "nothing was written",
    "converge": "what is done is kept, and the same command goes on",
    "stress": "what is done is kept, and the same command goes on",
}


def failed(error: Exception, command: str = "") -> int:
    """The exit status of a command that raised; says why.

    Args:
        error: What it raised.
        command: Its name.

    Raises:
        Exception: The same, if it is a mistake of ours.
    """
    stopped = interrupts.came()
    interrupts.ignore()
    # Or what a library has made of the exception that a signal raised.
    if stopped:
        interrupted(f"interrupted: {AFTERWARDS[command]}" if command in AFTERWARDS else "interrupted")
    if isinstance(error, UserError):
        complain(str(error))
        _wait_for_others()
        return BAD_INPUT
    if isinstance(error, BrokenPipeError):
        # The reader of our output has gone, as in `elastune materials | head`.
        sys.stderr.close()
        return OK
    # Other ranks would wait forever for one that has failed alone.
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi is not None and mpi.COMM_WORLD.size > 1:
        traceback.print_exception(error)
        sys.stderr.flush()
        mpi.COMM_WORLD.Abort(1)
    raise error


def interrupted(message: str) -> NoReturn:
    """Ends the process after a signal, without the farewell of MPI, for which other ranks may never come."""
    complain(message)
    sys.stdout.flush()
    if rank() != 0:
        # The launcher ends all as soon as one has ended: rank 0 is to have spoken by then.
        time.sleep(1)
    os._exit(128 + interrupts.came())


def complain(message: str) -> None:
    """One line on standard error, from one rank."""
    if rank() == 0:
        print(f"elastune: {' '.join(message.split())}", file=sys.stderr, flush=True)


def rank() -> int:
    """Of this process, as the launcher tells before MPI is loaded."""
    return int(os.environ.get("OMPI_COMM_WORLD_RANK", os.environ.get("PMI_RANK", "0")))


def ranks() -> int:
    """Number of processes, likewise."""
    return int(os.environ.get("OMPI_COMM_WORLD_SIZE", os.environ.get("PMI_SIZE", "1")))


def _wait_for_others() -> None:
    """Before MPI is loaded, mpirun ends all ranks as soon as one exits: rank 0 must have spoken by then."""
    if ranks() > 1 and "mpi4py.MPI" not in sys.modules:
        from mpi4py import MPI

        MPI.COMM_WORLD.Barrier()
