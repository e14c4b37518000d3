"""SIGINT and SIGTERM: where work may stop at once, and where ranks first agree and bring files to a whole end.

Open MPI's launcher kills its ranks a quarter of a second after either. SIGUSR1 and SIGUSR2 it passes on, as other
launchers do, and here they stand for the two: `./run mpirun` sends them in their place.
"""

import os
import select
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

SIGNALS = {
    signal.SIGINT: signal.SIGINT,
    signal.SIGTERM: signal.SIGTERM,
    signal.SIGUSR1: signal.SIGINT,
    signal.SIGUSR2: signal.SIGTERM,
}

# Seconds within which two signals are one: `timeout` sends its to the process and to its group.
ONE = 0.2


class Interrupted(Exception):
    """A signal asked to stop.

    It is an `Exception`, so that who holds a lock, as FFCx does while it compiles, lets it go.
    """


class _Signals:
    """What came, and what to do when something comes."""

    def __init__(self) -> None:
        self.listening, self.held, self.over = False, False, False
        self.number, self.first = 0, 0.0

    def come(self, number: int, frame: FrameType | None) -> None:
        """Python's handler: after the call of a library that is in progress, if there is one."""
        if self.over:
            return
        now = time.monotonic()
        if self.number:
            if now - self.first > ONE:
                os._exit(128 + SIGNALS[signal.Signals(number)])
            return
        self.number, self.first = SIGNALS[signal.Signals(number)], now
        if not self.held:
            raise Interrupted


_signals = _Signals()


def listen() -> None:
    """From now on a signal raises `Interrupted`, or is noted while held; a second one ends the process at once."""
    # The handler runs between calls of libraries, which may last: another process watches for the second signal.
    ours, its = os.pipe()
    os.set_blocking(its, False)
    parent = os.getpid()
    if os.fork() == 0:
        os.close(its)
        _watch(ours, parent)
    os.close(ours)
    signal.set_wakeup_fd(its, warn_on_full_buffer=False)
    _signals.listening = True
    for number in SIGNALS:
        signal.signal(number, _signals.come)


def _watch(pipe: int, parent: int) -> None:
    """Reads signals of the parent as they arrive, and never returns."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    first = None
    while came := os.read(pipe, 1):
        if came[0] not in SIGNALS:
            continue
        now = time.monotonic()
        if first is not None and now - first > ONE:
            # Time to end by itself, with a better status.
            if not select.select([pipe], [], [], ONE)[0]:
                os.kill(parent, signal.SIGKILL)
            break
        first = first or now
    os._exit(0)


@contextmanager
def held() -> Iterator[None]:
    """Within, signals are noted and nothing is raised: `asked` tells.

    Raises:
        Interrupted: If one came before.
    """
    check()
    before, _signals.held = _signals.held, True
    try:
        yield
    finally:
        _signals.held = before


@contextmanager
def released() -> Iterator[None]:
    """Within `held`, what may stop at once on one rank alone."""
    before, _signals.held = _signals.held, False
    try:
        yield
    finally:
        _signals.held = before


def asked(comm: Any) -> int:
    """The signal that asked any rank to stop, or 0: the same on every rank; collective.

    Args:
        comm: MPI communicator.
    """
    if _signals.listening and comm.size > 1:
        number = max(comm.allgather(_signals.number))
        if number and not _signals.number:
            # This rank's own is still to come, and is not the second.
            _signals.number, _signals.first = number, time.monotonic()
    return _signals.number


def came() -> int:
    """The signal that asked this process to stop, or 0."""
    return _signals.number


def check() -> None:
    """Stops where a signal came whose exception was lost.

    Raises:
        Interrupted: Then.
    """
    if _signals.number:
        raise Interrupted


def ignore() -> None:
    """What comes now is too late: all is done."""
    _signals.over = True
