"""The search for the impulses: accelerated projected sweeps, Newton's method, proximal problems, Lemke's method."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skmpm.coulomb.law import Array, clip_to_cone
from skmpm.coulomb.newton import newton
from skmpm.coulomb.path import follow
from skmpm.coulomb.problem import DENSE, Bilateral, Iterate, Matrix, Problem, is_sparse, scaled, unscaled

_GOOD_START = 0.05  # a start with a smaller residual goes to Newton after a few sweeps, which find most states ...
_FIRST_SWEEPS = 15
_FIRST_SHORTEST = 0.2  # ... and back to sweeps if that needs a smaller part of a step than this
_SHORTEST = 0.05  # smallest part of a Newton step
_GAINS = 1 / 3, 1 / 6, 1.0, 3.0  # of the natural map, relative to the largest eigenvalue of W~
_ROUNDS = 2  # of sweeps and Newton steps

# Proximal problems: the large gain weighs velocities as much as impulses where light and heavy bodies meet.
_PROXIMAL_GAINS = 1 / 3, 3e4
_FIRST, _LEAST, _MOST = 1e-2, 1e-12, 1.0  # weights
_DOWN, _UP = 0.1, 30.0  # the weight's factors where Newton solved the problem, and where it did not
_SOLVED = 0.5  # share of the residual that must be gone
_INNER = 30  # Newton steps for each, and gain
_STALL_LIMIT = 150  # Newton steps that must halve the residual
_PUSHES = 1.0, 10.0  # |q~| on every contact: where small problems start once more

# Paths, the last resort. 300 random contacts of 20 bodies, friction 1 to 2: 200 to more than 10,000 pieces, six in
# ten below 3,000; so short paths are tried first.
_PIECES = 10, 10, 20, 40, 80, 160  # at most, of one path after another, per contact
_WORK = 2e10  # of all paths: about ten seconds
_PATH_ROWS = 1500  # beyond, half of them acting on average, the work is not enough for a piece per contact


@dataclass(frozen=True)
class Info:
    """How a solve went; ``residual`` is the natural map relative to |q~|, or to the reference given."""

    iterations: int  # Newton steps
    sweeps: int
    residual: float
    converged: bool
    bilateral: Array = field(default_factory=lambda: np.zeros(0), compare=False)  # (m,) the further unknowns
    pieces: int = 0  # of paths, the last resort


def solve(
    W: Any,
    q: ArrayLike,
    mu: ArrayLike,
    *,
    r0: ArrayLike | None = None,
    tol: float = 1e-6,
    sweeps: int = 80,
    iterations: int = 600,
    bilateral: Bilateral | None = None,
    reference: float | None = None,
) -> tuple[Array, Info]:
    """Find r with u = W r + q such that every contact obeys Signorini and Coulomb; return (r, info).

    Accelerated projected sweeps find most contact states, a semismooth Newton method (Alart & Curnier,
    Comput. Methods Appl. Mech. Eng. 92 (1991) 353-375) the rest; where Newton stalls, because W is singular or
    nearly so, it goes on with proximal problems. The last resort, for up to 1,500 rows, is Lemke's method: a path of
    solutions from contacts that are all opened, which ends at a solution wherever some motion opens every contact by
    more than mu |u_t|, but may be too long (`info.pieces`; it gives up after about ten seconds). It stops on
    `residual` below tol |q~|, never on an increment; rows without an unknown do not count in q~. Where W is diagonal
    the solution is a formula. ``info.converged`` is False, and r the best found, after ``iterations`` Newton steps or
    when 150 of them do not halve the residual, and the last resort fails: the usual reason is that no solution exists
    (a rigid jam). Where W is singular r is one of many; round-off, about 1e-16 |W~| |r~|, bounds the residual from
    below.

    Parameters
    ----------
    W : (2k, 2k) or (k, k) sparse or dense, symmetric positive semi-definite [1/kg]
    q : (2k,) or (k,) relative velocities without impulses, with gap / dt on the normal rows [m/s]
    mu : (k,) friction coefficients; a contact with mu = 0 has no tangential unknown
    r0 : like q, impulses to start from [N s]
    sweeps : in the first round, from a poor start; the second round doubles them
    iterations : at most; with fewer than 150, or `linear`, there is no last resort
    linear : further unknowns, without a cone, that the impulses act on and that act on them
    reference : what residuals are relative to, instead of |q~|, like `residual`

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
    if bilateral is not None:
        W, q = bilateral.join(W, q)
        r0 = np.concatenate([r0, np.zeros(q.size - contacts)])
    with np.errstate(all="ignore"):  # without a solution r may overflow; the residual says so
        problem, s = scaled(W, q, mu, contacts, reference)
        start = problem.at(problem.independent if problem.uncoupled else problem.clip_to_cone(s * r0))
        best, info = _search(problem, start, tol, sweeps, iterations)
        r = unscaled(best.r[:contacts], best.u[:contacts], problem.mu, s[:contacts], mu)
        return r, replace(info, bilateral=best.r[contacts:] / s[contacts:])


