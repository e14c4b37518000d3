"""What computed the results: releases, and the memory that it took."""

import platform
import resource
import sys

import dolfinx
from mpi4py import MPI

from elastune import __version__


def versions() -> dict[str, str]:
    """Releases of what computed the results."""
    from petsc4py import PETSc

    return {
        "elastune": __version__,
        "dolfinx": dolfinx.__version__,
        "petsc": ".".join(map(str, PETSc.Sys.getVersion())),  # type: ignore[attr-defined]
        "python": platform.python_version(),
    }


def peak_memory_mb(comm: MPI.Comm) -> float:
    """Sum over the ranks of the most memory that each has had, in 10⁶ bytes."""
    unit = 1 if sys.platform == "darwin" else 1024
    return comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6)
