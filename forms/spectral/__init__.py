"""One compiled kernel in principal-stretch space for every isotropic energy.

Energy, residual and tangent of any material of the catalogue, on any cell, from the three first and six second
derivatives of ψ in the stretches: exact where forms through eigenvalues are not, and at small strain.
"""

from elastune.forms.spectral.assembly import SpectralForms
from elastune.forms.spectral.build import SpectralError
from elastune.forms.spectral.choice import fastest
from elastune.forms.spectral.points import pointwise, stress

__all__ = ["SpectralError", "SpectralForms", "fastest", "pointwise", "stress"]
