"""The Delassus operator of boundary points: their velocities under impulses on them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.compiled import compiled
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
        return _product(left, found.S, right, np.repeat(np.where(found.known, self.owner, -1), 2)), found

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
        S, kept = self._of(np.flatnonzero(again)), _without(self.S, np.repeat(bodies[self.owner], 2))
        S = S + kept if kept.nnz else S
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


def _product(left: sp.csr_array, S: sp.csr_array, right: sp.csr_array, owner: Ints) -> sp.csr_array:
    """The product left S right^T of rows that touch at most two bodies each, columns ascending.

    `owner` (2 m,) is the body of every row of S, -1 where that is empty.
    """
    pairs = [_bodies_of_rows(rows.indptr, rows.indices, owner) for rows in (left, right)]
    bodies = int(owner.max(initial=-1)) + 1
    count = np.bincount(pairs[1][pairs[1] >= 0], minlength=bodies)
    begins, rows_of_body = np.append(0, np.cumsum(count)), np.empty(int(count.sum()), dtype=np.int32)
    _rows_by_body(pairs[1], begins, rows_of_body)
    most = int(np.where(pairs[0] >= 0, count[pairs[0]], 0).sum()) if bodies else 0
    indptr, indices, data = (
        np.zeros(left.shape[0] + 1, dtype=np.int32),
        np.empty(most, dtype=np.int32),
        np.empty(most),
    )
    filled = _products(
        *(left.indptr, left.indices, left.data, S.indptr, S.indices, S.data, right.indptr, right.indices, right.data),
        *(owner, pairs[0], begins, rows_of_body, indptr, indices, data),
    )
    return sp.csr_array((data[:filled], indices[:filled], indptr), shape=(left.shape[0], right.shape[0]))


@compiled
def _bodies_of_rows(indptr: Ints, indices: Ints, owner: Ints) -> NDArray[np.int64]:
    """The two bodies that each row touches, the smaller first, -1 where there are fewer, (k, 2)."""
    found = np.full((indptr.size - 1, 2), -1)
    for i in range(indptr.size - 1):
        for e in range(indptr[i], indptr[i + 1]):
            b = owner[indices[e]]
            if b >= 0 and b != found[i, 0] and b != found[i, 1]:
                if found[i, 1] >= 0:
                    raise ValueError("a row touches more than two bodies")
                found[i, 0], found[i, 1] = (
                    (b, found[i, 0]) if found[i, 0] < 0 or b < found[i, 0] else (found[i, 0], b)
                )
    return found


@compiled
def _rows_by_body(bodies: Ints, begins: Ints, rows: Ints) -> None:
    """The rows that touch each body, ascending, body after body."""
    filled = begins.copy()
    for i in range(bodies.shape[0]):
        for b in bodies[i]:
            if b >= 0:
                rows[filled[b]] = i
                filled[b] += 1


@compiled
def _products(
    left_indptr: Ints,
    left_indices: Ints,
    left: Array,
    S_indptr: Ints,
    S_indices: Ints,
    S: Array,
    right_indptr: Ints,
    right_indices: Ints,
    right: Array,
    owner: Ints,
    bodies: Ints,
    begins: Ints,
    rows_of_body: Ints,
    indptr: Ints,
    indices: Ints,
    data: Array,
) -> int:
    """Row i of left S at the unknowns of its bodies, times the rows of right that touch these; number of entries."""
    row, end = np.zeros(owner.size), 0
    for i in range(left_indptr.size - 1):
        for e in range(left_indptr[i], left_indptr[i + 1]):
            at, factor = left_indices[e], left[e]
            for s in range(S_indptr[at], S_indptr[at + 1]):
                row[S_indices[s]] += factor * S[s]
        a, b = bodies[i, 0], bodies[i, 1]
        first, last = (begins[a], begins[a + 1]) if a >= 0 else (0, 0)
        other, stop = (begins[b], begins[b + 1]) if b >= 0 else (0, 0)
        while first < last or other < stop:
            if other >= stop or (first < last and rows_of_body[first] <= rows_of_body[other]):
                j = rows_of_body[first]
                other += 1 if other < stop and rows_of_body[other] == j else 0
                first += 1
            else:
                j = rows_of_body[other]
                other += 1
            total = 0.0
            for e in range(right_indptr[j], right_indptr[j + 1]):
                total += right[e] * row[right_indices[e]]
            indices[end], data[end] = j, total
            end += 1
        indptr[i + 1] = end
        for e in range(left_indptr[i], left_indptr[i + 1]):
            at = left_indices[e]
            for s in range(S_indptr[at], S_indptr[at + 1]):
                row[S_indices[s]] = 0.0
    return end
