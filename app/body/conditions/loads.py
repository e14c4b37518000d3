"""Loads: what each adds to Π at the end of a stage."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import ufl
from dolfinx import fem

from elastune.app.body.conditions.load import Load, Setting
from elastune.app.body.conditions.places import Place
from elastune.app.errors import UserError
from elastune.forms.expressions import Entry, symbolic
from elastune.forms.terms import DeadLoads, FollowerPressure, Foundation, NodalLoads, Term


@dataclass(frozen=True)
class Pull(Load):
    """A dead traction.

    Attributes:
        vector: Force per rest area, numbers or expressions of x, y, z, shape (d,).
    """

    vector: Sequence[Entry]

    @property
    def acts(self) -> bool:
        """Whether it is other than zero."""
        return any(self.vector)

    @classmethod
    def term(cls, loads: Mapping[Place, "Pull"], setting: Setting) -> Term:
        """Their work."""
        tractions = {place.name: setting.symbolic(load.vector) for place, load in loads.items()}
        return DeadLoads(setting.fields, setting.domain, tractions=tractions)


@dataclass(frozen=True)
class NormalPull(Load):
    """A dead traction along the outward normal at rest.

    Attributes:
        value: Force per rest area, a number or an expression of x, y, z.
    """

    value: Entry

    @property
    def acts(self) -> bool:
        """Whether it is other than zero."""
        return bool(self.value)

    @property
    def one_sided(self) -> bool:
        """A normal that is outward."""
        return True

    @classmethod
    def term(cls, loads: Mapping[Place, "NormalPull"], setting: Setting) -> Term:
        """Their work."""
        normal = ufl.FacetNormal(setting.domain.mesh)
        values = {place.name: symbolic(load.value, setting.X) for place, load in loads.items()}
        tractions = {name: _constant(value, setting) * normal for name, value in values.items()}
        return DeadLoads(setting.fields, setting.domain, tractions=tractions, name="normal_loads")


@dataclass(frozen=True)
class Moment(Load):
    """A dead couple: tractions about an axis that grow with the distance to it, and have no resultant force.

    Attributes:
        value: Torque about the axis at rest.
        axis: Of any length, shape (3,).
        center: A point of the axis, shape (2,) or (3,).
    """

    value: float
    axis: Sequence[float]
    center: Sequence[float]

    @property
    def acts(self) -> bool:
        """Whether it is other than zero."""
        return self.value != 0

    @classmethod
    def term(cls, loads: Mapping[Place, "Moment"], setting: Setting) -> Term:
        """Their work."""
        tractions = {place.name: load._traction(place, setting) for place, load in loads.items()}
        return DeadLoads(setting.fields, setting.domain, tractions=tractions, name="moments")

    def _traction(self, place: Place, setting: Setting) -> Any:
        """β (a × (X - c) - its mean), with the β that gives the torque.

        Raises:
            UserError: If all of the place lies on the axis.
        """
        mesh, d = setting.domain.mesh, setting.domain.mesh.geometry.dim
        comm, ds = mesh.comm, setting.domain.ds(place.name)
        axis = np.array(self.axis, dtype=np.float64) / np.linalg.norm(self.axis)
        center = np.pad(np.array(self.center, dtype=np.float64), (0, 3 - len(self.center)))
        X = [setting.X[i] if i < d else 0.0 for i in range(3)]
        arms = ufl.as_vector([x - c for x, c in zip(X, center, strict=True)])
        across = ufl.cross(ufl.as_vector(axis.tolist()), arms)
        turning = ufl.as_vector([across[i] for i in range(d)])
        one = fem.Constant(mesh, 1.0)

        def total(integrand: Any) -> float:
            return comm.allreduce(float(fem.assemble_scalar(fem.form(one * integrand * ds)).real))

        area = total(1)
        mean = fem.Constant(mesh, np.array([total(turning[i]) for i in range(d)]) / area)
        arm = total(ufl.inner(turning - mean, turning))
        if not arm > 1e-12 * area * max(total(ufl.inner(setting.X, setting.X)) / area, 1e-300):
            raise UserError(f"{place.key}.moment: expected a face with an extent around its axis")
        return fem.Constant(mesh, self.value / arm) * (turning - mean)


@dataclass(frozen=True)
class Pressure(Load):
    """A pressure on the deformed face, positive into the body."""

    value: float

    @property
    def acts(self) -> bool:
        """Whether it is other than zero."""
        return self.value != 0

    @property
    def one_sided(self) -> bool:
        """A side to press on."""
        return True

    @classmethod
    def term(cls, loads: Mapping[Place, "Pressure"], setting: Setting) -> Term:
        """The pressure times the enclosed volume, where there is one."""
        pressures = {place.name: load.value for place, load in loads.items()}
        return FollowerPressure(setting.fields, setting.domain, pressures, setting.held)


@dataclass(frozen=True)
class Spring(Load):
    """An elastic foundation, whose force is proportional to the displacement; the same in all stages.

    Attributes:
        stiffness: Force per rest area and displacement, along each axis, shape (d,).
    """

    stiffness: Sequence[float]
    steady: ClassVar[bool] = True

    @classmethod
    def term(cls, loads: Mapping[Place, "Spring"], setting: Setting) -> Term:
        """Its energy."""
        ((place, load),) = loads.items()
        return Foundation(setting.fields, setting.domain, place.name, load.stiffness)


@dataclass(frozen=True)
class Force(Load):
    """A dead force, shared out evenly over a point, a curve or a face.

    Attributes:
        vector: Shape (d,).
    """

    vector: Sequence[float]

    @property
    def acts(self) -> bool:
        """Whether it is other than zero."""
        return any(self.vector)

    @classmethod
    def term(cls, loads: Mapping[Place, "Force"], setting: Setting) -> Term:
        """Their work."""
        V = setting.fields.u.function_space
        forces = np.zeros((len(V.tabulate_dof_coordinates()), V.dofmap.index_map_bs))
        for place, load in loads.items():
            forces += place.weights(setting.geometry, V)[:, None] * np.array(load.vector)
        return NodalLoads(setting.fields, forces)


@dataclass(frozen=True)
class BodyForce(Load):
    """A dead load on the volume.

    Attributes:
        vector: Force per rest volume, numbers or expressions of x, y, z, shape (d,).
    """

    vector: Sequence[Entry]

    @property
    def acts(self) -> bool:
        """Whether it is other than zero."""
        return any(self.vector)

    @classmethod
    def term(cls, loads: Mapping[Place, "BodyForce"], setting: Setting) -> Term:
        """Its work."""
        (load,) = loads.values()
        return DeadLoads(setting.fields, setting.domain, setting.symbolic(load.vector), name="body_force")


def _constant(value: Any, setting: Setting) -> Any:
    """A number as a constant: a new one needs no new code."""
    return fem.Constant(setting.domain.mesh, float(value)) if isinstance(value, int | float) else value
