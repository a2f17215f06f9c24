"""The contact law: friction cones, the projection on them, and the natural-map residual."""

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import EXACT, Array

OPEN, STICK, SLIP_PLUS, SLIP_MINUS = range(4)  # states of a contact; r_t = +-mu r_n where it slips
SLIP_SIGN = np.array([0.0, 0.0, 1.0, -1.0])  # sign of r_t for each state


def project(r: ArrayLike, mu: ArrayLike) -> Array:
    """Return the nearest point to r, (2k,) or normals only (k,), in the Coulomb cones ``|r_t| <= mu r_n``."""
    r, mu = np.array(r, dtype=float), np.asarray(mu, dtype=float)
    if not r.size:
        return r
    r_n, r_t, mu = split(r, mu)
    size = np.abs(r_t).sum(axis=1, keepdims=True)
    edge = np.maximum(np.where(size <= mu * r_n, r_n, (r_n + mu * size) / (1.0 + mu**2)), 0.0)
    return np.hstack([edge, np.clip(r_t, -mu * edge, mu * edge)]).ravel()


def residual(r: ArrayLike, u: ArrayLike, mu: ArrayLike, scale: ArrayLike, *, reference: float = 1.0) -> float:
    """Return ``|r - P(r - (u + mu |u_t| n))| / reference`` in scaled variables, zero iff (r, u) obeys the law.

    With the term ``mu |u_t| n`` the natural map describes Coulomb friction exactly and not its convex relaxation (De
    Saxce & Feng, Math. Comput. Modelling 28 (1998) 225-245). The residual certifies the solution of any solver.
    r [N s], u [m/s] and scale = diag(W) [1/kg] are (2k,) or, without friction, (k,); rows are scaled by `row_scales`.
    """
    return float(np.linalg.norm(residuals(r, u, mu, scale))) / reference


def residuals(r: ArrayLike, u: ArrayLike, mu: ArrayLike, scale: ArrayLike) -> Array:
    """Return the contribution of each contact to `residual`, (k,), in scaled variables."""
    r, u, mu = np.asarray(r, dtype=float), np.asarray(u, dtype=float), np.asarray(mu, dtype=float)
    s = root(row_scales(scale, mu.size))
    parts = natural(r * s, u / s, scaled_friction(mu, s))
    return np.asarray(np.linalg.norm(parts.reshape(mu.size, r.size // max(mu.size, 1)), axis=1))


def natural(r: Array, u: Array, mu: Array) -> Array:
    """The natural map r - P(r - u) in scaled variables, with De Saxce's term in u, of the shape of r."""
    if not r.size:
        return np.zeros(0)
    u_n, u_t, slope = split(u, mu)
    lifted = np.hstack([u_n + slope * np.abs(u_t).sum(axis=1, keepdims=True), u_t]).ravel()
    return np.asarray(r - project(r - lifted, mu))


def clip_to_cone(r: Array, mu: Array) -> Array:
    """Clip r to the friction cones: r_n = max(r_n, 0), then ``|r_t| <= mu r_n``; not the orthogonal projection."""
    r_n, r_t, mu = split(r, mu)
    r_n = np.maximum(r_n, 0.0)
    return np.hstack([r_n, np.clip(r_t, -mu * r_n, mu * r_n)]).ravel()


def split(r: Array, mu: Array) -> tuple[Array, Array, Array]:
    """Return the normal rows (k, 1), the tangential rows (k, 1), or (k, 0) without friction, and mu (k, 1)."""
    rows = r.reshape(mu.size, -1)
    return rows[:, :1], rows[:, 1:], mu[:, None]


def row_scales(diagonal: ArrayLike, contacts: int) -> Array:
    """Return the scales of the rows, diag(W) with W_nn in tangential rows without response, (2k,) or (k,) [1/kg].

    Where a support prescribes the tangential motion of a contact point, W_tt is zero up to round-off and friction is
    ``r_t = -mu r_n sign(u_t)``. The round-off of u_t, 1e-16 W_nn r, is 1e-16 sqrt(W_nn / W_tt) in the scale of its
    row. Where W_tt is below `EXACT` W_nn, that exceeds 1e-10, the smallest tolerance in use.
    """
    diagonal = np.array(diagonal, dtype=float)
    if diagonal.size > contacts:
        normal, tangential = diagonal[0::2], diagonal[1::2]
        diagonal[1::2] = np.where(tangential > EXACT * normal, tangential, normal)
    return diagonal


def root(scale: Array) -> Array:
    """Square roots of the scales of the rows, one for rows of zeros, which cannot be scaled."""
    return np.sqrt(np.where(scale > 0.0, scale, 1.0))


def scaled_friction(mu: Array, s: Array) -> Array:
    """Return mu~ = mu sqrt(W_tt / W_nn), for s = sqrt(diag W)."""
    return mu if s.size == mu.size else mu * s[1::2] / s[0::2]
