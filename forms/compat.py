"""The calls that differ between releases of dolfinx."""

from importlib.metadata import version
from typing import Any

import dolfinx
import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

_BEFORE_0_10 = tuple(int(part) for part in version("fenics-dolfinx").split(".")[:2]) < (0, 10)


def index_map(comm: Any, owned: int, ghosts: NDArray[np.int64], owners: NDArray[np.int32]) -> Any:
    """The map of indices distributed over ranks; collective.

    Args:
        comm: Whose ranks.
        owned: Number of indices of this rank.
        ghosts: Global indices of others that it knows.
        owners: Their ranks.
    """
    # From 0.10 on, the tag of its messages.
    tag = () if _BEFORE_0_10 else (1202,)
    return dolfinx.common.IndexMap(comm, owned, ghosts, owners, *tag)


def with_dofmap(space: fem.FunctionSpace, dofmap: Any) -> fem.FunctionSpace:
    """A space of scalars with other degrees of freedom, given as dolfinx's own object in C++."""
    mesh, element = space.mesh, space._cpp_object.element
    # Until 0.9, the shape of the values.
    shape: tuple[Any, ...] = ([],) if _BEFORE_0_10 else ()
    own = dolfinx.cpp.fem.FunctionSpace_float64(mesh._cpp_object, element, dofmap, *shape)
    return fem.FunctionSpace(mesh, space.ufl_element(), own)
