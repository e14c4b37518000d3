"""The calls that differ between dolfinx and FFCx releases."""

from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import ffcx.compiler
import ffcx.options
import numpy as np
from dolfinx.fem import Form, Function, FunctionSpace, IntegralType, form_cpp_class

_BEFORE_0_10 = tuple(int(part) for part in version("fenics-dolfinx").split(".")[:2]) < (0, 10)


def custom_form(
    kernel: int,
    spaces: Sequence[FunctionSpace],
    u: Function,
    constants: Sequence[Any],
    library: Any,
    cells: np.ndarray | None = None,
) -> Form:
    """A form over cells of the mesh of u, with one kernel of the UFCx signature.

    Args:
        kernel: Address of the kernel.
        spaces: Test and trial spaces, none for a functional.
        u: The only coefficient.
        constants: dolfinx constants, packed one after the other.
        library: What must stay alive as long as the form.
        cells: Those of this rank; all that it owns by default.
    """
    mesh = u.function_space.mesh
    if cells is None:
        cells = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local, dtype=np.int32)
    integrals = {IntegralType.cell: [(0, kernel, cells, np.array([0], dtype=np.int8))]}
    form = form_cpp_class(np.float64)(
        [space._cpp_object for space in spaces],
        integrals,
        [u._cpp_object],
        [constant._cpp_object for constant in constants],
        False,
        # Entity maps: a dictionary until 0.9, a list from 0.10 on.
        {} if _BEFORE_0_10 else [],
        mesh=mesh._cpp_object,
    )
    return Form(form, None, "", library)


def expression_code(expression: Any, points: np.ndarray) -> str:
    """FFCx's C source of a UFL expression tabulated at points."""
    options = ffcx.options.get_options({"scalar_type": np.float64})
    header_and_source = ffcx.compiler.compile_ufl_objects([(expression, points)], options=options)
    # Until 0.9 (header, source), from 0.10 on ([header, source], suffixes).
    files = header_and_source if isinstance(header_and_source[0], str) else header_and_source[0]
    return str(files[1])
