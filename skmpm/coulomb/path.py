"""Lemke's method: follow the path of solutions from open contacts to the contact problem.

See Cottle, Pang & Stone, The Linear Complementarity Problem, 1992; with friction Stewart & Trinkle, Int. J. Numer.
Methods Eng. 39 (1996) 2673-2691. Velocities are u + g e with e > 0 on the normal rows, so g > 0 opens all contacts.
For large g no contact is active, and this solution is unique. In the plane the contact law is piecewise linear, and
so is the path of solutions that begins there: along a piece all contacts keep their states, at its end one state
changes. The parameter g need not decrease monotonically. If some motion opens every contact by more than mu |u_t|,
solutions are bounded for all g >= 0, and the path leads to g = 0 (for the criterion see Klarbring & Pang, SIAM J.
Optim. 8 (1998)). The number of pieces depends on e.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.coulomb.law import OPEN, SLIP_MINUS, SLIP_PLUS, SLIP_SIGN, STICK, Array
from skmpm.coulomb.problem import Problem, is_sparse

REGULARISATION = 1e-9  # added to diag(W~): makes pieces unique and impulses finite for redundant contacts
ZERO_RATE = 1e-12  # rates of inequalities below this fraction of the largest are round-off

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Vertex:
    """Start of a piece: the states, and the inequality that is active there and increases along the piece."""

    state: Ints  # (k,)
    gap: float  # g
    contact: int  # the contact whose state changes
    leaving: int  # its inequality, a row of `_margins`


def follow(p: Problem, seed: int, limit: int, work: float) -> tuple[Array | None, int, float]:
    """Follow a path to g = 0; return the impulses, or None, the number of pieces, and the remaining work.

    The components of e are random numbers between 1 and 1.5, generated from `seed`. A piece with m unknowns out of n
    rows costs m^3 + 8 n m of work; the path is abandoned after `limit` pieces or when the work is used up.
    """
    W = np.ascontiguousarray((p.W.toarray() if is_sparse(p.W) else p.W).T) + REGULARISATION * np.eye(p.q.size)
    e = np.zeros(p.q.size)
    e[:: p.q.size // p.mu.size] = 1.0 + 0.5 * np.random.default_rng(seed).random(p.mu.size)
    x, load = _first(p, e), np.stack([p.q, e], axis=1)
    if x.gap <= 0.0:
        return np.zeros_like(p.q), 0, work
    for piece in range(1, limit + 1):
        try:
            r, u, size = _piece(W, load, p.mu, x.state)
        except np.linalg.LinAlgError:
            return None, piece, work
        work -= size**3 + 8.0 * p.q.size * size
        following = _next(x, r, u, p.mu)
        if following is None or work < 0.0:
            return None, piece, work
        if following.gap <= 0.0:
            return r[..., 0].ravel(), piece, work
        x = following
    return None, limit, work


def _first(p: Problem, e: Array) -> Vertex:
    """Start of the path: the largest g for which a contact is active."""
    stride = p.q.size // p.mu.size
    gaps = -p.q[::stride] / e[::stride]
    contact = int(np.argmax(gaps))
    state = np.full(p.mu.size, OPEN)
    state[contact] = _slip(p.q[contact * stride + 1] if stride > 1 else 0.0)
    return Vertex(state, float(gaps[contact]), contact, 0)


def _slip(velocity: float) -> int:
    """State of a contact that closes while it slides with this tangential velocity."""
    return SLIP_MINUS if velocity > 0.0 else SLIP_PLUS


def _piece(columns: Array, load: Array, mu: Array, state: Ints) -> tuple[Array, Array, int]:
    """Impulses and velocities (k, rows, 2), as value at g = 0 and derivative by g, and the number of unknowns.

    `columns` is the transpose of W, whose rows are contiguous in memory.
    """
    stride = load.shape[0] // mu.size
    closed, stick = np.flatnonzero(state != OPEN), np.flatnonzero(state == STICK)
    slope = SLIP_SIGN[state[closed]] * mu[closed]
    free = np.concatenate([stride * closed, stride * stick + 1])
    acting = columns[free]
    if stride > 1:
        slips = np.flatnonzero(slope)
        acting[slips] += slope[slips, None] * columns[2 * closed[slips] + 1]
    x = np.linalg.solve(acting[:, free].T, -load[free])
    r = np.zeros((mu.size, stride, 2))
    r[closed, 0] = x[: closed.size]
    if stride > 1:
        r[closed, 1] = slope[:, None] * x[: closed.size]
        r[stick, 1] = x[closed.size :]
    return r, ((x.T @ acting).T + load).reshape(mu.size, stride, 2), free.size


def _margins(state: Ints, r: Array, u: Array, mu: Array) -> Array:
    """Two quantities per contact that stay non-negative while states persist, (2, k, 2): value at g = 0, rate in g.

    Open: u_n. Slipping: r_n and, with friction, the velocity opposite to r_t. Sticking: mu r_n -+ r_t. Else zero.
    """
    out = np.zeros((2, *state.shape, 2))
    slips, sticks = state >= SLIP_PLUS, state == STICK
    out[0] = np.where((state == OPEN)[:, None], u[:, 0], r[:, 0])
    if r.shape[1] > 1:
        edge = mu[:, None] * r[:, 0]
        out[0, sticks] = (edge - r[:, 1])[sticks]
        out[1, sticks] = (edge + r[:, 1])[sticks]
        out[1, slips] = (-SLIP_SIGN[state] * (mu > 0.0))[slips, None] * u[slips, 1]
    return out


def _next(x: Vertex, r: Array, u: Array, mu: Array) -> Vertex | None:
    """The end of the piece that begins at x, with gap 0 if it reaches g = 0; None if the piece is unbounded."""
    value, rate = np.moveaxis(_margins(x.state, r, u, mu), -1, 0)
    down = -1.0 if rate[x.leaving, x.contact] < 0.0 else 1.0
    rate = down * rate
    falls = rate < -ZERO_RATE * np.abs(rate).max()
    falls[x.leaving, x.contact] = False
    left = np.where(falls, np.maximum(value + down * x.gap * rate, 0.0) / np.where(falls, -rate, 1.0), np.inf)
    row, contact = divmod(int(np.argmin(left)), mu.size)
    gap = x.gap + down * float(left[row, contact])
    if gap <= 0.0 or not np.isfinite(gap):
        return Vertex(x.state, 0.0, contact, row) if gap <= 0.0 else None
    state, now = x.state.copy(), x.state[contact]
    if now == OPEN:
        velocity = u[contact, 1] @ [1.0, gap] if u.shape[1] > 1 else 0.0
        state[contact], row = _slip(velocity), 0
    elif now == STICK:
        state[contact], row = (SLIP_PLUS, SLIP_MINUS)[row], 1
    else:
        state[contact], row = (OPEN, 0) if row == 0 else (STICK, now - SLIP_PLUS)
    return Vertex(state, gap, contact, row)
