"""The search for the impulses: accelerated projected sweeps, then a semismooth Newton method."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.linalg import splu

from skmpm.coulomb.law import Array, clamp, natural, root, scaled_friction, split

Matrix: TypeAlias = Any  # dense or CSR, with @

_FLOOR = 1e-300  # a problem with |q~| below it is at rest
_DENSE = 200  # rows up to which dense algebra beats sparse bookkeeping
_SHIFT = 1e-6  # relative to diag(W), of the matrix of a Newton step: keeps redundant contacts in hand
_NEAR = 0.05  # a start with a smaller residual goes straight to Newton ...
_EAGER = 0.2  # ... and back to sweeps if that needs a smaller part of a step than this
_SHORTEST = 0.05  # smallest part of a Newton step
_GAINS = 1 / 3, 1 / 6, 1.0, 3.0  # of the natural map, relative to the largest eigenvalue of W~
_MOST_SWEEPS = 640  # per round
_ROUNDS = 20


@dataclass(frozen=True)
class Info:
    """How a solve went; ``residual`` is the natural map relative to |q~|."""

    iterations: int  # Newton steps
    sweeps: int
    residual: float
    converged: bool
    linear: Array = field(default_factory=lambda: np.zeros(0), compare=False)  # (m,) the further unknowns


@dataclass(frozen=True)
class Linear:
    """Unknowns s (m,) without a cone: coupling r + compliance s + q = 0, and u = W r + coupling' s + q_contact."""

    coupling: Matrix  # (m, 2k) or (m, k)
    compliance: Matrix  # (m, m) symmetric, not necessarily definite
    q: Array  # (m,)

    def join(self, W: Matrix, q: Array) -> tuple[Matrix, Array]:
        """The matrix and the right-hand side of all unknowns, contacts first."""
        whole = sp.block_array([[sp.csr_array(W), self.coupling.T], [self.coupling, self.compliance]], format="csr")
        return whole, np.concatenate([q, self.q])


def solve(
    W: Any,
    q: ArrayLike,
    mu: ArrayLike,
    *,
    r0: ArrayLike | None = None,
    tol: float = 1e-6,
    sweeps: int = 80,
    iterations: int = 100,
    linear: Linear | None = None,
) -> tuple[Array, Info]:
    """Find r with u = W r + q such that every contact obeys Signorini and Coulomb; return (r, info).

    Accelerated projected sweeps find most contact states, a semismooth Newton method (Alart & Curnier,
    Comput. Methods Appl. Mech. Eng. 92 (1991) 353-375) the rest; where Newton stalls, more sweeps follow. It
    stops on `residual` below tol |q~|, never on an increment; rows without an unknown do not count in q~.
    ``info.converged`` is False, and r the best found, after ``iterations`` Newton steps or 20 rounds of
    sweeps: the usual reason is that no solution exists (a rigid jam).

    Parameters
    ----------
    W : (2k, 2k) or (k, k) sparse or dense, symmetric positive semi-definite [1/kg]
    q : (2k,) or (k,) relative velocities without impulses, with gap / dt on the normal rows [m/s]
    mu : (k,) friction coefficients; a contact with mu = 0 has no tangential unknown
    r0 : like q, impulses to start from [N s]
    sweeps : in the first round, from a poor start; every further round doubles them
    linear : further unknowns, without a cone, that the impulses act on and that act on them

    Raises
    ------
    ValueError
        If sizes disagree, a friction coefficient is negative, or mu > 0 without tangential rows.
    """
    q, mu = np.asarray(q, dtype=float), np.asarray(mu, dtype=float)
    r0 = np.zeros_like(q) if r0 is None else np.asarray(r0, dtype=float)
    _check(W, q, mu, r0)
    contacts = q.size
    if not q.size:
        return np.zeros_like(q), Info(0, 0, 0.0, True)
    if linear is not None:
        W, q = linear.join(W, q)
        r0 = np.concatenate([r0, np.zeros(q.size - contacts)])
    with np.errstate(all="ignore"):  # without a solution r may overflow; the residual says so
        problem, s = _scale(W, q, mu, contacts)
        best, info = _search(problem, problem.at(problem.clamp(s * r0)), tol, sweeps, iterations)
        r = _unscale(best.r[:contacts], problem.mu, s[:contacts], mu)
        return r, replace(info, linear=best.r[contacts:] / s[contacts:])


@dataclass(frozen=True)
class _Iterate:
    r: Array  # (m,)
    u: Array  # (m,)
    error: float


