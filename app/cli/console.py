"""Standard output as people and other programs want it: marked up on a terminal, plain and unbroken anywhere else."""

import os

from rich.console import Console

# Launchers tell their ranks who they are; their pipes look like terminals, and are none.
LAUNCHERS = ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK")


def console(wrap: bool = True, quiet: bool = False) -> Console:
    """Standard output.

    Args:
        wrap: Whether long lines are broken between words on a terminal; they never are in a pipe or a file.
        quiet: Whether nothing is shown.
    """
    terminal = os.isatty(1) and not any(name in os.environ for name in LAUNCHERS)
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") in ("dumb", "unknown")
    return Console(
        force_terminal=None if terminal and not plain else False,
        soft_wrap=not (terminal and wrap),
        highlight=False,
        quiet=quiet,
    )
