"""The semismooth Newton method (Alart & Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353-375)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from skmpm.coulomb.law import Array, split
from skmpm.coulomb.problem import DENSE, Iterate, Matrix, Problem, is_sparse


def newton(p: Problem, x: Iterate, tol: float, limit: int, gain: float, shortest: float) -> tuple[Iterate, int]:
    """Take Newton steps while the natural map goes down; return the end, clamped, and their number.

    On the way r may leave the cones: held inside, the steps get far shorter. The gain, relative to the largest
    eigenvalue of W~, weighs the velocities when the contact states are read off r - gain u.
    """
    r, u, gain = x.r, x.u, gain * p.largest
    natural_residual, count, alpha = p.natural_residual(r, u, gain), 0, 1.0
    while count < limit and alpha >= shortest:
        d = _step(p, r, u, gain)
        d_u, count, alpha = p.W @ d, count + 1, 1.0
        while alpha >= shortest:
            new = p.natural_residual(r + alpha * d, u + alpha * d_u, gain)
            if new < (1.0 - 1e-3 * alpha) * natural_residual:
                r, u, natural_residual = r + alpha * d, u + alpha * d_u, new
                break
            alpha *= 0.5
        if natural_residual < tol and (end := p.at(p.clip_to_cone(r))).error <= tol:
            return end, count
    return p.at(p.clip_to_cone(r)), count


def _step(p: Problem, r: Array, u: Array, gain: float) -> Array:
    """Solve u_n = 0 where closed, u_t = 0 where it sticks, r_t = +-mu r_n where it slips, as at (r, u)."""
    free, B = _states((r - gain * u + p.slide)[: p.contacts], p.mu, r.size - p.contacts)
    rows = p.W[free]
    start = B @ r[free]
    correction = B @ _solve_regular(rows @ B, -(rows @ start + p.q[free]), p.shift)
    return np.asarray(start + correction - r, dtype=float)


def _states(a: Array, mu: Array, springs: int) -> tuple[NDArray[np.intp], Matrix]:
    """Return the rows that are unknowns at a = r - gain u, and the map B from them to all rows."""
    size = a.size + springs
    a_n, a_t, mu = split(a, mu)
    closed, stick = a_n > 0.0, np.abs(a_t) < mu * a_n
    free = np.concatenate([np.hstack([closed, stick]).ravel(), np.ones(springs, dtype=bool)])
    number = np.cumsum(free) - 1
    slipping = np.flatnonzero((closed & ~stick).ravel()) if a_t.size else np.zeros(0, dtype=np.intp)
    rows, stride = np.flatnonzero(free), a.size // mu.size
    entries = np.concatenate([np.ones(rows.size), (np.sign(a_t) * mu).ravel()[slipping]])
    at_row = np.concatenate([rows, stride * slipping + 1])
    at_column = np.concatenate([number[rows], number[stride * slipping]])
    if size <= DENSE:
        B = np.zeros((size, rows.size))
        B[at_row, at_column] = entries
        return rows, B
    return rows, sp.csr_array((entries, (at_row, at_column)), shape=(size, rows.size))


def _solve_regular(A: Matrix, b: Array, shift: float) -> Array:
    """Solve A x = b by (A + shift) and one refinement, which bounds redundant impulses; zeros if it fails."""
    try:
        if not is_sparse(A):
            inverse = np.linalg.inv(A + shift * np.eye(b.size))
            x = inverse @ b
            return np.asarray(x + inverse @ (b - A @ x), dtype=float)
        shifted = sp.csc_array(A) + sp.diags_array(np.full(b.size, shift), format="csc")
        options = {"SymmetricMode": True}  # slip disturbs the symmetry of W little
        lu = splu(shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options=options)
        x = lu.solve(b)
        return np.asarray(x + lu.solve(b - A @ x), dtype=float)
    except (RuntimeError, np.linalg.LinAlgError):
        return np.zeros_like(b)
