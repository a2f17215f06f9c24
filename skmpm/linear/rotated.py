"""The inverse for bodies that have turned since A was factorised."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.linear.solver import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Rotated:
    """The inverse of R A R^T, with a rotation in R for every body: R A^-1 R^T."""

    solver: Solver  # for A
    body: Ints  # (nodes,)
    angle: Array  # (bodies,) [rad]

    @property
    def name(self) -> str:
        """Name of the solver for A."""
        return self.solver.name

    @cached_property
    def _turn(self) -> NDArray[np.complex128]:
        return np.asarray(np.exp(1j * self.angle))

    def __call__(self, b: Array, /) -> Array:
        """The solution for b (n,) or (n, m)."""
        turn = self._turn[self.body]
        back = _turned(b.reshape(b.shape[0], -1).T, turn.conj())
        x = self.solver(np.ascontiguousarray(back.T).reshape(b.shape))
        return np.ascontiguousarray(_turned(x.reshape(b.shape[0], -1).T, turn).T).reshape(b.shape)

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """The Delassus operator of rows H that touch one body each."""
        return self.solver.delassus(self.turned_back(H, self.body))

    def turned_back(self, rows: sp.csr_array, body: Ints) -> sp.csr_array:
        """Rows (k, 2 m) of pairs of components, of points of these bodies (m,), in the directions of A: H R."""
        turn = self._turn[body]
        blocks = np.stack([turn.real, -turn.imag, turn.imag, turn.real], axis=1).reshape(-1, 2, 2)
        R = sp.bsr_array((blocks, np.arange(body.size), np.arange(body.size + 1)))
        return sp.csr_array(rows @ R.tocsr())


def _turned(rows: Array, turn: NDArray[np.complex128]) -> Array:
    """Vectors (m, 2 nodes) turned by exp(i angle) at every node."""
    z = np.ascontiguousarray(rows).view(np.complex128) * turn
    return np.asarray(z.view(np.float64))
