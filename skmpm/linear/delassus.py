"""The Delassus operator of boundary points: their velocities under impulses on them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.compiled import compiled
from skmpm.linear.solver import Solver
from skmpm.parallel import over_bodies

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
        rows = self.base[np.repeat(points, 2)]
        component = np.repeat(np.tile([0, 1], points.size), np.diff(rows.indptr))
        R = sp.csr_array(
            (rows.data, 2 * rows.indices + component, rows.indptr), shape=(2 * points.size, 2 * rows.shape[1])
        )
        block = self.solver.delassus(R)
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
    """The product left S right^T of rows that touch at most two bodies each, columns ascending; S is symmetric.

    `owner` (2 m,) is the body of every row of S, -1 where that is empty. The products of a body are dense.
    """
    bodies = int(owner.max(initial=-1)) + 1
    pairs = [_bodies_of_rows(rows.indptr, rows.indices, owner) for rows in (left, right)]
    (points, of_left, of_right) = (_by_body(of, bodies) for of in (owner[:, None], *pairs))
    begins = np.append(0, np.cumsum(np.diff(of_left[0]) * np.diff(of_right[0])))
    blocks = np.zeros(begins[-1])
    arguments = (
        *(left.indptr, left.indices, left.data, S.indptr, S.indices, S.data, right.indptr, right.indices, right.data),
        *(owner, *points, *of_left, *of_right, begins, blocks),
    )
    over_bodies(lambda first, last: _products(first, last, *arguments), begins)
    most = int(np.append(np.diff(of_right[0]), 0)[pairs[0]].sum())  # -1, no body, is the last: none
    indptr, indices, data = np.zeros(left.shape[0] + 1, np.int32), np.empty(most, np.int32), np.empty(most)
    filled = _merge(pairs[0], *of_right, begins, blocks, indptr, indices, data)
    return sp.csr_array((data[:filled], indices[:filled], indptr), shape=(left.shape[0], right.shape[0]))


def _by_body(bodies: Ints, count: int) -> tuple[Ints, Ints]:
    """Offsets (count + 1,) and the rows that touch each body, ascending, body after body."""
    number = np.bincount(bodies[bodies >= 0], minlength=count)
    begins, rows = np.append(0, np.cumsum(number)), np.empty(int(number.sum()), dtype=np.int64)
    _rows_by_body(bodies, begins, rows)
    return begins, rows


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
    first: int,
    last: int,
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
    point_begins: Ints,
    points: Ints,
    left_begins: Ints,
    left_rows: Ints,
    right_begins: Ints,
    right_rows: Ints,
    begins: Ints,
    blocks: Array,
) -> None:
    """Dense products of the rows that touch a body with its part of S, from blocks[begins[body]], which is zero."""
    position = np.empty(owner.size, dtype=np.int64)
    for body in range(first, last):
        own = points[point_begins[body] : point_begins[body + 1]]
        rows, columns = left_rows[left_begins[body] : left_begins[body + 1]], right_rows[right_begins[body] :]
        width = right_begins[body + 1] - right_begins[body]
        if rows.size == 0 or width == 0:
            continue
        for k in range(own.size):
            position[own[k]] = k
        turned, total = np.empty((own.size, width)), np.empty(own.size)
        for j in range(width):
            total[:] = 0.0
            for e in range(right_indptr[columns[j]], right_indptr[columns[j] + 1]):
                if owner[right_indices[e]] == body:
                    begin, end = S_indptr[right_indices[e]], S_indptr[right_indices[e] + 1]
                    if end - begin == own.size:  # columns ascend as the rows of the body do
                        _add(right[e], S[begin:end], total)
                    else:
                        for k in range(begin, end):
                            total[position[S_indices[k]]] += right[e] * S[k]
            turned[:, j] = total
        block = blocks[begins[body] : begins[body + 1]].reshape((rows.size, width))
        for i in range(rows.size):
            for e in range(left_indptr[rows[i]], left_indptr[rows[i] + 1]):
                if owner[left_indices[e]] == body:
                    _add(left[e], turned[position[left_indices[e]]], block[i])


@compiled
def _add(factor: float, x: Array, y: Array) -> None:
    """Add factor x to y."""
    for k in range(y.size):
        y[k] += factor * x[k]


@compiled
def _merge(
    bodies: Ints,
    right_begins: Ints,
    right_rows: Ints,
    begins: Ints,
    blocks: Array,
    indptr: Ints,
    indices: Ints,
    data: Array,
) -> int:
    """Write the sums of the products of both bodies of each row, columns ascending; return the number of entries."""
    filled, end = np.zeros(begins.size, dtype=np.int64), 0
    for i in range(bodies.shape[0]):
        a, b = bodies[i, 0], bodies[i, 1]
        first, last = (right_begins[a], right_begins[a + 1]) if a >= 0 else (0, 0)
        other, stop = (right_begins[b], right_begins[b + 1]) if b >= 0 else (0, 0)
        at = begins[a] + filled[a] * (last - first) - first
        and_at = begins[b] + filled[b] * (stop - other) - other
        while first < last or other < stop:
            j = right_rows[first] if first < last else right_rows[other]
            if other < stop:
                j = min(j, right_rows[other])
            total = 0.0
            if first < last and right_rows[first] == j:
                total += blocks[at + first]
                first += 1
            if other < stop and right_rows[other] == j:
                total += blocks[and_at + other]
                other += 1
            indices[end], data[end] = j, total
            end += 1
        indptr[i + 1] = end
        filled[a] += 1
        filled[b] += 1
    return end
