"""Springs in the equations of a step.

Beds act on single points: their stiffness has the pattern of A. Bars couple the means of two sets of points, of one
body or two: they enter the matrix by Woodbury's formula (`linear.joined`), with the energy 1/2 k (|d| - l)^2 of
their span d = B u + d_0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.assembly import Assembly

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Springs:
    """The springs of a step, as functions of the nodal displacement since anchoring U (2 nodes,) [m]."""

    assembly: Assembly
    points: Ints  # (m,) of beds, among those of deformable bodies
    stiffness: Array  # (2, m) of beds [N/m2]
    start: Array  # (2, m) displacements of these points less those without a force, where U = 0 [m]
    bars: sp.csr_array  # (2 b, 2 nodes) B
    span: Array  # (b, 2) of bars where U = 0 [m]
    bar_stiffness: Array  # (b,) [N/m2]
    length: Array  # (b,) of bars without a force [m]

    def energy(self, U: Array) -> float:
        """The energy of the springs [J/m]."""
        length, _ = self._bars_at(U)
        bars = 0.5 * float(self.bar_stiffness @ (length - self.length) ** 2)
        return bars + 0.5 * float(np.sum(self.stiffness * self._stretch(U) ** 2))

    def force(self, U: Array) -> Array:
        """The derivative of the energy, (2 nodes,) [N/m]."""
        length, along = self._bars_at(U)
        force = self.bars.T @ ((self.bar_stiffness * (length - self.length))[:, None] * along).ravel()
        if self.points.size:
            N = self.assembly.grid.interpolation[self.points]
            force = force + (N.T @ (self.stiffness * self._stretch(U)).T).ravel()
        return np.asarray(force)

    def bed_stiffness(self) -> Array:
        """The stiffness of the beds in the pattern of A, (blocks, 2, 2) [Pa]."""
        assembly, grid = self.assembly, self.assembly.grid
        cell = grid.cell_of_point[self.points]
        N = grid.interpolation.data.reshape(-1, 4)[self.points]
        each = np.einsum("pI,pJ,ip,ij->pIJij", N, N, self.stiffness, np.eye(2))
        blocks = np.zeros_like(assembly.ghost_data)
        np.add.at(blocks, assembly.block_of_cell[cell], each)
        return blocks

    def bar_stiffnesses(self, U: Array) -> Array:
        """Second derivatives of the energies of the bars by their spans, (b, 2, 2) [N/m2], none negative."""
        length, along = self._bars_at(U)
        axial = np.einsum("bi,bj->bij", along, along)
        turning = np.maximum(1.0 - self.length / np.maximum(length, 1e-300), 0.0)
        K = axial + turning[:, None, None] * (np.eye(2) - axial)
        return np.asarray(self.bar_stiffness[:, None, None] * K)

    @property
    def linear(self) -> bool:
        """Whether forces are linear in the displacement: without bars."""
        return self.length.size == 0

    def _stretch(self, U: Array) -> Array:
        if self.points.size == 0:
            return self.start
        return np.asarray(self.start + (self.assembly.grid.interpolation[self.points] @ U.reshape(-1, 2)).T)

    def _bars_at(self, U: Array) -> tuple[Array, Array]:
        """Lengths (b,) and unit vectors (b, 2) of the bars; of a bar without length any."""
        span = self.span + (self.bars @ U).reshape(-1, 2)
        length = np.hypot(span[:, 0], span[:, 1])
        unit = np.where(length[:, None] > 0.0, span, [1.0, 0.0]) / np.where(length > 0.0, length, 1.0)[:, None]
        return length, unit
