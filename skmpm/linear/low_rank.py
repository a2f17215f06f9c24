"""Corrections of low rank within every body, by Woodbury's formula."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.linear.solver import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class LowRank:
    """The inverse A^-1 + Z G_b Z^T, with the rows of Z of one body b and a small matrix G_b for that body.

    `without_added_inertia` and `on_gauge` make it from a solver for a matrix that is positive definite.
    """

    solver: Solver  # for A
    body: Ints  # (nodes,)
    Z: Array  # (2 nodes, k)
    G: Array  # (bodies, k, k); zero for bodies without correction

    @property
    def name(self) -> str:
        """Name of the solver for A."""
        return self.solver.name

    def __call__(self, b: Array, /) -> Array:
        """The solution for b (n,) or (n, m)."""
        columns, bodies = b.reshape(b.shape[0], -1), self.G.shape[0]
        owner = np.repeat(self.body, 2)
        correction = np.zeros_like(columns)
        for j, column in enumerate(columns.T):
            products = np.stack([np.bincount(owner, z * column, bodies) for z in self.Z.T], axis=1)
            correction[:, j] = np.einsum("nk,nk->n", self.Z, np.einsum("bkl,bl->bk", self.G, products)[owner])
        return np.asarray(self.solver(b) + correction.reshape(b.shape))

    def delassus(self, H: sp.csr_array) -> sp.csr_array:
        """The Delassus operator of rows H that touch one body each; dense within a body."""
        W = sp.csr_array(self.solver.delassus(H))
        body_of_row = np.zeros(H.shape[0], dtype=np.int64)
        filled = np.flatnonzero(np.diff(H.indptr))
        body_of_row[filled] = self.body[H.indices[H.indptr[filled]] // 2]
        response = np.asarray(H @ self.Z)
        weighted = np.einsum("rk,rkl->rl", response, self.G[body_of_row])
        row = np.repeat(np.arange(H.shape[0]), np.diff(W.indptr))
        added = np.einsum("ek,ek->e", weighted[row], response[W.indices])
        return sp.csr_array((W.data + added, W.indices, W.indptr), shape=W.shape)


def without_added_inertia(solver: Solver, body: Ints, c: Array, mass: Array) -> LowRank:
    """Inverse of A + c (M - M T (T^T M T)^-1 T^T M), T the translations of a body, from a solver for A + c M.

    `c` (bodies,) is the added inertia over the mass of a body, `mass` (bodies,) [kg/m]. The added term is c times the
    mass matrix without its part for translations. Translations store no energy, A T = M T. Hence (A + c M) T =
    (1 + c) M T, and by Woodbury's formula the inverse is (A + c M)^-1 + c / (1 + c) T (T^T M T)^-1 T^T.
    """
    mobility = c / ((1.0 + c) * np.maximum(mass, 1e-300))
    return LowRank(solver, body, np.tile(np.eye(2), (body.size, 1)), mobility[:, None, None] * np.eye(2))


def on_gauge(solver: Solver, body: Ints, springs: Array, stiffness: Array, m: Array) -> LowRank:
    """Inverse of A on the velocities w with m^T w = 0 in every body, from a solver for A + sum_j k_j q_j q_j^T.

    The columns q_j of Q, `springs` (2 nodes, s), hold one vector for every body, with the stiffnesses k_j,
    `stiffness` (bodies, s); where it is zero, the body has no condition. With the forces s_j = k_j q_j.w that the
    added terms have in excess, and the multiplier -v of the condition, w = A_+^-1 (b + Q s - m v), where
    Q^T w = s / k and m^T w = 0. So (s, -v) = (diag(1 / k, 0) - P^T A_+^-1 P)^-1 P^T A_+^-1 b with P = (Q, m).
    """
    P = np.concatenate([springs, m[:, None]], axis=1)
    Z = solver(P)
    bodies, owner = stiffness.shape[0], np.repeat(body, 2)
    columns = range(P.shape[1])
    products = [[np.bincount(owner, P[:, i] * Z[:, j], bodies) for j in columns] for i in columns]
    held = np.flatnonzero(stiffness.all(axis=1))
    matrix = -np.array(products).transpose(2, 0, 1)[held]
    diagonal = np.arange(stiffness.shape[1])
    matrix[:, diagonal, diagonal] += 1.0 / stiffness[held]
    G = np.zeros((bodies, P.shape[1], P.shape[1]))
    G[held] = np.linalg.inv(matrix)
    return LowRank(solver, body, Z, G)
