"""gmsh on rank 0: started and ended in one place, its failures raised on every rank."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

from elastune.geometry.errors import GeometryError

if TYPE_CHECKING:
    from mpi4py import MPI

T = TypeVar("T")


def on_root(comm: MPI.Comm, task: Callable[[], T]) -> T | None:
    """Run a task on rank 0, whose failure is everybody's; collective.

    Args:
        comm: Communicator of all who call.
        task: Called on rank 0 only.

    Returns:
        The task's result on rank 0, None elsewhere.

    Raises:
        GeometryError: On every rank, whatever the task raised on rank 0: ranks that waited for a mesh
            would wait for ever otherwise.
    """
    failure: str | None = None
    cause: Exception | None = None
    result: T | None = None
    if comm.rank == 0:
        try:
            result = task()
        except GeometryError as error:
            failure, cause = str(error), error
        except Exception as error:
            text = " ".join(str(error).split()) or type(error).__name__
            failure, cause = f"gmsh: expected a mesh, got the error: {text}", error
    failure = comm.bcast(failure, root=0)
    if failure is not None:
        raise GeometryError(failure) from cause
    return result


@contextmanager
def session(comm: MPI.Comm) -> Iterator[Any]:
    """Open an empty gmsh model on rank 0, and remove it at the end.

    A gmsh that the caller has started is used and left running; otherwise it is started and ended here.

    Yields:
        `gmsh.model` on rank 0, None elsewhere.
    """
    started = on_root(comm, _start)
    try:
        yield _gmsh().model if comm.rank == 0 else None
    finally:
        if comm.rank == 0:
            if started:
                _gmsh().finalize()
            else:
                _gmsh().model.remove()


def _start() -> bool:
    gmsh = _gmsh()
    started = not gmsh.isInitialized()
    if started:
        # Interruptible, gmsh would take SIGINT from Python; the user's gmshrc would make meshes differ.
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("elastune")
    return bool(started)


def _gmsh() -> Any:
    import gmsh

    return gmsh
