"""A case in a process of its own, so that its time and its memory are its own, and so are its accidents."""

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from typing import Any

from elastune.app import interrupts


class CaseFailure(Exception):
    """The process left no answer.

    Attributes:
        status: "timeout" or "failed".
    """

    def __init__(self, status: str, message: str) -> None:
        super().__init__(message)
        self.status = status


def answer(module: str, request: dict[str, Any], ranks: int, timeout: float) -> dict[str, Any]:
    """Runs a module that takes a request in JSON as its word, and prints its answer in JSON as the last line.

    Args:
        module: Its name.
        request: What is asked.
        ranks: MPI processes.
        timeout: Seconds after which it is given up.

    Raises:
        CaseFailure: If it is given up, or ends with an error or without an answer.
    """
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    command = [*launcher, sys.executable, "-m", module, json.dumps(request)]
    # A session of its own, so that a case that is given up takes its compilers with it.
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        # An interrupt must not leave the case behind.
        with interrupts.raising():
            output, errors = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        raise CaseFailure("timeout", f"not done after {timeout:g} s") from None
    finally:
        if process.poll() is None:
            # The ranks are no children of ours: mpirun ends them, if it is asked and not killed.
            os.killpg(process.pid, signal.SIGTERM)
            with suppress(subprocess.TimeoutExpired):
                process.communicate(timeout=10)
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    if process.returncode != 0:
        raise CaseFailure("failed", _reason(errors, process.returncode))
    try:
        return json.loads(output.strip().splitlines()[-1])
    except (IndexError, ValueError):
        raise CaseFailure("failed", "ended without an answer") from None


def _reason(errors: str, status: int) -> str:
    """The last line that the case wrote itself: what mpirun says after it stands below a line of dashes."""
    lines = [line.strip() for line in errors.splitlines() if line.strip()]
    own = next((i for i, line in enumerate(lines) if set(line) == {"-"}), len(lines))
    if own:
        return lines[own - 1]
    return f"ended by {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
