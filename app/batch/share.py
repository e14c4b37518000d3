"""Cases that ranks take one by one: who is done takes the next, and nobody only hands out."""

from collections.abc import Iterator, Sequence
from typing import TypeVar

import numpy as np
from mpi4py import MPI

T = TypeVar("T")


def share(cases: Sequence[T], comm: MPI.Intracomm) -> Iterator[T]:
    """Those of some cases that this rank has to run; every case goes to one rank.

    A counter in the memory of rank 0 says which is next, and each rank raises it without asking rank 0. Collective
    at the start and at the end.

    Args:
        cases: The same on every rank, those that take longest first.
        comm: Its ranks share them.
    """
    if comm.size == 1:
        yield from cases
        return
    counter = MPI.Win.Allocate(np.dtype(np.int64).itemsize if comm.rank == 0 else 0, comm=comm)
    if comm.rank == 0:
        np.frombuffer(counter.tomemory(), dtype=np.int64)[:] = 0
    comm.barrier()
    one, number = np.ones(1, dtype=np.int64), np.zeros(1, dtype=np.int64)
    while True:
        counter.Lock(0)
        counter.Fetch_and_op(one, number, 0)
        counter.Unlock(0)
        if number[0] >= len(cases):
            break
        yield cases[int(number[0])]
    comm.barrier()
    counter.Free()
