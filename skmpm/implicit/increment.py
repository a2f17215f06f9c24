"""The equations of one time step without contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.implicit.bulk import Bulk, Configuration
from skmpm.linear import Solver
from skmpm.scheme import Scheme

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Increment:
    """The equations of one time step."""

    bulk: Bulk
    start: Array  # U (2 nodes,) [m]
    v0: Array  # (2 nodes,) [m/s]
    free: Array  # w*, (2 nodes,) [m/s]
    dt: float
    scheme: Scheme

    @property
    def _reach(self) -> float:
        return self.scheme.theta * self.dt

    def at(self, w: Array) -> Configuration:
        """The configuration whose stress drives the step."""
        return self.bulk.at(self.start + self._reach * w)

    def after(self, w: Array) -> Array:
        """The velocity v1 at the end of the step, (2 nodes,) [m/s]."""
        return self.v0 + (w - self.v0) / self.scheme.theta

    def energy(self, w: Array, at: Configuration) -> float:
        """The incremental potential E(w) [J/m]."""
        slip = w - self.free
        return self.bulk.energy(at) + 0.5 * float(slip @ (self.bulk.assembly.mass * slip))

    def gradient(self, w: Array, at: Configuration) -> tuple[Array, float]:
        """The imbalance of momentum without contact (2 nodes,) [kg/s], and the size of its terms."""
        inertia = self.bulk.assembly.mass * (w - self.free)
        elastic = self._reach * self.bulk.force(at)
        noise = self.round_off(w, at) / self.scheme.newton_tol
        return inertia + elastic, max(float(np.linalg.norm(inertia)), float(np.linalg.norm(elastic)), noise)

    def round_off(self, w: Array, at: Configuration) -> float:
        """The imbalance that round-off of displacements and velocities leaves, whatever w [kg/s]."""
        modulus = self.bulk.modulus
        reach = self.bulk.assembly.sheets.cell + float(np.abs(at.displacement).max(initial=0.0))
        inertia = float(np.linalg.norm(self.bulk.assembly.mass * w))
        return float(20.0 * np.finfo(float).eps * (self._reach * modulus * reach * np.sqrt(w.size) + inertia))

    def matrix(self, at: Configuration, *, projected: bool = False) -> sp.bsr_array:
        """A = M + theta^2 dt^2 K."""
        return self.bulk.assembly.matrix(self.bulk.stiffness(at, projected=projected), self._reach**2)

    def factorised(self, at: Configuration, *, projected: bool) -> Solver:
        """The scheme's solver for A; LinAlgError where it sees that A is not positive definite."""
        sheets = self.bulk.assembly.sheets
        return self.scheme.linear(self.matrix(at, projected=projected), sheets.blocks, sheets.rigid_motions())