@dataclass(frozen=True)
class _Problem:
    """The scaled problem; what its methods return is in scaled variables too."""

    W: Matrix  # (m, m), unit diagonal
    q: Array  # (m,)
    mu: Array  # (k,)
    reference: float
    contacts: int  # rows; those that follow are linear

    def at(self, r: Array, u: Array | None = None) -> _Iterate:
        """Return r with its velocities and its error."""
        u = self.W @ r + self.q if u is None else u
        k = self.contacts
        error = float(np.hypot(natural(r[:k], u[:k], self.mu), np.linalg.norm(u[k:]))) / self.reference
        return _Iterate(r, u, error if np.isfinite(error) else np.inf)

    def clamp(self, r: Array) -> Array:
        """Pull the contacts' impulses into their cones."""
        return np.concatenate([clamp(r[: self.contacts], self.mu), r[self.contacts :]])

    def stray(self, r: Array, u: Array, gain: float) -> float:
        """Alart & Curnier's natural map, whose zero Newton seeks; any gain > 0 has the same zeros."""
        return float(np.linalg.norm(r - self.clamp(r - gain * u))) / self.reference


def _search(p: _Problem, start: _Iterate, tol: float, sweeps: int, limit: int) -> tuple[_Iterate, Info]:
    """Alternate sweeps and Newton steps until the error is below tol or ``limit`` Newton steps are spent."""
    best = x = start
    steps = swept = 0
    largest = _largest_eigenvalue(p.W[: p.contacts, : p.contacts])
    eager = start.error < _NEAR or p.q.size <= _DENSE or p.contacts < p.q.size
    for _ in range(_ROUNDS):
        if not eager and best.error > tol:
            x = _sweep(p, x, largest, sweeps)
            swept, sweeps = swept + sweeps, min(2 * sweeps, _MOST_SWEEPS)
        for gain in _GAINS[: 1 if eager else None]:
            if min(best.error, x.error) <= tol or steps >= limit:
                break
            new, count = _newton(p, x, tol, limit - steps, gain * largest, _EAGER if eager else _SHORTEST)
            steps += count
            x = min(x, new, key=lambda i: i.error)
        best, eager = min(best, x, key=lambda i: i.error), False
        if best.error <= tol or steps >= limit:
            break
    return best, Info(steps, swept, best.error, best.error <= tol)


def _sweep(p: _Problem, x: _Iterate, largest: float, sweeps: int) -> _Iterate:
    """Sweep: projected gradient steps with Nesterov's momentum, restarted when it points uphill.

    O'Donoghue & Candes, Found. Comput. Math. 15 (2015) 715-732, gradient scheme; one product with W a sweep.
    """
    r, u = y, u_y = x.r, x.u
    theta = 1.0
    for _ in range(sweeps):
        r_new = np.concatenate([clamp((y - u_y / largest)[: p.contacts], p.mu), y[p.contacts :]])
        u_new = p.W @ r_new + p.q
        if (y - r_new) @ (r_new - r) > 0.0:
            theta = 1.0
        theta_new = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * theta**2))
        beta, theta = (theta - 1.0) / theta_new, theta_new
        y, u_y = r_new + beta * (r_new - r), u_new + beta * (u_new - u)
        r, u = r_new, u_new
    return p.at(r, u)


def _newton(p: _Problem, x: _Iterate, tol: float, limit: int, gain: float, shortest: float) -> tuple[_Iterate, int]:
    """Take Newton steps while the natural map goes down; return the end, clamped, and their number.

    On the way r may leave the cones: held inside, the steps get far shorter. The gain weighs the velocities
    when the contact states are read off r - gain u; a stiff body needs more than 1.
    """
    r, u = x.r, x.u
    stray, count, alpha = p.stray(r, u, gain), 0, 1.0
    while count < limit and alpha >= shortest:
        d = _newton_step(p, r, u, gain)
        d_u, count, alpha = p.W @ d, count + 1, 1.0
        while alpha >= shortest:
            new = p.stray(r + alpha * d, u + alpha * d_u, gain)
            if new < (1.0 - 1e-3 * alpha) * stray:
                r, u, stray = r + alpha * d, u + alpha * d_u, new
                break
            alpha *= 0.5
        if stray < tol and (end := p.at(p.clamp(r))).error <= tol:
            return end, count
    return p.at(p.clamp(r)), count


