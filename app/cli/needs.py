"""What a command needs that pip does not install, looked for before it starts."""

import os
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

from elastune.app.errors import UserError

OLDEST = (0, 9)
# In the order in which they load each other.
FENICSX = ("ufl", "basix", "ffcx", "mpi4py", "petsc4py", "petsc4py.PETSc", "slepc4py", "dolfinx")
WAYS = (
    'conda create -n elastune -c conda-forge fenics-dolfinx "petsc=*=real*" slepc4py python-gmsh, '
    "or ./run elastune in a checkout"
)


def configure_petsc(options: Sequence[str] = ()) -> None:
    """Before PETSc starts, which reads some of its options only then, such as -log_view.

    A closed pipe or an interrupt is Python's to handle, not a crash for PETSc to report.
    """
    os.environ["PETSC_OPTIONS"] = " ".join([os.environ.get("PETSC_OPTIONS", ""), "-no_signal_handler", *options])


def present() -> None:
    """Looks for FEniCSx without loading it: who starts other processes must not start MPI.

    Raises:
        UserError: If some of it is missing, or dolfinx is too old.
    """
    for name in reversed(FENICSX):
        if find_spec(name.partition(".")[0]) is None:
            raise UserError(_lacking(f"{name} is missing"))
    try:
        _recent(version("fenics-dolfinx"))
    except PackageNotFoundError:
        # Built by hand; what loads it asks again.
        pass
    if find_spec("gmsh") is None:
        raise UserError("gmsh is missing: pip install gmsh, or conda install -c conda-forge python-gmsh")


def usable() -> None:
    """Loads FEniCSx, which what follows is about to use.

    Raises:
        UserError: If it cannot be loaded, is too old, or computes with complex numbers.
    """
    present()
    for name in FENICSX:
        try:
            module = import_module(name)
        except (ImportError, RuntimeError) as error:
            raise UserError(_lacking(f"{name} cannot be loaded: {error}")) from None
        if name == "petsc4py.PETSc" and issubclass(module.ScalarType, complex):
            raise UserError(_lacking("this PETSc computes with complex numbers"))
    _recent(module.__version__)


def missing(error: ImportError) -> UserError:
    """What to say of a module that could not be loaded."""
    name = (error.name or "").partition(".")[0]
    if name in FENICSX:
        return UserError(_lacking(f"{name} cannot be loaded: {error}"))
    if isinstance(error, ModuleNotFoundError):
        return UserError(f"{name} is missing: pip install {name}")
    return UserError(f"{name} cannot be loaded: {error}")


def _recent(found: str) -> None:
    numbers = tuple(int(part) for part in found.split(".")[:2])
    if numbers < OLDEST:
        raise UserError(_lacking(f"found dolfinx {found}"))


def _lacking(what: str) -> str:
    return f"{what}; expected dolfinx >= {OLDEST[0]}.{OLDEST[1]} with real-valued PETSc and slepc4py: {WAYS}"
