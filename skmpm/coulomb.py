"""Signorini-Coulomb contact in the plane: impulses r and velocities u = W r + q; no grid is known here.

Per contact ``0 <= r_n  perp  u_n >= 0`` and ``|r_t| <= mu r_n``, r_t against u_t where it slips (Jean, Comput. Methods
Appl. Mech. Eng. 177 (1999) 235-257). Rows are interleaved, n0, t0, n1, t1, ...; a problem without friction leaves the
t rows out. All work is done in variables scaled by diag(W), which are O(1) however light or stiff a contact point
is: r~ = sqrt(diag W) r, u~ = u / sqrt(diag W), and a cone stays a cone with mu~ = mu sqrt(W_tt / W_nn).
"""

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.linalg import splu

Array: TypeAlias = NDArray[np.float64]

_FLOOR = 1e-300  # a problem with |q~| below it is at rest
_DENSE = 200  # rows up to which dense algebra beats sparse bookkeeping
_SHIFT = 1e-12  # relative to diag(W): makes redundant contacts regular
_MOST_SWEEPS = 640
_SHORTEST = 1e-2  # share of a Newton step
_GOOD = 0.05  # a start with a smaller residual goes straight to Newton


@dataclass(frozen=True)
class Info:
    """How a solve went: Newton ``iterations``, projected ``sweeps`` and the natural-map ``residual`` relative to |q~|."""

    iterations: int
    sweeps: int
    residual: float
    converged: bool


def project(r: ArrayLike, mu: ArrayLike) -> Array:
    """Return the nearest point to r, (2k,) or normals only (k,), in the product of the Coulomb cones ``|r_t| <= mu r_n``."""
    r, mu = np.asarray(r, dtype=float), np.asarray(mu, dtype=float)
    if not r.size:
        return r
    r_n, r_t, mu = _split(r, mu)
    size = np.abs(r_t).sum(axis=1, keepdims=True)
    edge = np.maximum(np.where(size <= mu * r_n, r_n, (r_n + mu * size) / (1.0 + mu**2)), 0.0)
    return np.hstack([edge, np.clip(r_t, -mu * edge, mu * edge)]).ravel()


def residual(r: ArrayLike, u: ArrayLike, mu: ArrayLike, scale: ArrayLike, *, reference: float = 1.0) -> float:
    """Return the natural map ``|r - P(r - (u + mu |u_t| n))| / reference`` in scaled variables: 0 iff (r, u) is Coulomb.

    The term mu |u_t| n makes it exact friction and not the convex relaxation (De Saxce & Feng, Math. Comput. Modelling
    28 (1998) 225-245; as error measure: Acary, Bremond & Huber, 2018). r, u and scale = diag(W) are (2k,) or (k,).
    """
    r, u, mu = np.asarray(r, dtype=float), np.asarray(u, dtype=float), np.asarray(mu, dtype=float)
    s = _root(np.asarray(scale, dtype=float))
    return _natural(r * s, u / s, _scaled_friction(mu, s)) / reference


def solve(
    W: Any,
    q: ArrayLike,
    mu: ArrayLike,
    *,
    r0: ArrayLike | None = None,
    tol: float = 1e-6,
    sweeps: int = 40,
    iterations: int = 100,
) -> tuple[Array, Info]:
    """Find r with u = W r + q such that every contact obeys Signorini and Coulomb; return (r, info).

    Accelerated projected sweeps find most contact states, a semismooth Newton method (Alart & Curnier, Comput. Methods
    Appl. Mech. Eng. 92 (1991) 353-375) the rest; where Newton stalls, more sweeps start from the best iterate. It stops
    on `residual` below tol |q~|, never on an increment. ``info.converged`` is False, and r the best found, after
    ``iterations`` Newton steps: the usual reason is that no solution exists (a rigid jam).

    Parameters
    ----------
    W : (2k, 2k) or (k, k) sparse or dense, symmetric positive semi-definite [1/kg]
    q : (2k,) or (k,) relative velocities without impulses, with gap / dt on the normal rows [m/s]
    mu : (k,) friction coefficients; a contact with mu = 0 has no tangential unknown
    r0 : like q, impulses to start from [N s]
    sweeps : projected sweeps before the first Newton step from a poor start

    Raises
    ------
    ValueError
        If sizes disagree, a friction coefficient is negative, or mu > 0 without tangential rows.
    """
    q, mu = np.asarray(q, dtype=float), np.asarray(mu, dtype=float)
    r0 = np.zeros_like(q) if r0 is None else np.asarray(r0, dtype=float)
    _check(W, q, mu, r0)
    if not q.size:
        return r0, Info(0, 0, 0.0, True)
    with np.errstate(all="ignore"):  # without a solution r may overflow; the residual says so
        problem, s = _scale(W, q, mu)
        best, info = _search(problem, problem.at(_clamp(s * r0, problem.mu)), tol, sweeps, iterations)
        return _unscale(best.r, problem.mu, s, mu), info


