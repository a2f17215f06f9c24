"""Solution of the contact problem: Newton's, accelerated projected gradient, proximal point and Lemke's methods."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skmpm.coulomb.damped import better, damped_steps, sweep
from skmpm.coulomb.law import Array
from skmpm.coulomb.newton import full_steps
from skmpm.coulomb.path import follow
from skmpm.coulomb.problem import (
    MAX_DENSE_ROWS,
    Bilateral,
    Ints,
    Iterate,
    Matrix,
    Problem,
    is_sparse,
    scaled,
    unscaled,
)

_ROUNDS = 2  # of sweeps followed by Newton steps; the second round doubles the sweeps

# Proximal problems. The large gain weighs velocities as much as impulses where light and heavy bodies are in contact.
_PROXIMAL_GAINS = 1 / 3, 3e4
_FIRST_WEIGHT, _MIN_WEIGHT, _MAX_WEIGHT = 1e-2, 1e-12, 1.0  # of the proximal term; diag(W~) is one
_WEIGHT_DECREASE, _WEIGHT_INCREASE = 0.1, 30.0  # factors of the weight after success and failure of Newton's method
_PROXIMAL_REDUCTION = 0.5  # factor by which each proximal problem must reduce the residual
_MAX_PROXIMAL_STEPS = 30  # Newton steps per proximal problem
_STALL_LIMIT = 150  # stop when this many Newton steps have not halved the residual
# Normal impulses, in units of |q~|, from which proximal problems are started again: whether they stall depends on
# where they begin. Of 216 problems of 300 discs that full steps do not solve 9 stalled, and 7 of these not from zero.
_RESTART_DENSE, _RESTART_LARGE = (1.0, 10.0), (0.0,)

# Lemke's method, the last resort. Paths of 300 random contacts of 20 bodies with friction 1 to 2 have 200 to more
# than 10,000 pieces, six in ten of them fewer than 3,000; therefore short paths with different directions come first.
_MAX_PIECES = 10, 10, 20, 40, 80, 160  # per contact, of one path after another
_MAX_PATH_WORK = 2e10  # of all paths together, see `path.follow`: about ten seconds
_MAX_PATH_ROWS = 1500  # of larger problems, with half of the rows active, the work does not cover a piece per contact


@dataclass(frozen=True)
class Info:
    """Statistics of a solve.

    Attributes
    ----------
    iterations : Newton steps
    sweeps : between them
    residual : of the natural map, relative to ``|q~|`` or to `reference`
    converged : whether that is within the tolerance
    bilateral : the bilateral unknowns, (m,)
    pieces : of the paths of Lemke's method, the last resort
    """

    iterations: int
    sweeps: int
    residual: float
    converged: bool
    bilateral: Array = field(default_factory=lambda: np.zeros(0), compare=False)
    pieces: int = 0


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
    pairs: Ints | None = None,
) -> tuple[Array, Info]:
    """Find r such that every contact with u = W r + q obeys Signorini's and Coulomb's laws; return (r, info).

    Full steps of a semismooth Newton method (Alart & Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353-375)
    begin with the contact states of r0; if they do not converge, they begin again after accelerated projected
    gradient steps ("sweeps"). Where these fail too, because W is singular or nearly singular, proximal problems are
    solved. The last resort, for up to 1,500 rows, is Lemke's method: a path of solutions that begins with all
    contacts open. It ends at a solution if some motion opens every contact by more than ``mu |u_t|``, but may be too
    long (`info.pieces`; it is abandoned after about ten seconds). The solver stops when `residual` is below
    ``tol |q~|``, never on the size of an increment; tangential rows of frictionless contacts do not count in q~.
    ``info.converged`` is False, and r the best iterate, if ``iterations`` Newton steps do not suffice or 150 of them
    do not halve the residual, and Lemke's method fails. The usual reason is that no solution exists (a rigid jam). If
    W is singular, r is one of many solutions. Round-off, about ``1e-16 |W~| |r~|``, bounds the residual from below.

    Parameters
    ----------
    W : (2k, 2k) or (k, k) sparse or dense, symmetric positive semi-definite [1/kg], with `bilateral` m rows more
    q : (2k,) or (k,) relative velocities in the absence of impulses, plus gap / dt on the normal rows [m/s]
    mu : (k,) friction coefficients; a contact with mu = 0 has no tangential unknown
    r0 : like q, initial impulses [N s]
    tol : largest residual relative to ``|q~|``, or to `reference`
    sweeps : of the first round; the second round doubles them
    iterations : largest number of Newton steps; below 150, for problems that need not be solved, only those from r0
        are tried, and Lemke's method is not used
    bilateral : further unknowns without a cone that are coupled with the impulses
    reference : value that residuals are relative to, instead of ``|q~|``, as in `residual`
    pairs : (k,) labels of contacts, the same for those between the same bodies; given where these are weakly coupled
        with others, as in short dynamic steps, so that an iterative linear solver is tried before LU

    Raises
    ------
    ValueError
        If sizes disagree, a friction coefficient is negative, or mu > 0 without tangential rows.
    """
    q, mu = np.asarray(q, dtype=float), np.asarray(mu, dtype=float)
    r0 = np.asarray(np.zeros_like(q) if r0 is None else r0, dtype=float)
    _check(W, q, mu, r0, 0 if bilateral is None else bilateral.q.size)
    if not q.size:
        return np.zeros_like(q), Info(0, 0, 0.0, True)
    with np.errstate(all="ignore"):  # without a solution r may overflow, which the residual shows
        return _solve(W, q, mu, r0, tol, sweeps, iterations, bilateral, reference, pairs)


def _solve(
    W: Any,
    q: Array,
    mu: Array,
    r0: Array,
    tol: float,
    sweeps: int,
    iterations: int,
    bilateral: Bilateral | None,
    reference: float | None,
    pairs: Ints | None,
) -> tuple[Array, Info]:
    """`solve` for valid arguments: in scaled variables, with the bilateral unknowns after those of the contacts."""
    k = q.size
    if bilateral is not None:
        q = np.concatenate([q, bilateral.q])
        r0 = np.concatenate([r0, np.zeros(q.size - k)])
    problem, s = scaled(W, q, mu, k, reference)
    problem = replace(
        problem,
        negative=None if bilateral is None else bilateral.negative,
        blocks=None if pairs is None else _blocks(pairs, k, bilateral),
    )
    start = problem.at(problem.clip_to_cone(s * r0))
    best, info = _search(problem, start, tol, sweeps, iterations)
    r = unscaled(best.r[:k], best.u[:k], problem.mu, s[:k], mu)
    return r, replace(info, bilateral=best.r[k:] / s[k:])


def _blocks(pairs: Ints, rows: int, bilateral: Bilateral | None) -> Ints:
    """The labels of all rows, from 0 on: of contacts (rows,), then of the bilateral unknowns.

    Those that belong to no contact are blocks of their own.
    """
    pairs = np.unique(pairs, return_inverse=True)[1]
    of_contacts = np.repeat(pairs, rows // pairs.size)
    if bilateral is None:
        return of_contacts
    contact = np.broadcast_to(bilateral.contact, bilateral.q.shape)
    alone = pairs.max() + np.cumsum(contact < 0)
    return np.concatenate([of_contacts, np.where(contact < 0, alone, pairs[contact])])


def _search(p: Problem, start: Iterate, tol: float, sweeps: int, limit: int) -> tuple[Iterate, Info]:
    """Newton steps, at first and after sweeps; if they fail, proximal problems and Lemke's method.

    With fewer steps than a stall takes, only the first.
    """
    best, steps = full_steps(p, start, tol, limit)
    if limit < _STALL_LIMIT:
        return best, Info(steps, 0, best.error, best.error <= tol)
    swept = 0
    for round_ in range(_ROUNDS):
        if best.error > tol and steps < limit:
            x, swept = sweep(p, best, sweeps << round_), swept + (sweeps << round_)
            x, count = full_steps(p, x, tol, limit - steps)
            best, steps = better(best, x), steps + count
    for impulse in (None, *_restarts(p.q.size)):
        if best.error > tol and steps < limit:
            x, count = _proximal(p, best if impulse is None else p.pressed(impulse), tol, limit - steps)
            best, steps = better(best, x), steps + count
    pieces = 0
    if best.error > tol and p.contacts <= _MAX_PATH_ROWS:
        x, count, pieces = _paths(p, tol)
        best, steps = better(best, x), steps + count
    return best, Info(steps, swept, best.error, best.error <= tol, pieces=pieces)


def _restarts(rows: int) -> tuple[float, ...]:
    """Normal impulses of further starts; large problems have no other resort, for others Lemke's method is faster."""
    if rows <= MAX_DENSE_ROWS:
        return _RESTART_DENSE
    return _RESTART_LARGE if rows > _MAX_PATH_ROWS else ()


