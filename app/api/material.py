"""Materials in Python: an energy by name or by formula, calibrated and tuned, as a function of F."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from elastune.app.api.curves import Curves
from elastune.forms.energy import Energy, MaterialError, describe
from elastune.forms.energy import Material as Entry
from elastune.forms.materials import CATALOGUE, get
from elastune.forms.normalize import Linearization, linearize
from elastune.forms.tuned import tuned_energy

Array = NDArray[np.float64]


def materials() -> dict[str, Entry]:
    """The catalogue by name; each entry has `formula`, `source`, `notes`, `parameters` and `options`."""
    return dict(CATALOGUE)


@dataclass(frozen=True, repr=False)
class Material(Curves):
    """A material with values of its parameters.

    Attributes:
        energy: Its strain-energy density.
        formula: ψ before tuning, or nothing.
        source: Where ψ is defined, or nothing.
    """

    energy: Energy
    formula: str
    source: str

    def __repr__(self) -> str:
        values = {"E": self.E, "nu": self.nu, **self.parameters}
        return f"<{self.energy.name}: {', '.join(f'{name} = {_short(value)}' for name, value in values.items())}>"

    # ------------------------------------------------------------------ at rest

    @cached_property
    def _at_rest(self) -> Linearization:
        return linearize(self.energy)

    @property
    def E(self) -> float:
        """Young's modulus at rest."""
        return self._at_rest.youngs_modulus

    @property
    def nu(self) -> float:
        """Poisson's ratio at rest."""
        return self._at_rest.poissons_ratio

    @property
    def lame(self) -> tuple[float, float]:
        """(λ_Lamé, μ_Lamé) at rest."""
        return self._at_rest.lame_lambda, self._at_rest.lame_mu

    @property
    def parameters(self) -> dict[str, Any]:
        """Values of the parameters of the formula and of the tuning: numbers, or tuples of numbers."""
        return dict(self.energy.values)

    # ------------------------------------------------------------------ under strain

    def psi(self, F: ArrayLike) -> Array:
        """Strain energy per rest volume; not a number where ψ is undefined.

        Args:
            F: Deformation gradients, shape (..., 3, 3).

        Returns:
            Shape (...).

        Raises:
            MaterialError: If F has another shape, or the material is incompressible.
        """
        H, shape = self._gradients(F)
        return _response().first(self.energy, H)[0].reshape(shape)

    def P(self, F: ArrayLike) -> Array:
        """First Piola-Kirchhoff stress ∂ψ/∂F.

        Args:
            F: Deformation gradients, shape (..., 3, 3).

        Returns:
            Shape (..., 3, 3).

        Raises:
            MaterialError: If F has another shape, or the material is incompressible.
        """
        H, shape = self._gradients(F)
        return _response().first(self.energy, H)[1].reshape(*shape, 3, 3)

    def dPdF(self, F: ArrayLike) -> Array:
        """Tangent ∂P/∂F.

        Args:
            F: Deformation gradients, shape (..., 3, 3).

        Returns:
            Shape (..., 3, 3, 3, 3): [..., i, j, k, l] is ∂P_ij/∂F_kl.

        Raises:
            MaterialError: If F has another shape, or the material is incompressible.
        """
        H, shape = self._gradients(F)
        return _response().second(self.energy, H)[2].reshape(*shape, 3, 3, 3, 3)

    def _gradients(self, F: ArrayLike) -> tuple[Array, tuple[int, ...]]:
        """F - I as a list, shape (n, 3, 3), and the shape that F is an array of."""
        self._check_compressible()
        try:
            given = np.asarray(F, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise MaterialError(f"F: expected numbers of shape (..., 3, 3): {error}") from None
        if given.shape[-2:] != (3, 3):
            raise MaterialError(f"F: expected shape (..., 3, 3), got {given.shape}")
        return given.reshape(-1, 3, 3) - np.eye(3), given.shape[:-2]

    def _check_compressible(self) -> None:
        if self.energy.incompressible:
            raise MaterialError(f"{self.energy.name}: has no energy of F alone at nu = 0.5; expected nu below 0.5")


def material(
    formula: str | Callable[..., Any],
    E: float | None = None,
    nu: float | None = None,
    *,
    alpha: float | None = None,
    alpha_lambda: float | None = None,
    alpha_mu: float | None = None,
    volume: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    calibrate: str | Sequence[str] | None = None,
    inverts: bool | None = None,
) -> Material:
    """A material of the catalogue, or of your own.

    A formula of your own is a function of stretch measures and parameters, with UFL's functions, that returns ψ or,
    to have a λ part, its `Parts`; nothing is registered:

        def mine(s, lam: elastune.Modulus = 1.0, mu: elastune.PositiveModulus = 1.0):
            '''ψ = μ/2 (I₁ - 3) - μ log J + λ/2 (J - 1)².'''
            return elastune.Parts(mu / 2 * (s.I1 - 3) - mu * ufl.ln(s.J), lam, (s.J - 1) ** 2 / 2)

    `s` has `I1`, `I2`, `J`, `stretches` and `areas`; the annotations of the parameters are `Modulus`,
    `PositiveModulus`, `Number` or `Exponent`. ψ must be at rest at F = I.

    Args:
        formula: Name in the catalogue, see `materials`, or a function.
        E: Young's modulus, in the unit of stress; without E and nu the parameters stand as given.
        nu: Poisson's ratio; 0.5 for mixed elements only.
        alpha: Nonlinearity exponent: the same at rest, stiffer when stretched if above 1.
        alpha_lambda: Exponent of the λ part alone.
        alpha_mu: Exponent of the μ part alone.
        volume: Name of the material whose λ part is taken.
        parameters: Parameters and options of the formula that differ from its defaults.
        calibrate: Two parameters to solve for, or "least"; see `elastune.forms.normalize.calibrate`.
        inverts: Of a function: whether ψ is defined for J <= 0; no unless given.

    Raises:
        MaterialError: If the material cannot be what is asked for; one line.
    """
    if isinstance(formula, str):
        if inverts is not None:
            raise MaterialError(f"{formula}: inverts is known of the catalogue; expected it with a function only")
        entry = get(formula)
    else:
        entry = _own(formula, bool(inverts))
    try:
        energy = tuned_energy(
            entry, E, nu, alpha, alpha_lambda, alpha_mu, volume, parameters, calibrate, mixed=nu == 0.5
        )
    except MaterialError:
        raise
    except Exception as error:
        if isinstance(formula, str):
            raise
        # Whatever a formula that is not ours may raise, numpy's functions of UFL's symbols first of all.
        raise MaterialError(f"{entry.name}: {error}; expected a formula with UFL's functions") from error
    return Material(energy, entry.formula, entry.source)


def _own(function: Callable[..., Any], inverts: bool) -> Entry:
    """A function as an entry that is in no catalogue."""
    name = getattr(function, "__name__", "")
    try:
        entry = describe(function, name if name.isidentifier() else "material", inverts=inverts)
    except (TypeError, NameError) as error:
        raise MaterialError(str(error)) from None
    moduli = tuple(p.name for p in entry.parameters if p.bounds.modulus and not isinstance(p.default, tuple))
    return replace(entry, pair=moduli) if len(moduli) == 2 else entry


def _response() -> Any:
    """Loaded late: it brings dolfinx, which calibration and curves do without."""
    from elastune.forms import response

    return response


def _short(value: Any) -> str:
    if isinstance(value, tuple):
        return f"({', '.join(map(_short, value))})"
    # + 0.0: no minus before a zero.
    return f"{value + 0.0:.4g}"
