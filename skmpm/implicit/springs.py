"""Springs in the equations of a step.

Beds act on single points: their stiffness has the pattern of A. Bars couple the means of two sets of points, of one
body or two: they enter the matrix by Woodbury's formula (`linear.joined`), with the energy 1/2 k (|d| - l)^2 of
their span d = B u + d_0.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

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

    @cached_property
    def holding(self) -> Array:
        """Quadratic forms of the beds in the rigid motions of `grid.rigid_motions`, each with the trace one or zero.

        By body, (bodies, 3, 3).
        """
        grid, held = self.assembly.grid, np.zeros((self.assembly.grid.bodies, 3, 3))
        if self.points.size:
            N = grid.interpolation[self.points]
            moved = np.stack([(N @ mode.reshape(-1, 2)).T for mode in grid.rigid_motions().T])  # (3, 2, m)
            body = grid.cell_body[grid.cell_of_point[self.points]]
            np.add.at(held, body, np.einsum("aip,ip,bip->pab", moved, self.stiffness, moved))
        trace = np.trace(held, axis1=1, axis2=2)
        return np.asarray(held / np.maximum(trace, 1e-300)[:, None, None])

    def opposing(self, modes: sp.csr_array) -> sp.csr_array:
        """Combinations of modes (2 nodes, k) that beds oppose, (2 m, k); of each body squares add up to one."""
        grid = self.assembly.grid
        N = sp.kron(grid.interpolation[self.points], np.eye(2), format="csr")
        rows = sp.csr_array(sp.diags_array(np.sqrt(self.stiffness.T.ravel())) @ (N @ modes))
        body = np.repeat(grid.cell_body[grid.cell_of_point[self.points]], 2)
        size = np.bincount(body, np.asarray(rows.power(2).sum(axis=1)).ravel(), grid.bodies)
        return sp.csr_array(sp.diags_array(1.0 / np.sqrt(np.maximum(size, 1e-300))[body]) @ rows)

    @property
    def joined(self) -> NDArray[np.bool_]:
        """Bodies that bars act on, (bodies,)."""
        found = np.zeros(self.assembly.grid.bodies, dtype=bool)
        found[self.assembly.grid.node_body[self.bars.indices // 2]] = True
        return found

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
