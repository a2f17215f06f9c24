"""The Delassus operator of boundary points: their velocities under impulses on them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.linear.solver import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.integer]


@dataclass(frozen=True)
class Delassus:
    """S = R A^-1 R^T of the contact points (boundary points or grid nodes), R = kron(base, I), for a factorised A.

    From iterate to iterate constraints combine different contact points, while these points and A stay the same. S is
    dense within a body. It is computed for the contact points of a body in use, and computed again when constraints
    use others. With `whole` it is computed for all contact points of a body at once, so that S does not depend, not
    even by round-off, on earlier contacts.
    """

    solver: Solver
    base: sp.csr_array  # (m, nodes)
    owner: Ints  # (m,) body of each contact point
    whole: bool
    S: sp.csr_array  # (2 m, 2 m) of the contact points in `known`
    known: NDArray[np.bool_]  # (m,) whether S contains the contact point

    @staticmethod
    def of(solver: Solver, base: sp.csr_array, owner: Ints, *, whole: bool = False) -> Delassus:
        """The Delassus operator for a solver, with S of no contact point yet."""
        points = base.shape[0]
        S = sp.csr_array((2 * points, 2 * points))
        return Delassus(solver, base, owner, whole, S, np.zeros(points, dtype=bool))

    def between(self, left: sp.csr_array, right: sp.csr_array) -> tuple[sp.csr_array, Delassus]:
        """The product left S right^T for constraints `left` and `right` on the contact points, both (k, 2 m).

        Also returns the operator with S of all contact points in these constraints.
        """
        found = self._extended(left)._extended(right)
        product = sp.csr_array(left @ found.S) @ right.T
        return sp.csr_array(product.tocsc().tocsr()), found  # sorts

    def _extended(self, rows: sp.csr_array) -> Delassus:
        """The operator with S of all contact points in these rows."""
        wanted = np.zeros_like(self.known)
        wanted[rows.indices // 2] = True
        wanted &= np.diff(self.base.indptr) > 0  # points of rigid bodies do not respond
        new = np.flatnonzero(wanted & ~self.known)
        if new.size == 0:
            return self
        known = self.known | wanted
        bodies = np.zeros(int(self.owner.max()) + 1, dtype=bool)
        bodies[self.owner[new]] = True
        if self.whole:
            known |= bodies[self.owner] & (np.diff(self.base.indptr) > 0)
        again = known & bodies[self.owner]
        S = _without(self.S, np.repeat(bodies[self.owner], 2)) + self._of(np.flatnonzero(again))
        return replace(self, S=S, known=known)

    def _of(self, points: Ints) -> sp.csr_array:
        """S of some contact points, with rows and columns of all of them."""
        block = self.solver.delassus(sp.csr_array(sp.kron(self.base[points], np.eye(2), format="csr")))
        chosen = np.stack([2 * points, 2 * points + 1], axis=1).ravel()
        return _spread(block.data, chosen[block.indices], chosen, np.diff(block.indptr), self.S.shape[0])


def _without(S: sp.csr_array, rows: NDArray[np.bool_]) -> sp.csr_array:
    """S without the entries of the rows where `rows` is true."""
    count = np.where(rows, 0, np.diff(S.indptr))
    kept = np.repeat(~rows, np.diff(S.indptr))
    return _spread(S.data[kept], S.indices[kept], np.arange(rows.size), count, rows.size)


def _spread(data: Array, column: Ints, rows: Ints, count: Ints, size: int) -> sp.csr_array:
    """A square matrix with `count` entries in each of the ascending `rows`, and none elsewhere."""
    counts = np.zeros(size, dtype=np.int64)
    counts[rows] = count
    return sp.csr_array((data, column, np.append(0, np.cumsum(counts))), shape=(size, size))
