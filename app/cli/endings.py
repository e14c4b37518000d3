"""How a command ends: its exit status, and the one line that says why."""

import os
import sys
import time
import traceback
from contextlib import suppress
from typing import NoReturn

from elastune.app import interrupts
from elastune.app.cli import needs
from elastune.app.errors import UserError

OK, BAD_INPUT, NOT_CONVERGED = 0, 2, 3

# Seconds after which a rank says that it was interrupted, as none before it has: they may be waiting for it.
PATIENCE = 1.5

# Seconds within which a launcher hands a signal to all ranks.
LAG = 0.2

# What a person is to know after an interrupt, by command.
AFTERWARDS = {
    "run": "nothing was written",
    "converge": "what is done is kept, and the same command goes on",
    "stress": "what is done is kept, and the same command goes on",
}


def failed(error: Exception, command: str) -> int:
    """The exit status of a command that raised; says why.

    Args:
        error: What it raised.
        command: Its name.

    Raises:
        Exception: The same, if it is a mistake of ours.
    """
    if ranks() > 1:
        # Rank 0 may have told of its signal before this rank has one.
        time.sleep(LAG)
    if interrupts.came():
        # What libraries have made of the exception that a signal raised.
        interrupted(command)
    interrupts.ignore()
    if isinstance(error, ImportError) and error.name and not error.name.startswith("elastune"):
        error = needs.missing(error)
    if "JIT compilation timed out" in str(error):
        error = UserError("a kernel is locked by a compilation that was killed, or goes on elsewhere: elastune clean")
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


def interrupted(command: str, where: str = "") -> NoReturn:
    """Ends the process after a signal, without the farewell of MPI, for which other ranks may never come.

    Args:
        command: That it came in.
        where: How far that got.
    """
    number = interrupts.came()
    interrupts.ignore()
    more = where or ": ".join(["", AFTERWARDS[command]] if command in AFTERWARDS else [])
    # The launcher ends all as soon as one has ended.
    time.sleep(PATIENCE * rank())
    # Not to Python's streams, in whose middle the signal may have come.
    os.write(2, f"elastune: interrupted{more}\n".encode())
    with suppress(Exception):
        sys.stdout.flush()
    os._exit(128 + number)


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
