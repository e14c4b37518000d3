"""Linear elasticity, for comparison: it is not objective and knows no large deformation."""

from elastune.forms.energy import Modulus, Parts, PositiveModulus, material
from elastune.forms.kinematics import PrincipalStretches


@material(
    "linear-elasticity",
    "Marschner, linear elasticity",
    lame=lambda lam, mu: (lam, mu),
    inverts=True,
    objective=False,
)
def linear_elasticity(s: PrincipalStretches, lam: Modulus = 1.0, mu: PositiveModulus = 1.0) -> Parts:
    """ψ = μ ε:ε + λ/2 tr²ε,  ε = sym F - I."""
    trace, squared = s.small_strain
    return Parts(mu * squared, lam, trace**2 / 2)