@dataclass(frozen=True)
class _Problem:
    """The scaled problem; what its methods return is in scaled variables too."""

    W: Any  # (m, m) dense or CSR, unit diagonal
    q: Array  # (m,)
    mu: Array  # (k,)
    reference: float

    def at(self, r: Array, u: Array | None = None) -> "_Iterate":
        """Return r with its velocities and its error."""
        u = self.W @ r + self.q if u is None else u
        error = _natural(r, u, self.mu) / self.reference
        return _Iterate(r, u, error if np.isfinite(error) else np.inf)


@dataclass(frozen=True)
class _Iterate:
    r: Array  # (m,)
    u: Array  # (m,)
    error: float


def _search(p: _Problem, start: _Iterate, tol: float, sweeps: int, limit: int) -> tuple[_Iterate, Info]:
    """Alternate sweeps and Newton steps until the error is below tol or ``limit`` Newton steps are spent."""
    best = x = start
    steps = swept = 0
    lipschitz = 0.0
    ready = p.q.size <= _DENSE or start.error < _GOOD
    while best.error > tol and steps < limit:
        if not ready:
            lipschitz = lipschitz or _largest_eigenvalue(p.W)
            x = _sweep(p, best, lipschitz, sweeps)
            swept, sweeps = swept + sweeps, min(2 * sweeps, _MOST_SWEEPS)
        x, count = _newton(p, x, tol, limit - steps)
        steps += count
        best, ready = min(best, x, key=lambda i: i.error), False
    return best, Info(steps, swept, best.error, best.error <= tol)


def _sweep(p: _Problem, x: _Iterate, lipschitz: float, sweeps: int) -> _Iterate:
    """Projected gradient sweeps with Nesterov's momentum and O'Donoghue & Candes' restart (Found. Comput. Math. 2015)."""
    r, u = y, u_y = x.r, x.u
    theta = 1.0
    for _ in range(sweeps):
        r_new = _clamp(y - u_y / lipschitz, p.mu)
        u_new = p.W @ r_new + p.q
        if (y - r_new) @ (r_new - r) > 0.0:
            theta = 1.0
        theta_new = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * theta**2))
        beta, theta = (theta - 1.0) / theta_new, theta_new
        y, u_y = r_new + beta * (r_new - r), u_new + beta * (u_new - u)
        r, u = r_new, u_new
    return p.at(r, u)


def _newton(p: _Problem, x: _Iterate, tol: float, limit: int) -> tuple[_Iterate, int]:
    """Semismooth Newton steps while the natural map goes down."""
    count = 0
    while x.error > tol and count < limit:
        step = _newton_step(p, x)
        count += 1
        new = _backtrack(p, x, step)
        if new is None:
            break
        x = new
    return x, count


def _backtrack(p: _Problem, x: _Iterate, step: Array) -> _Iterate | None:
    """Halve the step until the error goes down; None if it never does."""
    alpha = 1.0
    while alpha > _SHORTEST:
        new = p.at(_clamp(x.r + alpha * step, p.mu))
        if new.error < (1.0 - 1e-3 * alpha) * x.error:
            return new
        alpha *= 0.5
    return None


def _newton_step(p: _Problem, x: _Iterate) -> Array:
    """Solve for the active set of x: u_n = 0 where closed, u_t = 0 where it sticks, r_t = +-mu r_n where it slips."""
    free, B = _states(x.r - x.u, p.mu)
    start = B @ x.r[free]
    rows = p.W[np.flatnonzero(free)]
    A = rows @ B
    rhs = -(rows @ start + p.q[free])
    return start + B @ _regular_solve(A, rhs) - x.r