def _search(p: Problem, start: Iterate, tol: float, sweeps: int, limit: int) -> tuple[Iterate, Info]:
    """Newton steps from a good start, else after sweeps, and proximal problems where they stall."""
    best, steps, swept = start, 0, 0
    if start.error < _GOOD_START or p.q.size <= DENSE or p.contacts < p.q.size:
        swept = _FIRST_SWEEPS if p.q.size > DENSE and start.error > tol else 0
        x, steps = _steps(p, _sweep(p, start, swept), tol, limit, _GAINS[:1], _FIRST_SHORTEST)
        best = _better(start, x)
    x = best
    for round_ in range(_ROUNDS):
        if best.error > tol and steps < limit:
            x, swept = _sweep(p, x, sweeps << round_), swept + (sweeps << round_)
            x, count = _steps(p, x, tol, limit - steps, _GAINS, _SHORTEST)
            best, steps = _better(best, x), steps + count
    for push in (None, *_PUSHES) if p.q.size <= DENSE else (None,):
        if best.error > tol and steps < limit:
            x, count = _proximal(p, best if push is None else p.pressed(push), tol, limit - steps)
            best, steps = _better(best, x), steps + count
    pieces = 0
    if best.error > tol and limit >= _STALL_LIMIT and p.contacts == p.q.size <= _PATH_ROWS:
        x, count, pieces = _paths(p, tol)
        best, steps = _better(best, x), steps + count
    return best, Info(steps, swept, best.error, best.error <= tol, pieces=pieces)


def _paths(p: Problem, tol: float) -> tuple[Iterate, int, int]:
    """Follow paths of solutions until one ends, and take Newton steps from there; return those and all pieces too."""
    pieces, work = 0, _WORK
    for seed, most in enumerate(_PIECES):
        r, count, work = follow(p, seed, most * p.mu.size, work)
        pieces += count
        if r is not None:
            return *_steps(p, p.at(r), tol, _STALL_LIMIT, _GAINS, _SHORTEST), pieces
        if work < 0.0:
            break
    return p.at(np.zeros_like(p.q)), 0, pieces


def _better(x: Iterate, y: Iterate) -> Iterate:
    return y if y.error < x.error else x


def _steps(
    p: Problem, x: Iterate, tol: float, limit: int, gains: tuple[float, ...], shortest: float
) -> tuple[Iterate, int]:
    """Newton with one gain after another, until the error is below tol; return the best and the number of steps."""
    steps = 0
    for gain in gains:
        if x.error <= tol or steps >= limit:
            break
        new, count = newton(p, x, tol, limit - steps, gain, shortest)
        x, steps = _better(x, new), steps + count
    return x, steps


def _proximal(p: Problem, x: Iterate, tol: float, limit: int) -> tuple[Iterate, int]:
    """Solve proximal problems from one solution to the next (Rockafellar, SIAM J. Control Optim. 14 (1976) 877-898).

    Their W + weight I is definite where W is singular, and their fixed points are solutions. The smaller the weight,
    the fewer problems it takes and the harder each is for Newton.
    """
    best, weight, steps = x, _FIRST, 0
    mark, marked = x.error, 0
    while tol < best.error < np.inf and steps < limit and steps - marked < _STALL_LIMIT:
        near, wanted = p.near(x.r, weight), max(_SOLVED * x.error, 0.3 * tol)
        new, count = _steps(near, near.at(x.r), wanted, min(_INNER, limit - steps), _PROXIMAL_GAINS, _SHORTEST)
        solved, steps = new.error <= wanted, steps + max(count, 1)  # 0 at the limit of round-off
        there = p.at(new.r)
        x = there if solved else _better(x, there)
        best = _better(best, x)
        weight = min(max(weight * (_DOWN if solved else _UP), _LEAST), _MOST)
        if best.error < 0.5 * mark:
            mark, marked = best.error, steps
    return best, steps


def _sweep(p: Problem, x: Iterate, sweeps: int) -> Iterate:
    """Sweep: projected gradient steps with Nesterov's momentum, restarted when it points uphill.

    O'Donoghue & Candes, Found. Comput. Math. 15 (2015) 715-732, gradient scheme; one product with W a sweep.
    """
    r, u = y, u_y = x.r, x.u
    theta = 1.0
    for _ in range(sweeps):
        r_new = np.concatenate([clip_to_cone((y - u_y / p.largest)[: p.contacts], p.mu), y[p.contacts :]])
        u_new = p.W @ r_new + p.q
        if (y - r_new) @ (r_new - r) > 0.0:
            theta = 1.0
        theta_new = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * theta**2))
        beta, theta = (theta - 1.0) / theta_new, theta_new
        y, u_y = r_new + beta * (r_new - r), u_new + beta * (u_new - u)
        r, u = r_new, u_new
    return p.at(r, u)


def _check(W: Matrix, q: Array, mu: Array, r0: Array) -> None:
    shape, k = W.shape if is_sparse(W) else np.shape(W), mu.size
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
