"""Damped Newton steps on the natural map, and accelerated projected gradient steps ("sweeps").

Of the many solutions where W is singular, those found by damped steps are closer to the start.
"""

from __future__ import annotations

import numpy as np

from skmpm.coulomb.law import clip_to_cone
from skmpm.coulomb.newton import newton
from skmpm.coulomb.problem import MAX_DENSE_ROWS, Iterate, Problem

# A start with a smaller residual goes to Newton after a few sweeps; if it then needs smaller steps than the third
# constant, more sweeps follow.
GOOD_START_RESIDUAL, GOOD_START_SWEEPS, GOOD_START_MIN_STEP = 0.05, 15, 0.2
GAINS = 1 / 3, 1 / 6, 1.0, 3.0  # of the natural map, in units of the largest eigenvalue of W~, tried in turn
MIN_STEP = 0.05  # smallest fraction of a Newton step in the backtracking


def damped_start(p: Problem, start: Iterate, tol: float, limit: int) -> tuple[Iterate, int, int]:
    """Damped Newton steps from a good start or for few rows; return the best iterate, the steps, and the sweeps."""
    if start.error >= GOOD_START_RESIDUAL and p.q.size > MAX_DENSE_ROWS and p.contacts == p.q.size:
        return start, 0, 0
    swept = GOOD_START_SWEEPS if p.q.size > MAX_DENSE_ROWS and start.error > tol else 0
    x, steps = damped_steps(p, sweep(p, start, swept), tol, limit, GAINS[:1], GOOD_START_MIN_STEP)
    return better(start, x), steps, swept


def damped_steps(
    p: Problem,
    x: Iterate,
    tol: float,
    limit: int,
    gains: tuple[float, ...] = GAINS,
    shortest: float = MIN_STEP,
) -> tuple[Iterate, int]:
    """Damped Newton steps with each gain in turn; return the best iterate and the number of steps."""
    steps = 0
    for gain in gains:
        if x.error > tol and steps < limit:
            new, count = newton(p, x, tol, limit - steps, gain, shortest)
            x, steps = better(x, new), steps + count
    return x, steps


def sweep(p: Problem, x: Iterate, sweeps: int) -> Iterate:
    """Projected gradient steps with Nesterov's momentum, restarted where it opposes the gradient step.

    Gradient scheme of O'Donoghue & Candes, Found. Comput. Math. 15 (2015) 715-732; one product with W per sweep.
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


def better(x: Iterate, y: Iterate) -> Iterate:
    """The iterate with the smaller residual."""
    return y if y.error < x.error else x
