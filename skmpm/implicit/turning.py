"""How loaded contacts turn: what the second derivative of the gaps adds to A, in contact space.

The gap of a point that slides by tau along a curve whose tangent turns by beta changes, to second order, by

    d2 g = -c (kappa tau^2 + 2 tau beta + g beta^2),    c = 1 / (1 - g kappa),

kappa the curve's curvature, negative where it bulges. A contact with impulse r therefore adds Z' D Z to the Hessian
of the Lagrangian, Z the rows of tau and beta, D = theta^2 dt r c [[kappa, 1], [1, g]]. It couples bodies and is not
definite, so it stays out of A: the impulses rho = -D Z dw / theta are unknowns of the contact problem, linear rows
with the compliance theta D^-1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.contact import Rows

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

FAINT = 1e-3  # share of the largest impulse below which a contact turns nothing
TIGHTEST = 0.1  # smallest 1 - g kappa: the point must not come near the centre of curvature


@dataclass(frozen=True)
class Turning:
    """The loaded contacts between bodies, m of them."""

    contacts: Ints  # (m,) places among the rows
    Z: sp.csr_array  # (2 m, 2 nodes) rows of sliding, then of turning
    compliance: sp.csr_array  # (2 m, 2 m) theta D^-1

    @property
    def size(self) -> int:
        """Number of linear rows."""
        return self.Z.shape[0]


def turning(rows: Rows, r: Array, dt: float, theta: float) -> Turning | None:
    """What contacts with impulses r turn; None where none does. One that sticks turns nothing."""
    chosen = loaded(rows, r)
    normal = r
    if rows.tangential:
        normal = r[::2]
        chosen = chosen[np.abs(r[1::2])[chosen] > 0.999 * (rows.friction * normal)[chosen]]
    if chosen.size == 0:
        return None
    gap, kappa = rows.gap[chosen], rows.curvature[chosen]
    c = 1.0 / np.maximum(1.0 - gap * kappa, TIGHTEST)
    factor = theta / (theta**2 * dt * normal[chosen] * c * (gap * kappa - 1.0))
    diagonals = [sp.diags_array(factor * values) for values in (gap, -np.ones_like(gap), kappa)]
    compliance = sp.block_array([[diagonals[0], diagonals[1]], [diagonals[1], diagonals[2]]], format="csr")
    return Turning(chosen, sp.csr_array(sp.vstack(rows.turned(chosen), format="csr")), compliance)


def loaded(rows: Rows, r: Array) -> Ints:
    """The contacts on curves that carry a share of the load."""
    normal = r[::2] if rows.tangential else r
    return np.flatnonzero((normal > FAINT * normal.max(initial=0.0)) & (np.diff(rows.turning.indptr) > 0))
