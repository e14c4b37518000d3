"""A scene on its mesh: function spaces, prescribed displacements, and Π with its derivatives as vectors."""

from functools import cached_property
from typing import Any

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI
from numpy.typing import NDArray

from elastune import geometry
from elastune.app.body.constraints import Constraints
from elastune.app.errors import SceneError
from elastune.app.scene.schema import Scene, material_energy, mesh_arguments
from elastune.forms.elements import ELEMENTS, Choice
from elastune.forms.normalize import linearize
from elastune.forms.spaces import displacement_space, pressure_space
from elastune.forms.terms.mixed import MixedPotential
from elastune.forms.terms.potential import Loads, Potential
from elastune.forms.volumetric import Split, split

Array = NDArray[np.float64]


class Problem:
    """What the solver sees of a scene.

    Vectors are local numpy arrays: owned displacements, owned pressures, ghost displacements, ghost pressures.
    Only mixed elements have pressures.

    Attributes:
        scene: The scene.
        geometry: Mesh and named faces.
        energy: The calibrated and tuned energy.
        element: Element name.
        reason: Why "auto" chose it, or nothing.
        quadrature: Degree of the volume quadrature.
        V: Displacement space.
        u: The displacement of the state.
        p: The pressure of the state, or None.
        split: The energy as a mixed element sees it, or None.
        held: Mask of the prescribed degrees of freedom, a vector.
        conditions: dolfinx's view of them, for assembly.
        faces: Nodes of the faces where displacements are prescribed, owned and ghost.
        potential: Π and its forms.
    """

    def __init__(self, scene: Scene, comm: MPI.Comm) -> None:
        """Builds mesh, space and forms.

        Raises:
            SceneError: If the mesh, or the scene on this mesh, is impossible.
        """
        self.scene = scene
        self.energy = material_energy(scene)
        try:
            self.geometry = geometry.build(comm, **mesh_arguments(scene))
        except geometry.GeometryError as error:
            raise SceneError(f"mesh: {error}") from None
        mesh = self.geometry.mesh
        self.dimension = mesh.geometry.dim
        self.element, self.reason = _element(scene, mesh.topology.cell_name(), self.geometry.cells_count)
        element = ELEMENTS[self.element]
        self.quadrature = scene.solve.quadrature or (element.tangled_quadrature if scene.start else element.quadrature)
        self.V = displacement_space(mesh, element)
        self.u = fem.Function(self.V, name="displacement")
        self.p: fem.Function | None = None
        self.split: Split | None = None
        if element.pressure is not None:
            self.p = fem.Function(pressure_space(mesh, element.pressure), name="pressure")
            self.split = split(self.energy)
        self._constraints = Constraints(scene, self.geometry, self.V)
        self.conditions, self.faces = self._constraints.conditions, self._constraints.faces
        self.held = self.joined(self._constraints.held)
        self.potential = self._potential()

    def _potential(self) -> Potential:
        solve, tags, loads = self.scene.solve, self.geometry.facet_tags, self._loads()
        if self.mixed is not None:
            parts, p = self.mixed
            return MixedPotential(parts, self.u, p, self.quadrature, loads, tags, solve.assembly)
        extension = self.scene.material.extension
        return Potential(self.energy, self.u, self.quadrature, loads, tags, solve.assembly, extension)

    @property
    def mixed(self) -> tuple[Split, fem.Function] | None:
        """Of a mixed element, the energy as it sees it and the pressure."""
        return None if self.split is None or self.p is None else (self.split, self.p)

    # ------------------------------------------------------------------ sizes

    @property
    def comm(self) -> MPI.Comm:
        """The mesh's communicator."""
        return self.geometry.mesh.comm

    @cached_property
    def size(self) -> int:
        """Global number of degrees of freedom."""
        pressures = 0 if self.p is None else self.p.function_space.dofmap.index_map.size_global
        return self.V.dofmap.index_map.size_global * self.V.dofmap.index_map_bs + pressures

    @cached_property
    def owned_displacements(self) -> int:
        """Number of displacement degrees of freedom of this rank."""
        return self.V.dofmap.index_map.size_local * self.V.dofmap.index_map_bs

    @cached_property
    def owned_pressures(self) -> int:
        """Number of pressure degrees of freedom of this rank."""
        return 0 if self.p is None else self.p.function_space.dofmap.index_map.size_local

    @cached_property
    def owned(self) -> int:
        """Number of degrees of freedom of this rank."""
        return self.owned_displacements + self.owned_pressures

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Least and largest coordinates of the body at rest, shape (d,) each."""
        points = self.V.tabulate_dof_coordinates()[:, : self.dimension]
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
        """The force of a strain of one at rest: λ + 2μ over the square of the extent."""
        at_rest = linearize(self.energy)
        return (at_rest.lame_lambda + 2 * at_rest.lame_mu) * self.extent ** (self.dimension - 1)

    # ------------------------------------------------------------------ layout of a vector

    def joined(self, displacements: Array, pressures: Array | None = None) -> Array:
        """A vector of displacements and pressures, each owned and ghost; zero pressures unless given.

        Without pressures in the problem it is the array of displacements itself.
        """
        if self.p is None:
            return displacements
        n, m = self.owned_displacements, self.owned_pressures
        if pressures is None:
            pressures = np.zeros(len(self.p.x.array), dtype=displacements.dtype)
        return np.concatenate([displacements[:n], pressures[:m], displacements[n:], pressures[m:]])

    def displacements(self, values: Array) -> Array:
        """The displacements of a vector, owned and ghost."""
        if self.p is None:
            return values
        n, ghosts = self.owned_displacements, len(self.u.x.array) - self.owned_displacements
        return np.concatenate([values[:n], values[self.owned : self.owned + ghosts]])

    def with_displacements(self, values: Array, displacements: Array) -> Array:
        """A vector with other displacements and the same pressures."""
        changed = self.joined(displacements)
        changed[self.owned_displacements : self.owned] = values[self.owned_displacements : self.owned]
        return changed

    @property
    def state(self) -> Array:
        """The present state as a new vector."""
        return self.joined(self.u.x.array, None if self.p is None else self.p.x.array).copy()

    # ------------------------------------------------------------------ prescribed displacements

    def prescribed(self, load: float) -> Array:
        """Displacements at a load factor: right where `held`, zero elsewhere."""
        return self.joined(self._constraints.displacements(load))

    def lift(self, increment: Array) -> Array:
        """Forces -K Δg of an increment of the prescribed displacements at the current state.

        Zero at the prescribed degrees of freedom.
        """
        self._constraints.motion.x.array[:] = self.displacements(increment)
        forces = self._lifted(self.V, self.potential.tangent)
        if not isinstance(self.potential, MixedPotential) or self.p is None:
            lifted = forces
        else:
            lifted = self.joined(forces, self._lifted(self.p.function_space, [self.potential.coupling]))
        lifted[self.held] = 0.0
        return lifted

    def _lifted(self, space: fem.FunctionSpace, forms: list[Any]) -> Array:
        b = la.vector(space.dofmap.index_map, space.dofmap.index_map_bs)
        b.array[:] = 0.0
        for form in forms:
            fem.apply_lifting(b.array, [form], [self.conditions])
        b.scatter_reverse(la.InsertMode.add)
        b.scatter_forward()
        return b.array

    # ------------------------------------------------------------------ loads

    def _loads(self) -> Loads:
        tractions, pressures = {}, {}
        for face, condition in self.scene.boundary.items():
            # Also for held faces: an unknown face of the user's own mesh is found here.
            tag = self._tag(face)
            if condition.kind == "pull":
                tractions[tag] = self._vector(condition.pull, f"boundary.{face}.pull")
            elif condition.kind == "pressure":
                pressures[tag] = float(condition.pressure or 0.0)
            elif condition.kind == "move":
                self._vector(condition.move, f"boundary.{face}.move")
        body = self._vector(self.scene.body.force, "body.force") if self.scene.body else None
        return Loads(body, tractions, pressures)

    def _tag(self, face: str) -> int:
        try:
            return self.geometry.faces[face]
        except KeyError:
            known = ", ".join(self.geometry.faces)
            raise SceneError(f"boundary.{face}: unknown face; the mesh has {known}") from None

    def _vector(self, value: list[float] | None, key: str) -> Array:
        if value is None or len(value) != self.dimension:
            raise SceneError(f"{key} = {value}: expected {self.dimension} components")
        return np.array(value, dtype=np.float64)

    # ------------------------------------------------------------------ Π and its derivatives at a state

    def set_state(self, values: Array) -> None:
        """Takes the owned values of a state and updates the ghosts."""
        n = self.owned_displacements
        self.u.x.array[:n] = values[:n]
        self.u.x.scatter_forward()
        if self.p is not None:
            self.p.x.array[: self.owned_pressures] = values[n : self.owned]
            self.p.x.scatter_forward()
        if isinstance(self.potential, MixedPotential):
            self.potential.pressure_changed()

    def energy_at(self, values: Array) -> float:
        """Π, the same on every rank; NaN where ψ is undefined."""
        self.set_state(values)
        forms = [*self.potential.strain_energy, *self.potential.work]
        with np.errstate(all="ignore"):
            return self.comm.allreduce(sum(float(fem.assemble_scalar(form)) for form in forms))

    def force_at(self, values: Array, forms: list[Any]) -> Array:
        """Sum of assembled forms over displacements at a state, with ghost contributions added to their owners."""
        self.set_state(values)
        return self._assembled(self.V, forms)

    def _assembled(self, space: fem.FunctionSpace, forms: list[Any]) -> Array:
        b = la.vector(space.dofmap.index_map, space.dofmap.index_map_bs)
        b.array[:] = 0.0
        for form in forms:
            fem.assemble_vector(b.array, form)
        b.scatter_reverse(la.InsertMode.add)
        b.scatter_forward()
        return b.array

    def residual_at(self, values: Array) -> Array:
        """Out-of-balance forces, reactions at the prescribed degrees of freedom included, and volume strains."""
        forces = self.force_at(values, [*self.potential.internal, *self.potential.external])
        if not isinstance(self.potential, MixedPotential) or self.p is None:
            return forces
        return self.joined(forces, self._assembled(self.p.function_space, [self.potential.volume_strain]))

    def norm(self, values: Array) -> float:
        """Euclidean norm over all ranks."""
        own = values[: self.owned]
        return float(np.sqrt(self.comm.allreduce(float(own @ own))))

    def norm_displacements(self, values: Array) -> float:
        """Euclidean norm of the displacements, or of the forces on them, over all ranks."""
        own = values[: self.owned_displacements]
        return float(np.sqrt(self.comm.allreduce(float(own @ own))))

    def dot(self, a: Array, b: Array) -> float:
        """Inner product over all ranks."""
        return self.comm.allreduce(float(a[: self.owned] @ b[: self.owned]))


def _element(scene: Scene, cell: str, cells: int) -> Choice:
    """Element, checked against the cell type that the mesh turned out to have."""
    if scene.solve.element == "auto":
        return scene.chosen(cell, cells)
    name = scene.solve.element
    if cell not in ELEMENTS[name].cells:
        lives = " or ".join(ELEMENTS[name].cells)
        raise SceneError(f'solve.element = "{name}": lives on {lives}, got a mesh of {cell} cells')
    return Choice(name, "")
