"""Volumes of a body's state: of the whole, and the least ratio at any point."""

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from elastune.forms.points import Points


class Volume:
    """Volume ratios of the present displacement."""

    def __init__(self, u: fem.Function, points: Points) -> None:
        """At quadrature points."""
        self._u, self._points, self._comm = u, points, points.mesh.comm
        self._at_rest = points.volumes()

    def ratios(self) -> NDArray[np.float64]:
        """J at the points of this rank."""
        return np.linalg.det(np.eye(3) + self._points.gradient(self._u))

    def ratio(self) -> float:
        """Deformed over reference volume of the body."""
        own = np.array([self._at_rest @ self.ratios(), self._at_rest.sum()])
        deformed, rest = self._comm.allreduce(own)
        return float(deformed / rest)

    def least_J(self) -> float:
        """Least volume ratio at any quadrature point."""
        return self._comm.allreduce(float(self.ratios().min(initial=np.inf)), op=MPI.MIN)