def _paths(p: Problem, tol: float) -> tuple[Iterate, int, int]:
    """Follow paths until one reaches a solution, then take Newton steps; return iterate, steps and pieces."""
    pieces, work, alone = 0, _MAX_PATH_WORK, p.of_contacts
    for seed, pieces_per_contact in enumerate(_MAX_PIECES):
        r, count, work = follow(alone, seed, pieces_per_contact * p.mu.size, work)
        pieces += count
        if r is not None:
            return *full_steps(p, p.at(np.append(r, np.zeros(p.q.size - r.size))), tol, _STALL_LIMIT), pieces
        if work < 0.0:
            break
    return p.at(np.zeros_like(p.q)), 0, pieces


def _proximal(p: Problem, x: Iterate, tol: float, limit: int) -> tuple[Iterate, int]:
    """Proximal point method (Rockafellar, SIAM J. Control Optim. 14 (1976) 877-898); return iterate and Newton steps.

    The matrices W + weight I are definite even if W is singular, and fixed points of the iteration are solutions. The
    smaller the weight, the fewer problems are needed and the harder each is for Newton's method.
    """
    best, weight, steps = x, _FIRST_WEIGHT, 0
    mark, marked = x.error, 0
    while tol < best.error < np.inf and steps < limit and steps - marked < _STALL_LIMIT:
        near, wanted = p.near(x.r, weight), max(_PROXIMAL_REDUCTION * x.error, 0.3 * tol)
        most = min(_MAX_PROXIMAL_STEPS, limit - steps)
        new, count = full_steps(near, near.at(x.r), wanted, most)
        if new.error > wanted:
            tried, more = damped_steps(near, near.at(x.r), wanted, most - count, _PROXIMAL_GAINS)
            new, count = better(new, tried), count + more
        solved, steps = new.error <= wanted, steps + max(count, 1)  # 0 at the limit of round-off
        candidate = p.at(new.r)
        x = candidate if solved else better(x, candidate)
        best = better(best, x)
        weight = min(max(weight * (_WEIGHT_DECREASE if solved else _WEIGHT_INCREASE), _MIN_WEIGHT), _MAX_WEIGHT)
        if best.error < 0.5 * mark:
            mark, marked = best.error, steps
    return best, steps


def _check(W: Matrix, q: Array, mu: Array, r0: Array, more: int) -> None:
    shape, k = W.shape if is_sparse(W) else np.shape(W), mu.size
    square = (q.size + more, q.size + more)
    if mu.ndim != 1 or q.shape not in ((k,), (2 * k,)) or shape != square or r0.shape != q.shape:
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
