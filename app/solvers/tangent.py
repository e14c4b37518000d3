"""The tangent: all terms' second derivatives in matrices, rows and columns of what is prescribed aside."""

from functools import cached_property
from typing import Any

import dolfinx.fem.petsc
import numpy as np
from petsc4py import PETSc

from elastune.app.body.body import Body
from elastune.app.body.unknowns import Array, State
from elastune.forms.terms import RAW, Convexity, pattern

Pair = tuple[str, str]


class Tangent:
    """Π'' at a state, as convex as is asked for.

    Of mixed elements it is a matrix of four blocks, displacements before pressures on each rank.

    Attributes:
        body: Whose terms it is made of.
        blocks: By pair of fields.
        matrix: All of it: the block of the displacements, or the nest of four.
        convexity: What was done to it when it was assembled last.
        state: Where it was assembled last, or None.
        settled: Whether it is the unfiltered tangent of a state near the balance that was found last: good enough to
            predict from.
    """

    def __init__(self, body: Body) -> None:
        """Creates the matrices."""
        self.body = body
        self.convexity, self.settled = RAW, False
        self.state: State | None = None
        fields = {"u": body.u} if body.p is None else {"u": body.u, "p": body.p}
        self.blocks: dict[Pair, PETSc.Mat] = {
            (row, column): dolfinx.fem.petsc.create_matrix(pattern(fields[row], fields[column]))
            for row in fields
            for column in fields
        }
        self.blocks["u", "u"].setOption(PETSc.Mat.Option.SYMMETRIC, body.conservative)
        self.matrix = self.blocks["u", "u"]
        if body.p is not None:
            rows = [[self.blocks[row, column] for column in "up"] for row in "up"]
            self.matrix = PETSc.Mat().createNest(rows, comm=body.comm)
        self._diagonal: float | None = None

    def assemble(self, state: State, convexity: Convexity = RAW, only_convex: bool = False) -> None:
        """Assembles it.

        Args:
            state: Where.
            convexity: What is done to negative eigenvalues.
            only_convex: Whether to leave out, of the displacements' block, terms that no filter makes convex.
        """
        body = self.body
        self.settled, self.state, self.convexity = False, state, convexity
        body.take(state)
        for term in body.terms:
            term.convexify(convexity)
        for pair, matrix in self.blocks.items():
            matrix.zeroEntries()
            terms = [term for term in body.terms if term.convex or not only_convex or pair != ("u", "u")]
            for form in (form for term in terms for form in term.tangent.get(pair, ())):
                dolfinx.fem.petsc.assemble_matrix(matrix, form, body.constraints.conditions, 0.0)  # type: ignore[arg-type]
                # dolfinx leaves PETSc's matrix in another mode of insertion; without a flush a second form is lost.
                matrix.assemble(PETSc.Mat.AssemblyType.FLUSH)
            matrix.assemble()
        if not only_convex:
            self._add_own_patterns()
        self._fill_diagonal()
        if body.p is not None:
            self.matrix.assemble()

    def _add_own_patterns(self) -> None:
        free = self.displacement_vector(np.where(self.body.layout.split(self.body.held)[0], 0.0, 1.0))
        for term in self.body.terms:
            own = term.own_stiffness()
            if own is not None:
                own.diagonalScale(free, free)
                self.blocks["u", "u"].axpy(1.0, own, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)

    def _fill_diagonal(self) -> None:
        """A diagonal of the size of the others keeps the prescribed rows out of the conditioning."""
        matrix = self.blocks["u", "u"]
        diagonal = matrix.getDiagonal()
        held = self.body.layout.split(self.body.held)[0]
        diagonal.array[held] = diagonal.norm(PETSc.NormType.INFINITY) or 1.0
        matrix.setDiagonal(diagonal)

    def vector(self, values: Array | None = None) -> PETSc.Vec:
        """A PETSc vector of the unknowns, with a vector's values."""
        layout = self.body.layout
        bsize = layout.dimension if self.body.p is None else None
        vector = PETSc.Vec().createMPI((layout.owned, layout.size), bsize=bsize, comm=layout.comm)
        if values is not None:
            vector.array[:] = values
        return vector

    def displacement_vector(self, values: Array | None = None) -> PETSc.Vec:
        """A PETSc vector of the displacements, with the values of an array."""
        layout = self.body.layout
        total = layout.size - layout.total_pressures
        vector = PETSc.Vec().createMPI((layout.displacements, total), bsize=layout.dimension, comm=layout.comm)
        if values is not None:
            vector.array[:] = values
        return vector

    @cached_property
    def rigid_motions(self) -> Any:
        """Translations and rotations of the body at rest: what algebraic multigrid must represent."""
        nodes = self.body.layout.displacements // self.body.dimension
        points = self.body.points[:nodes, : self.body.dimension]
        return PETSc.NullSpace().createRigidBody(self.displacement_vector(points.ravel()))
