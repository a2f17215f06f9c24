"""Damped Newton steps on the natural map, and accelerated projected gradient steps ("sweeps")."""

from __future__ import annotations

import numpy as np

from skmpm.coulomb.law import clip_to_cone
from skmpm.coulomb.newton import newton
from skmpm.coulomb.problem import Iterate, Problem

MIN_STEP = 0.05  # smallest fraction of a Newton step in the backtracking


def damped_steps(p: Problem, x: Iterate, tol: float, limit: int, gains: tuple[float, ...]) -> tuple[Iterate, int]:
    """Damped Newton steps with each gain in turn; return the best iterate and the number of steps."""
    steps = 0
    for gain in gains:
        if x.error > tol and steps < limit:
            new, count = newton(p, x, tol, limit - steps, gain, MIN_STEP)
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
