"""Scalar unknowns in the contact problem: eliminated, or a border of W."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm import coulomb
from skmpm.implicit.contact_problem import ContactIterate

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Border:
    """Scalar unknowns that stay in the contact problem: bilateral ones, which add J s to the velocities u.

    s (p,) is their response to the change of impulses, D s = J^T (r - known).
    """

    rows: sp.csr_array  # J (k, p) or (2 k, p)
    stiffness: Array  # D (p,) [kg/m]

    @property
    def diagonal(self) -> Array:
        """What eliminating them would add to the diagonal of W, (k,) or (2 k,)."""
        return np.asarray(self.rows.multiply(self.rows) @ (1.0 / self.stiffness))

    def around(
        self, W: sp.csr_array, inner: coulomb.Bilateral | None, known: Array
    ) -> tuple[sp.csr_array, coulomb.Bilateral]:
        """W with a border [[W, J], [J^T, -D]], and its bilateral unknowns, those of W first."""
        size = self.stiffness.size
        J = _padded(self.rows, (W.shape[0], size))
        below = sp.hstack([J.T.tocsr(), sp.diags_array(-self.stiffness)], format="csr")
        bordered = sp.csr_array(sp.vstack([sp.hstack([W, J], format="csr"), below], format="csr"))
        own = coulomb.Bilateral(-(self.rows.T @ known))
        if inner is None:
            return bordered, own
        negative = None if inner.negative is None else inner.negative + size
        contact = np.append(inner.contact, np.full(size, -1))
        return bordered, coulomb.Bilateral(np.append(inner.q, own.q), contact, negative)


def with_scalar_unknowns(
    contact: ContactIterate, W: sp.csr_array, q: Array
) -> tuple[sp.csr_array, Array, Border | None]:
    """W and the free velocities with the response of the scalar unknowns to their contacts; what stays a border.

    Those that a few contacts move are eliminated. What moves all contacts, as a box under stress does, would make W
    dense: in large problems it stays an unknown, unless contacts respond above all by it, as between held bodies.
    """
    constraints, unknowns = contact.constraints, contact.problem.unknowns
    assert unknowns is not None
    rows, stiffness, known = unknowns.rows(contact.z, constraints), unknowns.stiffness, contact.lifted
    q = q + rows @ unknowns.change(contact.z, constraints, contact.r)
    few, border = unknowns.carrying, None
    if few and known.size > coulomb.MAX_DENSE_ROWS:
        border = Border(rows[:, :few], stiffness[:few])
        border = border if (W.diagonal()[: known.size] >= border.diagonal).all() else None
    if border is not None:
        rows, stiffness = rows[:, few:], stiffness[few:]
    compliance = sp.csr_array(rows @ sp.diags_array(1.0 / stiffness) @ rows.T)
    return sp.csr_array(W + _padded(compliance, W.shape)), q - compliance @ known, border


def _padded(rows: sp.csr_array, shape: tuple[int, int]) -> sp.csr_array:
    """Rows followed by empty ones, in a matrix of this shape."""
    indptr = np.append(rows.indptr, np.full(shape[0] - rows.shape[0], rows.nnz))
    return sp.csr_array((rows.data, rows.indices, indptr), shape=shape)
