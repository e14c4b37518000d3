"""A body: its mesh with elements and material, what happens to its faces, and Π as a sum of terms."""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Literal

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from elastune.app.body.assembly import Assembly
from elastune.app.body.conditions import rigid
from elastune.app.body.conditions.constraints import Constraints
from elastune.app.body.conditions.load import Setting
from elastune.app.body.conditions.motions import Condition
from elastune.app.body.conditions.places import Place
from elastune.app.body.conditions.stages import Given, staged
from elastune.app.body.conditions.terms import by_place, check, load_terms, steady_terms
from elastune.app.body.regions.parts import Parts
from elastune.app.body.regions.pressures import Pressures
from elastune.app.body.regions.solids import Solid, Solids, filled, numbered
from elastune.app.body.unknowns import Layout, State
from elastune.app.body.volume import Volume
from elastune.app.errors import UserError
from elastune.forms.elements import ELEMENTS
from elastune.forms.energy import Energy
from elastune.forms.points import Points
from elastune.forms.spaces import displacement_space, pressure_space
from elastune.forms.terms import Domain, Fields, PressureField, Share, Term, face_degree
from elastune.geometry import Geometry

Array = NDArray[np.float64]


class Body:
    """What solvers, load paths and results see of a problem.

    Attributes:
        geometry: Mesh and named faces.
        solids: What it is made of, by region.
        element: Name of the element.
        quadrature: Degree of the volume quadrature.
        stages: What happens at the end of each stage, by place.
        u: The displacement.
        p: The pressure, or None.
        layout: Of the vectors.
        constraints: What holds the body.
        held: Mask of the prescribed unknowns, a vector.
        foundations: The terms of springs and the like, with their places.
        parts: Its cells, by what they are made of.
        pressures: Integrals over them.
        terms: All terms of Π.
        assembly: What they add up to.
    """

    def __init__(
        self,
        geometry: Geometry,
        material: Energy | Solids,
        element: str,
        conditions: Given,
        *,
        stages: Sequence[Given] = (),
        free: bool = False,
        quadrature: int | None = None,
        assembly: Literal["auto", "ufl", "spectral"] = "auto",
        more: Callable[[Fields, Domain], Sequence[Term]] = lambda fields, domain: (),
    ) -> None:
        """Builds spaces and forms.

        Args:
            geometry: Mesh and named faces.
            material: A strain-energy density; or what it is made of by region, None for all other cells.
            element: Name of an element of `ELEMENTS` that lives on the mesh's cells.
            conditions: What happens, by place, or by name of a face; faces without are free.
            stages: What is other at the ends of the stages that follow, see `staged`.
            free: Whether rigid motions may be left that no place holds and no load works on.
            quadrature: Degree of the volume quadrature; the element's own by default.
            assembly: See `StrainEnergy`.
            more: Makes further terms of Π.

        Raises:
            UserError: If conditions do not fit the mesh or each other, leave rigid motions, or a region does not fit.
            MaterialError: If a mixed element cannot take an energy.
        """
        self.geometry, self.element = geometry, element
        self.stages = staged(conditions, stages)
        self.solids: Solids = {None: Solid(material)} if isinstance(material, Energy) else dict(material)
        mesh, kind = geometry.mesh, ELEMENTS[element]
        self.dimension = mesh.geometry.dim
        self.quadrature = quadrature or kind.quadrature
        self.V = displacement_space(mesh, kind)
        self.u = fem.Function(self.V, name="displacement")
        self.p: fem.Function | None = None
        cells = filled(geometry, self.solids)
        if kind.pressure is not None:
            groups = numbered(geometry, cells.values())
            self.p = fem.Function(pressure_space(mesh, kind.pressure, groups), name="pressure")
        check(self.stages, geometry)
        self.layout = Layout(self.u, self.p)
        self.constraints = Constraints(geometry, self.V, self.stages)
        pieces, complaint = rigid.keep(self.constraints, geometry, self.V, self.stages[0], free)
        self.held = self.layout.joined(self.constraints.held)

        fields = Fields(self.u, self.p)
        geometry_degree = int(mesh.ufl_domain().ufl_coordinate_element().embedded_superdegree)
        facets = {face: geometry.facets(face) for face in geometry.faces}
        domain = Domain(mesh, self.quadrature, face_degree(kind.degree, geometry_degree), facets)
        self.parts = Parts.made(cells, self.solids, fields, domain, assembly)
        shares = [Share(part.split, part.cells) for part in self.parts if part.split is not None]
        pressures = PressureField(shares, fields, domain) if shares else None
        self.pressures = Pressures(pressures, self.parts, self.layout)
        setting = Setting(fields, domain, geometry, self.constraints.held)
        self.foundations = steady_terms(self.stages[0], setting)
        self.terms = [
            *(part.strain for part in self.parts),
            *([] if pressures is None else [pressures]),
            *(term for _, term in self.foundations),
            *load_terms(self.stages, setting),
            *more(fields, domain),
        ]
        self.assembly = Assembly(fields, self.terms, self.layout, self.constraints)
        self._refuse_no_numbers(setting)
        if complaint is not None:
            self._refuse_pushed(pieces, complaint)

    def _refuse_no_numbers(self, setting: Setting) -> None:
        """Refuses loads whose expressions are undefined somewhere on their place."""
        if all(map(self._finite, (term for term in self.terms if term.linear))):
            return
        for key, term in by_place(self.stages, setting):
            # The assembly knows the forces of all such places by the same name.
            self.assembly.forget()
            if not self._finite(term):
                raise UserError(f"{key}: is no number everywhere there")

    def _finite(self, load: Term) -> bool:
        return self.comm.allreduce(bool(np.isfinite(self.assembly.at_full_load(load)).all()), op=MPI.LAND)

    def _refuse_pushed(self, pieces: Sequence[rigid.Piece], complaint: str) -> None:
        """Refuses loads on a body that nothing holds against them."""
        for load in range(1, len(self.stages) + 1):
            external = self.assembly.forces(State(np.zeros(self.layout.owned), float(load)))[1]
            if rigid.pushed(self.V, pieces, external.reshape(-1, self.dimension)):
                raise UserError(f"solve.free = true: expected loads that do no work on what is free, but {complaint}")

    def acting(self) -> list[tuple[Place, Condition]]:
        """What happens at the end of the last stage."""
        return [(place, condition) for place, conditions in self.stages[-1].items() for condition in conditions]

    # ------------------------------------------------------------------ what follows from the terms

    @property
    def conservative(self) -> bool:
        """Whether all forces have a potential: Π can be minimised, and its tangent is symmetric."""
        return all(term.conservative for term in self.terms)

    @property
    def state(self) -> State:
        """What the fields hold."""
        return self.assembly.state

    def take(self, state: State) -> None:
        """Makes the fields hold a state."""
        self.assembly.take(state)

    # ------------------------------------------------------------------ sizes

    @property
    def comm(self) -> MPI.Comm:
        """The mesh's communicator."""
        return self.geometry.mesh.comm

    @property
    def size(self) -> int:
        """Number of unknowns of all ranks."""
        return self.layout.size

    @property
    def points(self) -> Array:
        """Places of the nodes at rest, owned and ghost, shape (n, 3)."""
        return self.constraints.points

    @cached_property
    def volume(self) -> Volume:
        """Volumes of the present state."""
        return Volume(self.u, self.quadrature_points)

    @cached_property
    def quadrature_points(self) -> Points:
        """Where the strain energy is evaluated."""
        return Points(self.geometry.mesh, self.quadrature)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Least and largest coordinates of the body at rest, shape (d,) each."""
        points = self.points[:, : self.dimension]
        low, high = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
        self.comm.Allreduce(MPI.IN_PLACE, low, op=MPI.MIN)
        self.comm.Allreduce(MPI.IN_PLACE, high, op=MPI.MAX)
        return low, high

    @cached_property
    def extent(self) -> float:
        """Largest extent of the body at rest along an axis."""
        low, high = self.bounds
        return float((high - low).max())

    @cached_property
    def stiffness(self) -> float:
        """The force of a strain of one at rest over the square of the extent; of several parts, of the softest."""
        return self.parts.softest * self.extent ** (self.dimension - 1)

    # ------------------------------------------------------------------ prescribed displacements

    def prescribed(self, load: float) -> Array:
        """Displacements at a load factor, owned and ghost: right where they are prescribed, zero elsewhere."""
        return self.constraints.displacements(load)

    def placed(self, values: Array, load: float) -> State:
        """The state with a vector's values, and the prescribed displacements of a load."""
        return State(np.where(self.held, self.layout.joined(self.prescribed(load)), values), load)
