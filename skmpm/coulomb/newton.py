"""The semismooth Newton method (Alart & Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353-375)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from skmpm.coulomb.law import Array, split
from skmpm.coulomb.problem import MAX_DENSE_ROWS, Iterate, Matrix, Problem, is_sparse


def newton(p: Problem, x: Iterate, tol: float, limit: int, gain: float, shortest: float) -> tuple[Iterate, int]:
    """Take Newton steps while the natural-map residual decreases; return the last iterate and the number of steps.

    Iterates may leave the friction cones, because steps restricted to the cones are far shorter; the iterate returned
    is clipped to them. Contact states are those of r - gain u, with `gain` in units of the largest eigenvalue of W~.
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
    """Newton step for the states at (r, u): u_n = 0 if closed, u_t = 0 if sticking, r_t = +-mu r_n if slipping."""
    free, B = _states((r - gain * u + p.slide)[: p.contacts], p.mu, r.size - p.contacts)
    rows = p.W[free]
    start = B @ r[free]
    correction = B @ _solve_regular(rows @ B, -(rows @ start + p.q[free]), p.shift)
    return np.asarray(start + correction - r, dtype=float)


def _states(a: Array, mu: Array, bilateral: int) -> tuple[NDArray[np.intp], Matrix]:
    """Return the active rows for contact states at a = r - gain u, and the map B from them to all rows.

    `bilateral` is the number of rows without a cone, which follow those of the contacts and are always active.
    """
    size = a.size + bilateral
    a_n, a_t, mu = split(a, mu)
    closed, stick = a_n > 0.0, np.abs(a_t) < mu * a_n
    free = np.concatenate([np.hstack([closed, stick]).ravel(), np.ones(bilateral, dtype=bool)])
    number = np.cumsum(free) - 1
    slipping = np.flatnonzero((closed & ~stick).ravel()) if a_t.size else np.zeros(0, dtype=np.intp)
    rows, stride = np.flatnonzero(free), a.size // mu.size
    entries = np.concatenate([np.ones(rows.size), (np.sign(a_t) * mu).ravel()[slipping]])
    at_row = np.concatenate([rows, stride * slipping + 1])
    at_column = np.concatenate([number[rows], number[stride * slipping]])
    if size <= MAX_DENSE_ROWS:
        B = np.zeros((size, rows.size))
        B[at_row, at_column] = entries
        return rows, B
    return rows, sp.csr_array((entries, (at_row, at_column)), shape=(size, rows.size))


def _solve_regular(A: Matrix, b: Array, shift: float) -> Array:
    """Solve A x = b with A + shift I and one step of iterative refinement; zeros if the factorisation fails.

    The shift bounds the impulses of redundant contacts.
    """
    try:
        if not is_sparse(A):
            inverse = np.linalg.inv(A + shift * np.eye(b.size))
            x = inverse @ b
            return np.asarray(x + inverse @ (b - A @ x), dtype=float)
        shifted = sp.csc_array(A) + sp.diags_array(np.full(b.size, shift), format="csc")
        options = {"SymmetricMode": True}  # slip makes the matrix only slightly unsymmetric
        lu = splu(shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options=options)
        x = lu.solve(b)
        return np.asarray(x + lu.solve(b - A @ x), dtype=float)
    except (RuntimeError, np.linalg.LinAlgError):
        return np.zeros_like(b)
