"""Which forms UFL assembles faster than the kernel."""

from dolfinx.fem import Function

from forms.energy import Energy
from forms.kinematics import GradientMeasures, deformation_gradient


def fastest(energy: Energy, u: Function, extended: bool = False) -> dict[str, str]:
    """What assembles each form faster, for an unfiltered tangent: "ufl" or "spectral".

    Where an energy needs no stretches, UFL's energy and residual are a few products at each point: less than a
    decomposition of F on linear triangles and on tetrahedra, more elsewhere, where the kernel works on several points
    at once. The kernel's tangent is nowhere the slower one. The price of "ufl" is digits at small strain: its stress
    has an absolute error of rounding, the kernel's a relative one.

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
    cheap = cell == "tetrahedron" or (cell == "triangle" and order == 1)
    first = "ufl" if cheap and not (extended or measures.uses_eigenvalues) else "spectral"
    return {"energy": first, "residual": first, "tangent": "spectral"}
