"""Stresses of a material in a homogeneous test, at many loads and for many values of its parameters at once."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import ufl
from numpy.typing import ArrayLike

from elastune.app.tuning.follow import follow
from elastune.app.tuning.tests import TESTS, Array, Test
from elastune.forms.energy import Energy, MaterialError
from elastune.forms.evaluation import as_numpy
from elastune.forms.kinematics import PrincipalStretches


class Curve(NamedTuple):
    """What a test measures, not a number beyond the end of the branch of equilibria that begins at rest.

    Attributes:
        stress: Nominal stress of each load, in the unit of the moduli: of a stretch, force per rest area of the face;
            of γ, shear stress; of a volume ratio, mean Cauchy stress. Shape (..., loads, n).
        free: Stretch in the direction that is free, one where none is. Shape (..., n).
    """

    stress: Array
    free: Array


class Slopes(NamedTuple):
    """Exact derivatives of the stresses of a `Curve`, the free stretch in balance.

    Attributes:
        loads: By the loads, shape (..., loads, loads, n).
        constants: By the parameter values, shape (..., k, loads, n).
    """

    loads: Array
    constants: Array


class Response:
    """The stress of an energy in a test.

    ψ of the test's stretches is a function of loads, free stretch and parameters, which UFL differentiates: the
    stress is its derivative by the load, and zero its derivative by the free stretch.
    """

    def __init__(self, energy: Energy, test: Test | str, incompressible: bool | None = None) -> None:
        """Differentiates; the values of the parameters come later.

        Args:
            energy: Strain-energy density, at rest at F = I.
            test: One of `TESTS`, or its name.
            incompressible: Whether the volume is constant and the λ part left out; if the energy is unless given.

        Raises:
            MaterialError: If the energy has no such test.
        """
        self.energy = energy
        self.test = TESTS[test] if isinstance(test, str) else test
        self.incompressible = energy.incompressible if incompressible is None else incompressible
        if self.incompressible and self.test.name == "volumetric":
            raise MaterialError(f"{energy.name}: incompressible; expected another test than a volumetric one")
        if not energy.objective and (self.incompressible or self.test.name == "shear"):
            raise MaterialError(f"{energy.name}: not a function of stretches; expected another material")
        self._loads = [_variable() for _ in self.test.loads]
        self._free, self._constants = _variable(), [_variable() for _ in energy.constants()]
        free = self._free
        if self.incompressible and self.test.free is not None:
            free = self.test.free(self._loads)
        stretches = [ufl.as_ufl(stretch) for stretch in self.test.stretches(self._loads, free)]
        values = energy.unpack(self._constants)
        own = energy.shear if self.incompressible else energy
        psi = ufl.as_ufl(own.density(PrincipalStretches(stretches), values))
        self._stress = [ufl.diff(psi, load) / self.test.share for load in self._loads]
        self._balance = ufl.diff(psi, self._free) if self._is_free else None
        self._arguments = [*self._loads, self._free, *self._constants]

    @property
    def _is_free(self) -> bool:
        return self.test.free is not None and not self.incompressible

    def curve(self, loads: ArrayLike, constants: ArrayLike | None = None) -> Curve:
        """Stress and free stretch.

        Args:
            loads: Shape (n,), or (loads, n) with several; in any order.
            constants: Parameter values in the order of `Energy.constants`, shape (..., k); the energy's own by default.

        Raises:
            MaterialError: If a load is impossible.
        """
        x, columns, shape = self._prepared(loads, constants)
        free = self._free_stretch(x, columns, shape)
        stress = _stacked(self._stresses(*x, free, *columns), shape)
        return Curve(np.where(np.isnan(free)[..., None, :], np.nan, stress), free)

    def slopes(self, loads: ArrayLike, constants: ArrayLike | None = None) -> tuple[Curve, Slopes]:
        """The curve with its exact derivatives; see `curve`."""
        x, columns, shape = self._prepared(loads, constants)
        free = self._free_stretch(x, columns, shape)
        count, number = len(x), len(self._arguments)
        values = _stacked(self._all(*x, free, *columns), shape)
        stress, values = values[..., :count, :], values[..., count:, :]
        partial = values.reshape(*shape[:-1], -1, number, shape[-1])
        total = partial[..., :count, :, :]
        if self._is_free:
            balance = partial[..., count, :, :]
            change = -balance / balance[..., count, None, :]
            total = total + total[..., count, None, :] * change[..., None, :, :]
        total = np.where(np.isnan(free)[..., None, None, :], np.nan, total)
        by_constants = np.moveaxis(total[..., count + 1 :, :], -3, -2)
        stress = np.where(np.isnan(free)[..., None, :], np.nan, stress)
        return Curve(stress, free), Slopes(total[..., :count, :], by_constants)

    # ------------------------------------------------------------------ compiled when first asked for

    @cached_property
    def _stresses(self) -> Any:
        return as_numpy(self._stress, self._arguments)

    @cached_property
    def _all(self) -> Any:
        """The stresses, then the derivatives of each, and of the balance, by every argument."""
        rows = [*self._stress, *([] if self._balance is None else [self._balance])]
        slopes = [ufl.diff(row, argument) for row in rows for argument in self._arguments]
        return as_numpy([*self._stress, *slopes], self._arguments)

    @cached_property
    def _equilibrium(self) -> Any:
        """The balance and its derivatives by the free stretch and the loads."""
        slopes = [ufl.diff(self._balance, argument) for argument in (self._free, *self._loads)]
        return as_numpy([self._balance, *slopes], self._arguments)

    def _prepared(self, loads: ArrayLike, constants: ArrayLike | None) -> tuple[Array, list[Array], tuple[int, ...]]:
        """Loads, a column of each constant, and the shape of the points."""
        x = self.test.check(loads)
        given = np.asarray(self.energy.constants() if constants is None else constants, dtype=np.float64)
        columns = [given[..., i, None] for i in range(len(self._constants))]
        return x, columns, (*given.shape[:-1], x.shape[1])

    def _free_stretch(self, x: Array, columns: Sequence[Array], shape: tuple[int, ...]) -> Array:
        if self._is_free:
            return follow(self._equilibrium, x, columns, shape)
        free = np.ones(x.shape[1]) if self.test.free is None else self.test.free(list(x))
        return np.broadcast_to(np.asarray(free, dtype=np.float64), shape)


def respond(energy: Energy, test: str, loads: ArrayLike) -> Curve:
    """Stress and free stretch of an energy in a test, for one load of shape (n,) each.

    Args:
        energy: Strain-energy density, at rest at F = I; at constant volume if incompressible.
        test: Name of one of `TESTS`.
        loads: Shape (n,), or (loads, n) with several.

    Returns:
        Stress of the shape of the loads, free stretch of shape (n,).

    Raises:
        MaterialError: If the energy has no such test, or a load is impossible.
    """
    curve = Response(energy, test).curve(loads)
    return Curve(curve.stress[0], curve.free) if len(TESTS[test].loads) == 1 else curve


def _variable() -> Any:
    return ufl.variable(ufl.as_ufl(1.0))


def _stacked(values: Sequence[Any], shape: tuple[int, ...]) -> Array:
    return np.stack([np.broadcast_to(value, shape) for value in values], axis=-2)