def _states(a: Array, mu: Array) -> tuple[NDArray[np.bool_], Any]:
    """Return which rows are unknowns at a = r - u, and the map B from them to all rows (slip: r_t = +-mu r_n)."""
    a_n, a_t, mu = _split(a, mu)
    closed, stick = a_n > 0.0, np.abs(a_t) < mu * a_n
    free = np.hstack([closed, stick]).ravel()
    number = np.cumsum(free) - 1
    slip = np.hstack([np.zeros_like(closed), closed & ~stick & (mu > 0.0)])[:, : stick.shape[1] + 1].ravel()
    rows, slips = np.flatnonzero(free), np.flatnonzero(slip)
    ratio = (np.sign(a_t) * mu).ravel()[slips // 2]
    entries = np.concatenate([np.ones(rows.size), ratio])
    columns = np.concatenate([number[rows], number[slips - 1]])
    B = sp.csr_array((entries, (np.concatenate([rows, slips]), columns)), shape=(a.size, rows.size))
    return free, B


def _regular_solve(A: Any, rhs: Array) -> Array:
    """Solve (A + tiny) x = rhs; zeros if A has no LU."""
    try:
        if sp.issparse(A):
            shifted = (A + _SHIFT * sp.eye_array(rhs.size)).tocsc()
            return splu(
                shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options={"SymmetricMode": True}
            ).solve(rhs)
        return np.linalg.solve(A + _SHIFT * np.eye(rhs.size), rhs)
    except (RuntimeError, np.linalg.LinAlgError):
        return np.zeros_like(rhs)


def _largest_eigenvalue(W: Any) -> float:
    """Bound the largest eigenvalue of a scaled W: a few power iterations with a margin, at most the row sum."""
    x = 1.0 + np.sin(np.arange(W.shape[0]))  # any vector without symmetry will do
    for _ in range(8):
        x = W @ (x / np.linalg.norm(x))
    return float(min(1.2 * np.linalg.norm(x), abs(W).sum(axis=1).max()))


def _natural(r: Array, u: Array, mu: Array) -> float:
    """Norm of the natural map in scaled variables, De Saxce's term included."""
    if not r.size:
        return 0.0
    u_n, u_t, slope = _split(u, mu)
    slide = np.hstack([u_n + slope * np.abs(u_t).sum(axis=1, keepdims=True), u_t]).ravel()
    return float(np.linalg.norm(r - project(r - slide, mu)))


def _clamp(r: Array, mu: Array) -> Array:
    """Pull r into the cones, normal first: r_n = max(r_n, 0), then |r_t| <= mu r_n."""
    r_n, r_t, mu = _split(r, mu)
    r_n = np.maximum(r_n, 0.0)
    return np.hstack([r_n, np.clip(r_t, -mu * r_n, mu * r_n)]).ravel()


def _split(r: Array, mu: Array) -> tuple[Array, Array, Array]:
    """Views of the normal (k, 1) and tangential (k, 1) or, if there are none, (k, 0) rows; mu as (k, 1)."""
    rows = r.reshape(mu.size, -1)
    return rows[:, :1], rows[:, 1:], mu[:, None]


def _root(scale: Array) -> Array:
    """sqrt(diag W); a row of zeros cannot be scaled and is left alone."""
    return np.sqrt(np.where(scale > 0.0, scale, 1.0))


def _scaled_friction(mu: Array, s: Array) -> Array:
    return mu if s.size == mu.size else mu * s[1::2] / s[0::2]


def _scale(W: Any, q: Array, mu: Array) -> tuple[_Problem, Array]:
    """Return the problem with unit diag(W), and s = sqrt(diag W)."""
    sparse = sp.issparse(W) and q.size > _DENSE
    W = sp.csr_array(W) if sparse else (W.toarray() if sp.issparse(W) else np.asarray(W, dtype=float))
    s = _root(W.diagonal())
    if sparse:
        scaled = W.data / (np.repeat(s, np.diff(W.indptr)) * s[W.indices])
        W = sp.csr_array((scaled, W.indices, W.indptr), shape=W.shape)
    else:
        W = W / (s[:, None] * s)
    q = q / s
    if q.size > mu.size:
        q[1::2][mu == 0.0] = 0.0  # idle rows
    return _Problem(W, q, _scaled_friction(mu, s), max(float(np.linalg.norm(q)), _FLOOR)), s


def _unscale(r: Array, slope: Array, s: Array, mu: Array) -> Array:
    """Back to r = r~ / s, with slipping contacts on the cone mu r_n to the last bit."""
    x_n, x_t, slope = _split(r, slope)
    r_n, r_t, mu = _split(r / s, mu)
    slips = np.abs(x_t) >= slope * x_n
    edge = mu * r_n
    return np.hstack([r_n, np.where(slips, np.sign(x_t) * edge, np.clip(r_t, -edge, edge))]).ravel()


def _check(W: Any, q: Array, mu: Array, r0: Array) -> None:
    shape, k = np.shape(W), mu.size
    if mu.ndim != 1 or q.shape not in ((k,), (2 * k,)) or shape != q.shape * 2 or r0.shape != q.shape:
        given = f"W {shape}, q {q.shape}, mu {mu.shape}, r0 {r0.shape}"
        raise ValueError(
            f"sizes disagree: {given}; use W (2k, 2k), q (2k,), mu (k,), or without friction (k, k), (k,), (k,)"
        )
    if k and mu.min() < 0.0:
        raise ValueError(f"friction {mu.min():g} is negative; use mu >= 0")
    if k and q.size == k and mu.max() > 0.0:
        raise ValueError(
            f"friction {mu.max():g} without tangential rows; use W ({2 * k}, {2 * k}), rows n, t per contact"
        )
