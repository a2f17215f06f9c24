"""Springs in the equations of a step.

Beds act on single points: their stiffness has the pattern of A. Bars couple the means of two sets of points, of one
body or two: they enter the matrix by Woodbury's formula (`linear.joined`), with the energy 1/2 k (|d| - l)^2 of
their span d = B u + d_0.

The ends of springs move uniformly in a step, so that their work is what the springs store, exactly, whatever their
motion in time.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.assembly import Assembly
from skmpm.implicit.budget import Budget
from skmpm.implicit.configuration import Configuration
from skmpm.implicit.terms import Path, Term

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Springs(Term):
    """Springs of one kind, with the energy 1/2 k (length - rest)^2."""

    constant: Array  # stiffness of each, (...,) [N/m2]
    rest: Array  # (2, ...) lengths without a force, when the step begins and when it ends [m]
    theta: float  # part of the step after which its forces are taken

    @property
    def turns(self) -> bool:
        """Their directions stay."""
        return False

    @abstractmethod
    def length(self, displacement: Array) -> Array:
        """Lengths of the springs at a nodal displacement (2 nodes,), (...,) [m]."""

    def energy(self, at: Configuration) -> float:
        """The energy of the springs with the ends of the step [J/m]."""
        return self.stored(at.displacement, self.theta)

    def stored(self, displacement: Array, part: float) -> float:
        """The energy at a displacement (2 nodes,), a part of the step after its start [J/m]."""
        return 0.5 * float(np.sum(self.constant * self._stretch(displacement, part) ** 2))

    def budget(self, path: Path) -> Budget:
        """What they store, and the work of their ends."""
        start, end = path.start.displacement, path.end.displacement
        stored = np.array([self.stored(start, 0.0), self.stored(end, 1.0)])
        if path.inertia:
            work = self._work_of_ends(path.stressed.displacement, self.theta)
        else:
            work = 0.5 * (self._work_of_ends(start, 0.0) + self._work_of_ends(end, 1.0))
        return Budget(springs=stored, external=work)

    def _stretch(self, displacement: Array, part: float) -> Array:
        before, after = self.rest
        return np.asarray(self.length(displacement) - before - part * (after - before))

    def _pull(self, at: Configuration) -> Array:
        """Forces along the springs, (...,) [N/m]."""
        return np.asarray(self.constant * self._stretch(at.displacement, self.theta))

    def _work_of_ends(self, displacement: Array, part: float) -> float:
        moved = self.rest[1] - self.rest[0]
        return -float(np.sum(self.constant * moved * self._stretch(displacement, part)))


@dataclass(frozen=True)
class Beds(Springs):
    """Beds on m points; lengths are displacements, two of each point (2, m)."""

    assembly: Assembly
    points: Ints  # (m,) among those of deformable bodies
    start: Array  # (2, m) displacements where the nodal one is zero [m]

    def length(self, displacement: Array) -> Array:
        """Displacements of the points, (2, m) [m]."""
        moved = self.assembly.grid.interpolation[self.points] @ displacement.reshape(-1, 2)
        return np.asarray(self.start + moved.T)

    def force(self, at: Configuration) -> Array:
        """The derivative of the energy, (2 nodes,) [N/m]."""
        return np.asarray(self.assembly.grid.interpolation[self.points].T @ self._pull(at).T).ravel()

    def stiffness(self, at: Configuration) -> Array:
        """The stiffness in the pattern of A, (blocks, 2, 2) [N/m2]."""
        assembly, grid = self.assembly, self.assembly.grid
        cell = grid.cell_of_point[self.points]
        N = grid.interpolation.data.reshape(-1, 4)[self.points]
        each = np.einsum("pI,pJ,ip,ij->pIJij", N, N, self.constant, np.eye(2))
        blocks = np.zeros_like(assembly.ghost_data)
        np.add.at(blocks, assembly.block_of_cell[cell], each)
        return blocks


@dataclass(frozen=True)
class Bars(Springs):
    """Bars between the means of points of bodies, or from one to a fixed point; lengths (b,)."""

    ends: sp.csr_array  # (2 b, 2 nodes) B
    span: Array  # (b, 2) where the nodal displacement is zero [m]

    @property
    def linear(self) -> bool:
        """They turn, and stretch by their stress."""
        return False

    def length(self, displacement: Array) -> Array:
        """Distances of their ends, (b,) [m]."""
        return np.asarray(np.hypot(*self._spans(displacement).T))

    def force(self, at: Configuration) -> Array:
        """The derivative of the energy, (2 nodes,) [N/m]."""
        return np.asarray(self.ends.T @ (self._pull(at)[:, None] * self._along(at.displacement)).ravel())

    def coupling(self, at: Configuration) -> tuple[sp.csr_array, Array]:
        """B, and second derivatives of the energies by the spans, (b, 2, 2) [N/m2], none negative."""
        length, along = self.length(at.displacement), self._along(at.displacement)
        axial = np.einsum("bi,bj->bij", along, along)
        stress = self._stretch(at.displacement, self.theta) / np.maximum(length, 1e-300)
        K = axial + np.maximum(stress, 0.0)[:, None, None] * (np.eye(2) - axial)
        return self.ends, np.asarray(self.constant[:, None, None] * K)

    def _spans(self, displacement: Array) -> Array:
        return np.asarray(self.span + (self.ends @ displacement).reshape(-1, 2))

    def _along(self, displacement: Array) -> Array:
        """Unit vectors of the bars, (b, 2); of a bar without length any."""
        span = self._spans(displacement)
        length = np.hypot(*span.T)[:, None]
        return np.asarray(np.where(length > 0.0, span, [1.0, 0.0]) / np.where(length > 0.0, length, 1.0))