def _newton_step(p: _Problem, r: Array, u: Array, gain: float) -> Array:
    """Solve u_n = 0 where closed, u_t = 0 where it sticks, r_t = +-mu r_n where it slips, as at (r, u)."""
    free, B = _states((r - gain * u)[: p.contacts], p.mu, r.size - p.contacts)
    rows = p.W[free]
    start = B @ r[free]
    correction = B @ _solve_regular(rows @ B, -(rows @ start + p.q[free]))
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
    if size <= _DENSE:
        B = np.zeros((size, rows.size))
        B[at_row, at_column] = entries
        return rows, B
    return rows, sp.csr_array((entries, (at_row, at_column)), shape=(size, rows.size))


def _solve_regular(A: Matrix, b: Array) -> Array:
    """Solve A x = b by (A + tiny) and one refinement, which bounds redundant impulses; zeros if it fails."""
    try:
        if not _is_sparse(A):
            inverse = np.linalg.inv(A + _SHIFT * np.eye(b.size))
            x = inverse @ b
            return np.asarray(x + inverse @ (b - A @ x), dtype=float)
        shifted = sp.csc_array(A) + sp.diags_array(np.full(b.size, _SHIFT), format="csc")
        options = {"SymmetricMode": True}  # slip disturbs the symmetry of W little
        lu = splu(shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options=options)
        x = lu.solve(b)
        return np.asarray(x + lu.solve(b - A @ x), dtype=float)
    except (RuntimeError, np.linalg.LinAlgError):
        return np.zeros_like(b)


def _is_sparse(W: Matrix) -> bool:
    return bool(sp.issparse(W))


def _largest_eigenvalue(W: Matrix) -> float:
    """Bound the largest eigenvalue of W~: power iterations with a margin, at most the largest row sum."""
    x = 1.0 + np.sin(np.arange(W.shape[0]))  # any vector without symmetry will do
    for _ in range(8):
        x = W @ (x / max(float(np.linalg.norm(x)), _FLOOR))
    bound = min(1.2 * float(np.linalg.norm(x)), float(abs(W).sum(axis=1).max()))
    return bound if bound > 0.0 else 1.0


def _scale(W: Matrix, q: Array, mu: Array, contacts: int) -> tuple[_Problem, Array]:
    """Return the problem with unit diag(W), and s = sqrt(diag W)."""
    if _is_sparse(W) and q.size > _DENSE:
        W = sp.csr_array(W, dtype=float).sorted_indices()  # a copy: scaled in place
        s = root(np.abs(W.diagonal()))
        W.data /= np.repeat(s, np.diff(W.indptr)) * s[W.indices]
    else:
        W = np.asarray(sp.coo_array(W).toarray() if _is_sparse(W) else W, dtype=float)
        s = root(np.abs(W.diagonal()))
        W = W / (s[:, None] * s)
    q = q / s
    if contacts > mu.size:
        q[1:contacts:2][mu == 0.0] = 0.0  # rows without an unknown
    slope = scaled_friction(mu, s[:contacts])
    return _Problem(W, q, slope, max(float(np.linalg.norm(q)), _FLOOR), contacts), s


def _unscale(x: Array, slope: Array, s: Array, mu: Array) -> Array:
    """Return r = x / s with slipping contacts on the cone mu r_n to the last bit."""
    x_n, x_t, slope = split(x, slope)
    r_n, r_t, mu = split(x / s, mu)
    edge = mu * r_n
    slips = np.abs(x_t) >= slope * x_n
    return np.hstack([r_n, np.where(slips, np.sign(x_t) * edge, np.clip(r_t, -edge, edge))]).ravel()


def _check(W: Matrix, q: Array, mu: Array, r0: Array) -> None:
    shape, k = W.shape if _is_sparse(W) else np.shape(W), mu.size
    if mu.ndim != 1 or q.shape not in ((k,), (2 * k,)) or shape != q.shape * 2 or r0.shape != q.shape:
        raise ValueError(
            f"sizes disagree: W {shape}, q {q.shape}, mu {mu.shape}, r0 {r0.shape}; "
            "use (2k, 2k), (2k,), (k,), (2k,), or without friction (k, k), (k,), (k,), (k,)"
        )
    if k and mu.min() < 0.0:
        raise ValueError(f"friction {mu.min():g} is negative; use mu >= 0")
    if k and q.size == k and mu.max() > 0.0:
        raise ValueError(
            f"friction {mu.max():g} but no tangential rows; use W ({2 * k}, {2 * k}), rows n, t per contact"
        )
