"""Which forms UFL assembles faster than the kernel."""

from dolfinx.fem import Function

from forms.energy import Energy
from forms.kinematics import GradientMeasures, deformation_gradient


def fastest(energy: Energy, u: Function, extended: bool = False) -> dict[str, str]:
    """What assembles each form faster, for an unfiltered tangent: "ufl" or "spectral".

    Where an energy needs no stretches, UFL's energy and residual are a few products at each point: less than a
    decomposition of F on simplices and in the plane, more on hexahedra, where the kernel works on eight points at
    once. UFL's tangent is the faster one on linear triangles only. The price of "ufl" is digits at small strain:
    its stress has an absolute error of rounding, the kernel's a relative one.

    Args:
        energy: Any energy.
        u: Displacement.
        extended: Whether an extension is asked for, which UFL forms do not have.

    Returns:
        "ufl" or "spectral" by the names "energy", "residual" and "tangent".
    """
    measures = GradientMeasures(deformation_gradient(u))
    energy.density(measures)
    cell = u.function_space.mesh.basix_cell().name
    order = u.function_space.ufl_element().basix_element.degree
    if extended or measures.uses_eigenvalues or cell == "hexahedron":
        return dict.fromkeys(("energy", "residual", "tangent"), "spectral")
    return {"energy": "ufl", "residual": "ufl", "tangent": "ufl" if (cell, order) == ("triangle", 1) else "spectral"}
