"""Bodies joined by a few springs: the inverse of A + B^T K B by Woodbury's formula."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.linear.solver import Solver

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Joined:
    """The inverse A^-1 - Z G Z^T, Z = A^-1 B^T, which couples the bodies that the rows of B touch."""

    solver: Solver  # for A
    Z: Array  # (n, k)
    G: Array  # (k, k)

    @property
    def name(self) -> str:
        """Name of the solver for A."""
        return self.solver.name

    def __call__(self, b: Array, /) -> Array:
        """The solution for b (n,) or (n, m)."""
        return np.asarray(self.solver(b) - self.Z @ (self.G @ (self.Z.T @ b)))

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """The Delassus operator of rows H, with entries between the bodies that are joined."""
        every = sp.csr_array(sp.eye_array(H.shape[0]))
        return sp.csr_array(self.solver.delassus(H) - self.correction(every, every, H))

    def correction(self, left: sp.csr_array, right: sp.csr_array, H: sp.csr_array) -> sp.csr_array:
        """What the springs take off left H A^-1 H^T right^T, for rows left and right (k, m) of H (m, n)."""
        moved = sp.csr_array(H @ self.Z)
        return sp.csr_array((left @ moved) @ sp.csr_array(self.G) @ (right @ moved).T)


def joined(solver: Solver, B: sp.csr_array, K: Array) -> Joined:
    """Inverse of A + B^T K B from a solver for A: G = (I + K B Z)^-1 K, for K of blocks (springs, 2, 2), K >= 0."""
    Z = solver(np.ascontiguousarray(B.T.toarray()))
    stiffness = np.zeros((B.shape[0], B.shape[0]))
    for i, block in enumerate(K):
        stiffness[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = block
    G = np.linalg.solve(np.eye(B.shape[0]) + stiffness @ (B @ Z), stiffness)
    return Joined(solver, Z, 0.5 * (G + G.T))
