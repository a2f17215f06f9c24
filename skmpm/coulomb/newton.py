"""The semismooth Newton method (Alart & Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353-375).

Full steps are an active-set strategy (Hintermueller, Ito & Kunisch, SIAM J. Optim. 13 (2002) 865-888). They need
neither a gain nor a merit function, which are hard to choose where inertia and elasticity differ by many orders of
magnitude, as in steps far longer than waves take to cross a body.

Bilateral unknowns may make a problem without friction indefinite, as the geometric stiffness of contact does. With
the positive definite matrix A of the bodies, rows H of closed contacts, Z of bilateral unknowns and their
compliance C, the matrix [[A, H^T, Z^T], [H, 0, 0], [Z, 0, -C]] has two Schur complements: -(W + diag(0, C)), W the
response of contacts and bilateral unknowns, and [[A + Z^T C^-1 Z, H^T], [H, 0]], which has one negative eigenvalue
a contact where its energy has a minimum. By Haynsworth's inertia additivity (Linear Algebra Appl. 1 (1968) 73-81) W
+ diag(0, C) then has as many negative eigenvalues as C, and fewer where motions that keep contacts closed lower the
energy. Without pivoting the pivots of its factors show how many (Sylvester's law of inertia).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from skmpm.arrays import EXACT, Array
from skmpm.compiled import compiled
from skmpm.coulomb.krylov import (
    ROUGH_TOLERANCE,
    TOLERANCE,
    NotConvergedError,
    by_incomplete_factor,
    by_known_factor,
)
from skmpm.coulomb.problem import (
    OPEN,
    REGULARISATION,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
    Iterate,
    Problem,
    is_sparse,
    split,
)

States: TypeAlias = NDArray[np.int8]


# Steps after which the number of contacts that violate their law must have decreased. With 7, 8, 9, 10 the saved
# problems of test_contact_solver take 1,706, 1,693, 1,719, 1,768 steps; with 4, 5, 6 two of them take too many, with
# 12 one. With the 3 steps that all contacts changed in before, nine problems of a dense packing with friction 0.1
# took 1,441 steps instead of 92.
PATIENCE = 8
# Residuals between this fraction of the tolerance and the tolerance are worth another step: one of thirty, with which
# contacts bear weights to less than the tolerance (test_free_rigid).
POLISH = 1e-2
# A Krylov solver solves roughly while more than this fraction of the contacts change their states: of 3,000 in a
# dense packing 200 change in the first step, 6 in the second, none in the third.
MANY_CHANGES = 0.01
MAX_CHANGES = 8  # contacts of other states up to which a known factor is used again
# Pivots on the diagonal over the largest entry of their columns, above which rows keep their order, the one with
# little fill. With 0.01 the LU of a dense packing has 1.35 times the entries and takes 1.6 times as long; solutions
# refined once are as accurate.
MIN_PIVOT = 1e-6
MANY_ROWS = 10_000  # beyond, another attempt at an iterative solver takes less than a tenth of the time of an LU


def full_steps(p: Problem, x: Iterate, tol: float, limit: int) -> tuple[Iterate, int]:
    """Take Newton steps from the contact states of x; return the best iterate and the number of steps.

    All contacts that violate their law change their states, or while their number does not decrease the one that
    violates it most (block and single pivots: Judice & Pires, Comput. Oper. Res. 21 (1994) 587-596): contacts beside
    each other that slip or stick would change in turns. Steps end when the states recur, when the number has not
    decreased for long, or where the problem is unstable. Iterates with the right contact states but not quite their
    impulses, whose residual is below `tol` but not far below, get another step.
    """
    r, k, best, factor, polished = x.r, p.contacts, x, None, False
    a = r if r.any() else -x.u
    state, fewest, left = contact_states((a + p.slide)[:k], p.mu * (1.0 - EXACT)), p.mu.size + 1, PATIENCE
    seen, count, rough = {state.tobytes()}, 0, False
    precise = p.repeated and not is_sparse(p.W)  # of small problems a step more takes no time
    changes, wanted = (p.mu.size, POLISH * tol) if precise else (0, tol)
    while ((precise and rough) or best.error > wanted) and count < limit and left:
        polished, rough = best.error <= tol, p.repeated and changes > MANY_CHANGES * p.mu.size
        known, (d, factor) = factor, _step(p, r, state, factor, ROUGH_TOLERANCE if rough else TOLERANCE)
        if factor is not None and factor is not known and factor.unstable(p.negative):
            return best, count + 1
        r, count = r + d, count + 1
        new = p.at(p.clip_to_cone(r))
        best = new if new.error < best.error else best
        wanted = tol if polished else POLISH * tol
        # Impulses decide, velocities only on the edge of a cone: a gain of 1e-9 to 1e-4 gives as many steps to 1 %.
        u = p.W @ r + p.q
        new_state = contact_states((r - REGULARISATION * u + p.slide)[:k], p.mu)
        changed = np.flatnonzero(new_state != state)
        fewest, left = (changed.size, PATIENCE) if changed.size < fewest else (fewest, left - 1)
        if left < PATIENCE:
            changed = changed[np.argsort(-p.violations(r, u)[changed])[:1]]
        state, changes = state.copy(), changed.size
        state[changed] = new_state[changed]
        left = 0 if state.tobytes() in seen and not rough else left
        seen.add(state.tobytes())
    return best, count


def contact_states(a: Array, mu: Array) -> States:
    """The states of contacts (k,) at a = r - gain u, of normal rows or of normal and tangential rows."""
    a_n, a_t, mu = split(a, mu)
    slip = np.where(np.abs(a_t) < mu * a_n, STICK, np.where(a_t < 0.0, SLIP_MINUS, SLIP_PLUS))
    return np.where(a_n > 0.0, slip if slip.size else STICK, OPEN).ravel().astype(np.int8)


def _step(
    p: Problem,
    r: Array,
    state: States,
    known: _Factor | None,
    tolerance: float,
) -> tuple[Array, _Factor | None]:
    """Newton step for the states (k,): u_n = 0 if closed, u_t = 0 if sticking, r_t = +-mu r_n if slipping.

    Also returns the factor it was computed with, which may be the `known` one of other states.
    """
    free, column, factor = _active(p, state)
    if not free.size:
        return -r, known
    start = factor * r[free[column]]
    b = -((p.W @ start)[free] + p.q[free])
    if is_sparse(p.W):
        A = _combined(p.W, free, column, factor, p.shift)
        change, known = _change(p, A, b, tolerance, state, free, known)
    else:
        combined = np.zeros((free.size, free.size))
        np.add.at(combined.T, column, (p.W[free] * factor).T)
        change = _solved_densely(combined, b, p.shift)
    return np.asarray(start + factor * change[column] - r, dtype=float), known


def _change(
    p: Problem,
    A: sp.csr_array,
    b: Array,
    tolerance: float,
    state: States,
    free: NDArray[np.intp],
    known: _Factor | None,
) -> tuple[Array, _Factor | None]:
    """The solution for a sparse A less the shift, and the factor it was computed with, None for none.

    The shift bounds the impulses of redundant contacts: those of the LU are refined once. Where A - shift I is
    singular the solution is that of A, refined once; where A is singular, too, it is zero.
    """
    changes = p.mu.size if known is None else int(np.count_nonzero(state != known.state))
    try:
        if known is not None and known.lu is not None and changes <= MAX_CHANGES:
            return by_known_factor(A, b, p.shift, free, known.solve, known.free, changes), known
        if known is None or b.size > MANY_ROWS:
            return by_incomplete_factor(A, b, p.shift, tolerance, p.negative), known
    except NotConvergedError:
        pass
    known = _Factor(_factorised(A), state, free)
    if known.lu is None:
        return np.zeros_like(b), known
    x = known.solve(b)
    return np.asarray(x + known.solve(b - (A @ x - p.shift * x)), dtype=float), known


def _active(p: Problem, state: States) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """The active rows (m,), and for every row the active one that it follows and the factor, zero for open contacts.

    Tangential rows that slip follow the normal ones; rows without a cone are active.
    """
    size, stride = p.q.size, p.contacts // p.mu.size
    free = np.concatenate(
        [np.stack([state != OPEN, state == STICK][:stride], axis=1).ravel(), np.ones(size - p.contacts, dtype=bool)]
    )
    column, factor = np.maximum(np.cumsum(free) - 1, 0), free.astype(np.float64)
    slipping = np.flatnonzero(state >= SLIP_PLUS)
    column[stride * slipping + 1] = column[stride * slipping]
    factor[stride * slipping + 1] = np.where(state == SLIP_MINUS, -p.mu, p.mu)[slipping]
    return np.flatnonzero(free), column, factor


def _combined(
    W: sp.csr_array, free: NDArray[np.intp], column: NDArray[np.intp], factor: Array, shift: float
) -> sp.csr_array:
    """Rows `free` of W, columns j times factor[j] added to column[j], plus shift I, (free, free)."""
    most = int(np.diff(W.indptr)[free].sum()) + free.size
    indptr, indices, data = np.zeros(free.size + 1, dtype=np.int32), np.empty(most, dtype=np.int32), np.empty(most)
    filled = _combine(W.indptr, W.indices, W.data, free, column, factor, shift, indptr, indices, data)
    return sp.csr_array((data[:filled], indices[:filled], indptr), shape=(free.size, free.size))


@compiled
def _combine(
    indptr: NDArray[np.int32],
    indices: NDArray[np.int32],
    values: Array,
    free: NDArray[np.intp],
    column: NDArray[np.intp],
    factor: Array,
    shift: float,
    out_indptr: NDArray[np.int32],
    out_indices: NDArray[np.int32],
    out: Array,
) -> int:
    """Write a CSR matrix, whose columns ascend as those of the first do, and return its number of entries."""
    end = 0
    for i in range(free.size):
        begin, shifted = end, False
        own, row = indices[indptr[free[i]] : indptr[free[i] + 1]], values[indptr[free[i]] : indptr[free[i] + 1]]
        for e in range(own.size):
            weight, at = factor[own[e]], column[own[e]]
            if weight == 0.0:
                continue
            if not shifted and at >= i:
                out_indices[end], out[end], shifted = i, shift, True
                end += 1
            if end > begin and out_indices[end - 1] == at:
                out[end - 1] += weight * row[e]
            else:
                out_indices[end], out[end] = at, weight * row[e]
                end += 1
        if not shifted:
            out_indices[end], out[end] = i, shift
            end += 1
        out_indptr[i + 1] = end
    return end


@dataclass(frozen=True)
class _Factor:
    """The LU factors of the transposed matrix of a Newton step, whose rows are the active ones."""

    lu: Any  # SuperLU, None where the matrix is singular
    state: States
    free: NDArray[np.intp]  # (m,) the active rows

    def unstable(self, negative: int | None) -> bool:
        """Whether the symmetric matrix has fewer negative eigenvalues; False where rows were interchanged."""
        if negative is None or self.lu is None or (self.lu.perm_r != self.lu.perm_c).any():
            return False
        return int(np.count_nonzero(self.lu.U.diagonal() < 0.0)) < negative

    def solve(self, b: Array) -> Array:
        """The solution for b (m,)."""
        assert self.lu is not None
        return np.asarray(self.lu.solve(b, "T"))


def _factorised(A: sp.csr_array) -> Any:
    """The factors of the transpose of A, which is the CSC matrix of the same arrays; None if A is singular."""
    transposed = sp.csc_array((A.data, A.indices, A.indptr), shape=A.shape)
    try:
        options = {"SymmetricMode": True}  # slip makes the matrix only slightly unsymmetric
        return splu(transposed, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=MIN_PIVOT, options=options)
    except RuntimeError:
        return None


def _solved_densely(A: Array, b: Array, shift: float) -> Array:
    """The solution for A by that of A + shift I and one step of iterative refinement; zero where it is singular."""
    try:
        inverse = np.linalg.inv(A + shift * np.eye(b.size))
    except np.linalg.LinAlgError:
        return np.zeros_like(b)
    x = inverse @ b
    return np.asarray(x + inverse @ (b - A @ x), dtype=float)
