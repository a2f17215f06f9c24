"""Solver for diagonal matrices, such as the lumped mass of an explicit step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.compiled import compiled
from skmpm.linear.solver import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.integer]


@dataclass(frozen=True)
class Diagonal:
    """The inverse of a diagonal matrix."""

    inverse: Array  # (n,)
    name: str = "diagonal"

    def __call__(self, b: Array, /) -> Array:
        """A^-1 b, for b (n,) or (n, m)."""
        return np.asarray((self.inverse * b.T).T)

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """H A^-1 H^T."""
        return sp.csr_array(H @ sp.diags_array(self.inverse) @ H.T)

    def between_contacts(self, shares: sp.csr_array, *directions: Array) -> sp.csr_array:
        """H A^-1 H^T of k contacts, sparse: only contacts that share nodes are coupled.

        The rows of H are the components of the relative velocities shares v, `shares` (k, nodes), in some directions
        (2, k): all of the first contact, then all of the second. A is the same for both components of a node.
        """
        k = shares.shape[0]
        of_node = sp.csc_array(shares)
        frames = np.ascontiguousarray(np.stack(directions, axis=1))  # (2, directions, k)
        rows, counts = (shares.indptr, shares.indices, shares.data), np.zeros(k, dtype=np.int64)
        columns = (of_node.indptr, of_node.indices, of_node.data)
        seen, scalar = np.full(k, -1), np.empty(k)
        _coupled(*rows[:2], *columns[:2], seen, counts)
        indptr = np.append(0, np.cumsum(np.repeat(len(directions) * counts, len(directions))))
        indices, data = np.empty(indptr[-1], dtype=np.int32), np.empty(indptr[-1])
        _blocks(*rows, *columns, self.inverse[::2], frames, seen, scalar, indptr, indices, data)
        size = len(directions) * k
        return sp.csr_array((data, indices, indptr.astype(np.int32)), shape=(size, size))


@compiled
def _coupled(indptr: Ints, indices: Ints, begins: Ints, rows: Ints, seen: Ints, counts: Ints) -> None:
    """Count the contacts that share a node with each contact; `seen` (k,) is -1."""
    for i in range(counts.size):
        for e in range(indptr[i], indptr[i + 1]):
            n = indices[e]
            for f in range(begins[n], begins[n + 1]):
                if seen[rows[f]] != i:
                    seen[rows[f]] = i
                    counts[i] += 1


@compiled
def _blocks(
    indptr: Ints,
    indices: Ints,
    shares: Array,
    begins: Ints,
    rows: Ints,
    of_node: Array,
    inverse: Array,
    frames: Array,
    seen: Ints,
    scalar: Array,
    starts: Ints,
    columns: Ints,
    data: Array,
) -> None:
    """Write the blocks of directions of all coupled contacts, columns ascending; `inverse` (nodes,)."""
    k, size = seen.size, frames.shape[1]
    coupled = np.empty(k, dtype=np.int64)
    for i in range(k):
        count = 0
        for e in range(indptr[i], indptr[i + 1]):
            n, share = indices[e], shares[e] * inverse[indices[e]]
            for f in range(begins[n], begins[n + 1]):
                j = rows[f]
                if seen[j] != k + i:
                    seen[j], scalar[j], place = k + i, 0.0, count
                    while place > 0 and coupled[place - 1] > j:
                        coupled[place] = coupled[place - 1]
                        place -= 1
                    coupled[place], count = j, count + 1
                scalar[j] += share * of_node[f]
        for a in range(size):
            out = starts[size * i + a]
            for c in range(count):
                j = coupled[c]
                for b in range(size):
                    columns[out] = size * j + b
                    data[out] = scalar[j] * (frames[0, a, i] * frames[0, b, j] + frames[1, a, i] * frames[1, b, j])
                    out += 1


def diagonal(A: sp.bsr_array, blocks: Ints, rigid_motions: Array) -> Solver:
    """Division by the diagonal of A; off-diagonal entries are ignored."""
    return Diagonal(1.0 / A.diagonal())
