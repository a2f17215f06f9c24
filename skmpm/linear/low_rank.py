"""Corrections of low rank within every body, by Woodbury's formula."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.compiled import compiled
from skmpm.linear.solver import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class LowRank:
    """The inverse A^-1 + Z G_b Z^T, with the rows of Z of one body b and a small matrix G_b for that body.

    `without_added_mass` makes it from a solver for a matrix that is positive definite.
    """

    solver: Solver  # for A
    body: Ints  # (nodes,)
    Z: Array  # (2 nodes, k)
    G: Array  # (bodies, k, k); zero for bodies without correction

    @property
    def name(self) -> str:
        """Name of the solver for A."""
        return self.solver.name

    @cached_property
    def blocks(self) -> Ints:
        """Offsets (bodies + 1,) of the unknowns of bodies."""
        return _blocks(self.body, self.G.shape[0])

    def __call__(self, b: Array, /) -> Array:
        """The solution for b (n,) or (n, m)."""
        x = np.ascontiguousarray(self.solver(b))
        _add_correction(self.blocks, self.Z, self.G, b.reshape(b.shape[0], -1), x.reshape(b.shape[0], -1))
        return x

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """The Delassus operator of rows H that touch one body each; dense within a body."""
        W = sp.csr_array(self.solver.delassus(H), copy=True)
        body_of_row = np.zeros(H.shape[0], dtype=np.int64)
        filled = np.flatnonzero(np.diff(H.indptr))
        body_of_row[filled] = self.body[H.indices[H.indptr[filled]] // 2]
        response = np.asarray(H @ self.Z)
        _add_products(W.indptr, W.indices, np.einsum("rk,rkl->rl", response, self.G[body_of_row]), response, W.data)
        return W


def without_added_mass(solver: Solver, body: Ints, added: Array, mass: Array, m: Array | None = None) -> LowRank:
    """Inverse of A + c (M - M T (T^T M T)^-1 T^T M), T the translations of a body, from a solver for A + c M.

    `added` (bodies,) is c times the mass of a body, `mass` (bodies,) that of M [kg/m]; where it is zero, translations
    keep c M. Translations store no energy, A T = M T. Hence (A + c M) T = (1 + c) M T, and by Woodbury's formula the
    inverse is (A + c M)^-1 + c / (1 + c) T (T^T M T)^-1 T^T. With `m` (2 nodes,), on the velocities w with m^T w = 0
    in every body in which m, orthogonal to translations, does not vanish: less z z^T / m^T z with z = (A + c M)^-1 m.
    """
    Z, inertia = np.tile(np.eye(2), (body.size, 1)), np.maximum(mass, 1e-300)
    G = np.zeros((mass.size, 3, 3))
    G[:, 0, 0] = G[:, 1, 1] = np.where(mass > 0.0, added / (inertia + added) / inertia, 0.0)
    if m is None:
        return LowRank(solver, body, Z, G[:, :2, :2])
    z = solver(m)
    product = np.bincount(np.repeat(body, 2), m * z, mass.size)
    G[product > 0.0, 2, 2] = -1.0 / product[product > 0.0]
    return LowRank(solver, body, np.column_stack([Z, z]), G)


def _blocks(body: Ints, bodies: int) -> Ints:
    """Offsets (bodies + 1,) of the unknowns of bodies; `body` (nodes,) ascends."""
    return 2 * np.searchsorted(body, np.arange(bodies + 1))


@compiled
def _add_correction(blocks: Ints, Z: Array, G: Array, b: Array, x: Array) -> None:
    """Add Z G Z^T b of every body to x, both (n, m)."""
    k = Z.shape[1]
    products, weights = np.zeros(k), np.zeros(k)
    for body in range(blocks.size - 1):
        for column in range(b.shape[1]):
            products[:] = 0.0
            for i in range(blocks[body], blocks[body + 1]):
                for j in range(k):
                    products[j] += Z[i, j] * b[i, column]
            for j in range(k):
                weights[j] = 0.0
                for l in range(k):  # noqa: E741
                    weights[j] += G[body, j, l] * products[l]
            for i in range(blocks[body], blocks[body + 1]):
                for j in range(k):
                    x[i, column] += Z[i, j] * weights[j]


@compiled
def _add_products(
    indptr: NDArray[np.integer], indices: NDArray[np.integer], left: Array, right: Array, data: Array
) -> None:
    """Add the product of row i of `left` and row j of `right` to every entry (i, j) of a CSR matrix."""
    for i in range(indptr.size - 1):
        for e in range(indptr[i], indptr[i + 1]):
            for k in range(left.shape[1]):
                data[e] += left[i, k] * right[indices[e], k]
