"""SIGINT and SIGTERM: where work ends at once, and where ranks first agree and bring files to a whole end.

Open MPI's launcher kills its ranks a quarter of a second after either. SIGUSR1 and SIGUSR2 it passes on, as other
launchers do, and here they stand for the two: `./run mpirun` sends them in their place.
"""

import os
import select
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Literal, NoReturn

SIGNALS: dict[int, signal.Signals] = {
    signal.SIGINT: signal.SIGINT,
    signal.SIGTERM: signal.SIGTERM,
    signal.SIGUSR1: signal.SIGINT,
    signal.SIGUSR2: signal.SIGTERM,
}

# Seconds within which two signals are one: `timeout` sends its to the process and to its group.
ONE = 0.2

# Who compiles locks a file, or works in a folder of its own, and tidies up on an exception.
COMPILERS = ("ffcx.codegeneration.jit", "elastune.forms.spectral.build")


class Interrupted(Exception):
    """A signal asked to stop."""


class _Signals:
    """What came, and what to do when something comes."""

    def __init__(self) -> None:
        self.number, self.first = 0, 0.0
        self.mode: Literal["end", "raise", "hold"] = "end"
        self.end: Callable[[], NoReturn] | None = None

    def come(self, number: int, frame: FrameType | None) -> None:
        """Python's handler: after the call of a library that is in progress, if there is one."""
        now = time.monotonic()
        if self.number:
            if now - self.first > ONE:
                os._exit(128 + SIGNALS[number])
            return
        self.number, self.first = SIGNALS[number], now
        if self.mode == "raise" or (self.mode == "end" and _compiling(frame)):
            raise Interrupted
        if self.mode == "end" and self.end is not None:
            # An exception would have to pass through libraries that do not let it.
            self.end()


_signals = _Signals()


def listen(end: Callable[[], NoReturn]) -> None:
    """From now on signals are taken: a first one as `held` and `raising` say, a second one ends the process at once.

    Args:
        end: Ends the process where nothing has to be brought to an end before.
    """
    # The handler runs between calls of libraries, which may last: another process watches for the second signal.
    ours, its = os.pipe()
    os.set_blocking(its, False)
    parent = os.getpid()
    if os.fork() == 0:
        os.close(its)
        _watch(ours, parent)
    os.close(ours)
    signal.set_wakeup_fd(its, warn_on_full_buffer=False)
    _signals.end = end
    for number in SIGNALS:
        # Who started the process may have wanted it to ignore one.
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _signals.come)


def _watch(pipe: int, parent: int) -> NoReturn:
    """Reads signals of the parent as they arrive."""
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


def _compiling(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_globals.get("__name__") in COMPILERS:
            return True
        frame = frame.f_back
    return False


@contextmanager
def held() -> Iterator[None]:
    """Within, a signal is noted only: `asked` tells."""
    yield from _within("hold")


@contextmanager
def raising() -> Iterator[None]:
    """Within, a first signal raises `Interrupted`: of one rank, between calls of libraries."""
    yield from _within("raise")


def _within(mode: Literal["raise", "hold"]) -> Iterator[None]:
    before, _signals.mode = _signals.mode, mode
    try:
        yield
    finally:
        _signals.mode = before


def asked(comm: Any) -> int:
    """The signal that asked any rank to stop, or 0: the same on every rank; collective.

    Args:
        comm: MPI communicator.
    """
    if _signals.end is not None and comm.size > 1:
        number = max(comm.allgather(_signals.number))
        if number and not _signals.number:
            # This rank's own is still to come, and is not the second.
            _signals.number, _signals.first = number, time.monotonic()
    return _signals.number


def came() -> int:
    """The signal that asked this process to stop, or 0."""
    return _signals.number


def ignore() -> None:
    """What came and was not heeded, and what comes, is too late: all is done."""
    _signals.number = 0
    if _signals.end is not None:
        # Not a function of ours: Python's end would bring the default back.
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)
