"""Which forms UFL assembles faster than the kernel."""

from dolfinx.fem import Function

from elastune.forms.energy import Energy
from elastune.forms.kinematics import GradientMeasures, deformation_gradient


def needs_eigenvalues(energy: Energy, u: Function) -> bool:
    """Whether ψ(F) takes more than invariants: eigenvalues of C."""
    measures = GradientMeasures(deformation_gradient(u))
    energy.density(measures)
    return measures.uses_eigenvalues


def fastest(energy: Energy, u: Function, extended: bool = False) -> dict[str, str]:
    """What assembles each form faster, for an unfiltered tangent: "ufl" or "spectral".

    Where an energy needs no stretches, UFL's energy and residual are a few products at each point: less than a
    decomposition of F on simplices, in the plane about as much as one, or less with powers and logarithms, and more
    on hexahedra, where the kernel works on eight points at once. The kernel's tangent is as fast as UFL's on linear
    triangles and faster elsewhere. The price of "ufl" is digits at small strain: its stress has an absolute error of
    rounding, the kernel's a relative one.

    Args:
        energy: Any energy.
        u: Displacement.
        extended: Whether an extension is asked for, which UFL forms do not have.

    Returns:
        "ufl" or "spectral" by the names "energy", "residual" and "tangent".
    """
    hexahedron = u.function_space.mesh.basix_cell().name == "hexahedron"
    first = "spectral" if extended or hexahedron or needs_eigenvalues(energy, u) else "ufl"
    return {"energy": first, "residual": first, "tangent": "spectral"}
