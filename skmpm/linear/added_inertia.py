"""Additional inertia in the matrix for the rotation and deformation of bodies, not for their translation."""

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
class AddedInertia:
    """Inverse of A + c (M - M T (T^T M T)^-1 T^T M), T the translations of a body, from a solver for A + c M.

    The added term is c times the mass matrix without its part for translations. Translations store no energy,
    A T = M T. Hence (A + c M) T = (1 + c) M T, and by Woodbury's formula the inverse is
    (A + c M)^-1 + c / (1 + c) T (T^T M T)^-1 T^T.
    """

    solver: Solver  # for A + c M
    body: Ints  # (nodes,)
    c: Array  # (bodies,) added inertia over the mass of the body
    mass: Array  # (bodies,) [kg/m]

    @property
    def name(self) -> str:
        """Name of the solver for A + c M."""
        return self.solver.name

    @property
    def _mobility(self) -> Array:
        """Mobility of the translations of bodies to be added to that of A + c M, (bodies,) [m/kg]."""
        return self.c / ((1.0 + self.c) * np.maximum(self.mass, 1e-300))

    @cached_property
    def _members(self) -> sp.csr_array:
        """Matrix (bodies, nodes) that sums over the nodes of every body."""
        nodes = self.body.size
        return sp.csr_array((np.ones(nodes), (self.body, np.arange(nodes))), shape=(self.c.size, nodes))

    def __call__(self, b: Array, /) -> Array:
        """The solution for b (n,) or (n, m)."""
        translation = self._mobility[:, None] * (self._members @ b.reshape(self.body.size, -1))
        return np.asarray(self.solver(b) + translation[self.body].reshape(b.shape))

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """The Delassus operator of rows H that touch one body each; dense within a body."""
        W = sp.csr_array(self.solver.delassus(H))
        resultant = np.stack([H[:, k::2].sum(axis=1) for k in (0, 1)], axis=1)
        body_of_row = np.zeros(H.shape[0], dtype=np.int64)
        filled = np.flatnonzero(np.diff(H.indptr))
        body_of_row[filled] = self.body[H.indices[H.indptr[filled]] // 2]
        row = np.repeat(np.arange(H.shape[0]), np.diff(W.indptr))
        added = self._mobility[body_of_row[row]] * np.einsum("ek,ek->e", resultant[row], resultant[W.indices])
        return sp.csr_array((W.data + added, W.indices, W.indptr), shape=W.shape)
