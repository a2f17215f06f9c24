"""Bodies joined by springs, few on each: the inverse of A + E^T E by Woodbury's formula, with sparse matrices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from skmpm.linear.solver import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

SOFT = 1e-12  # of the stiffness of a spring: what is less, in a direction, is round-off


@dataclass(frozen=True)
class Joined:
    """The inverse A^-1 - Z D^-1 Z^T, Z = A^-1 E^T and D = I + E Z, which couples the bodies that rows of E touch."""

    solver: Solver  # for A
    Z: sp.csr_array  # (n, k)
    D: sp.csc_array  # (k, k) positive definite, with entries where springs are on the same body
    divided: Callable[[Array], Array]  # D^-1 b, for b (k,) or (k, m)

    @property
    def name(self) -> str:
        """Name of the solver for A."""
        return self.solver.name

    def __call__(self, b: Array, /) -> Array:
        """The solution for b (n,) or (n, m)."""
        return np.asarray(self.solver(b) - self.Z @ self.divided(self.Z.T @ b))

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """The Delassus operator of rows H, with entries between the bodies that are joined."""
        moved = sp.csr_array(H @ self.Z)
        return sp.csr_array(self.solver.delassus(H) - sp.csr_array(self.correction(moved, moved)))

    def correction(self, left: sp.csr_array, right: sp.csr_array) -> Array:
        """What the springs take off products L A^-1 R^T, from left = L Z (k, m) and right = R Z, dense."""
        return np.asarray(left @ self.divided(right.T.toarray()))


def joined(solver: Solver, B: sp.csr_array, K: Array, blocks: Ints) -> Joined:
    """Inverse of A + B^T K B from a solver for A, for K of blocks (springs, 2, 2), K >= 0.

    E has the rows s^(1/2) v^T B of the eigenvalues s of the blocks above round-off; `blocks` (bodies + 1,) are the
    offsets of the unknowns of bodies.
    """
    values, vectors = np.linalg.eigh(K)
    kept = (values > SOFT * values[:, -1:]).ravel()
    roots = np.sqrt(np.maximum(values, 0.0))[:, :, None] * vectors.swapaxes(1, 2)
    springs = np.arange(K.shape[0] + 1)
    E = sp.csr_array((sp.bsr_array((roots, springs[:-1], springs)).tocsr() @ B)[kept])
    Z = _responses(solver, E, blocks)
    D = sp.csc_array(sp.eye_array(E.shape[0]) + E @ Z)
    return Joined(solver, Z, D, splu(D).solve if E.shape[0] else lambda b: b)


def _responses(solver: Solver, E: sp.csr_array, blocks: Ints) -> sp.csr_array:
    """A^-1 E^T, sparse: rows of E that touch different bodies share a right-hand side."""
    body = np.searchsorted(blocks, E.indices, side="right") - 1
    row = np.repeat(np.arange(E.shape[0]), np.diff(E.indptr))
    pairs = np.unique(np.stack([row, body]), axis=1)
    side = _sides(pairs, E.shape[0], blocks.size - 1)
    b = np.zeros((E.shape[1], int(side.max(initial=-1)) + 1))
    b[E.indices, side[row]] = E.data
    found = solver(b) if b.size else b
    size = np.diff(blocks)[pairs[1]]
    column = np.repeat(pairs[0], size)
    unknown = np.arange(column.size) - np.repeat(np.cumsum(size) - size - blocks[pairs[1]], size)
    return sp.csr_array((found[unknown, side[column]], (unknown, column)), shape=E.shape[::-1])


def _sides(pairs: Ints, rows: int, bodies: int) -> Ints:
    """Right-hand sides (rows,), from pairs (2, m) of rows and bodies that they touch, rows ascending.

    Each row takes the first that no row on its bodies has.
    """
    begins = np.searchsorted(pairs[0], np.arange(rows + 1))
    taken, side = [set[int]() for _ in range(bodies)], np.zeros(rows, dtype=np.int64)
    for k in range(rows):
        own = pairs[1, begins[k] : begins[k + 1]].tolist()
        side[k] = next(j for j in count() if all(j not in taken[b] for b in own))
        for b in own:
            taken[b].add(int(side[k]))
    return side
