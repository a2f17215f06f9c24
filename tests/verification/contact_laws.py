"""Signorini's and Coulomb's laws as they are written, contact by contact, in variables scaled by diag(W)."""

import numpy as np


def rows_of(x, mu):
    """Normal and tangential rows; without friction the latter are zero."""
    return (x[::2], x[1::2]) if x.size == 2 * mu.size else (x, np.zeros_like(x))


def violation(W, q, mu, r):
    """The largest violation of r_n >= 0, u_n >= 0, r_n u_n = 0, |r_t| <= mu r_n and r_t against u_t, over |q|."""
    s = np.sqrt(W.diagonal())
    (s_n, s_t), moving = rows_of(s, mu), mu > 0.0
    u = (W @ r + q) / s
    (r_n, r_t), (u_n, u_t) = rows_of(s * r, mu), rows_of(u, mu)
    slope = mu * s_t / s_n if r.size > mu.size else mu
    counted = np.ones(q.size, dtype=bool)
    if r.size > mu.size:
        counted[1::2] = moving
    laws = [-r_n, -u_n, np.minimum(r_n, u_n), np.abs(r_t) - slope * r_n]
    against = np.abs(r_t + np.sign(u_t) * slope * r_n)
    laws.append(np.where(moving, np.minimum(np.abs(u_t), against / np.maximum(slope, 1.0)), 0.0))
    return float(max(law.max() for law in laws) / np.linalg.norm((q / s)[counted]))
