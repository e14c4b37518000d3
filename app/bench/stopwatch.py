"""Seconds of calls that take turns, and a form's kernel and assembly as such calls."""

import ctypes
import time
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import dolfinx.fem.petsc
import numpy as np
from dolfinx import fem, la
from numpy.typing import NDArray

from elastune.forms.spectral import build

Call = Callable[[], Any]
SWEEP = Path(__file__).with_name("sweep.c")


def interleaved(calls: Mapping[Any, Call], repeats: int) -> dict[Any, NDArray[np.float64]]:
    """Processor seconds of each call in each round; they take turns, so that what slows the machine slows all alike.

    What other processes take of the processor does not count, which elapsed time would let in.
    """
    seconds: dict[Any, list[float]] = {name: [] for name in calls}
    for call in calls.values():
        call()
    for _ in range(repeats):
        for name, call in calls.items():
            began = time.thread_time()
            call()
            seconds[name].append(time.thread_time() - began)
    return {name: np.array(values) for name, values in seconds.items()}


def tabulation(form: fem.Form, name: str, u: fem.Function) -> Call:
    """The kernel of a form on all cells, with the constants that the form has now.

    Args:
        form: With one integral, over cells, of the coefficient u.
        name: Of the kernel, if the form is one of `SpectralForms`.
        u: The coefficient.
    """
    V = u.function_space
    dofs = V.dofmap.list
    w = np.ascontiguousarray(u.x.array.reshape(-1, V.dofmap.bs)[dofs])
    x = np.ascontiguousarray(V.mesh.geometry.x[V.mesh.geometry.dofmap])
    c = np.array(dolfinx.cpp.fem.pack_constants(form._cpp_object))
    A = np.empty(w[0].size ** form.rank)
    arguments = (
        ctypes.c_void_p(_address(form, name)),
        ctypes.c_int64(len(dofs)),
        A.ctypes.data_as(ctypes.c_void_p),
        ctypes.c_int64(A.size),
        w.ctypes.data_as(ctypes.c_void_p),
        ctypes.c_int64(w[0].size),
        c.ctypes.data_as(ctypes.c_void_p),
        x.ctypes.data_as(ctypes.c_void_p),
        ctypes.c_int64(x[0].size),
    )
    sweep = _library().sweep
    arrays = A, w, c, x

    def call(held: Any = arrays) -> None:
        # The addresses are good as long as the arrays are held.
        sweep(*arguments)

    return call


def assembly(form: fem.Form, targets: dict[int, Any]) -> Call:
    """A form's scalar, vector or PETSc matrix.

    Args:
        form: Any.
        targets: Vectors and matrices of the same space by rank, which are used again.
    """
    if form.rank == 0:
        return lambda: fem.assemble_scalar(form)
    if form.rank not in targets:
        targets[form.rank] = _empty(form)
    target = targets[form.rank]

    def vector() -> None:
        target.array[:] = 0
        fem.assemble_vector(target.array, form)

    def matrix() -> None:
        target.zeroEntries()
        dolfinx.fem.petsc.assemble_matrix(target, form)
        target.assemble()

    return vector if form.rank == 1 else matrix


def _empty(form: fem.Form) -> Any:
    """A vector or a matrix for a form."""
    if form.rank == 2:
        return dolfinx.fem.petsc.create_matrix(form)
    dofmap = form.function_spaces[0].dofmap
    return la.vector(dofmap.index_map, dofmap.index_map_bs)


def _address(form: fem.Form, name: str) -> int:
    if isinstance(form.module, ctypes.CDLL):
        return build.address(form.module, name)
    integral = form.ufcx_form.form_integrals[0]
    return int(form.module.ffi.cast("uintptr_t", integral.tabulate_tensor_float64))


@cache
def _library() -> ctypes.CDLL:
    return build.load(str(SWEEP), SWEEP.read_text(), str)
