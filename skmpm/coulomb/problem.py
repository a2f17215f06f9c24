"""The contact law, its natural-map residual, and the contact problem in variables scaled by diag(W)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from skmpm.arrays import EXACT, Array
from skmpm.compiled import compiled

OPEN, STICK, SLIP_PLUS, SLIP_MINUS = range(4)  # states of a contact; r_t = +-mu r_n where it slips
Matrix: TypeAlias = Any  # dense or CSR, with @
Ints: TypeAlias = NDArray[np.integer]

# Keeps norms in denominators positive; residuals of problems with |q~| below it are relative to it.
TINY = float(np.finfo(float).tiny)
MAX_DENSE_ROWS = 200  # problems with more rows use sparse matrices; for smaller ones dense algebra is faster
# Added to the unit diagonal of W~ in Newton steps: bounds the impulses of redundant contacts. Steps of 1e4 h / c
# leave elastic eigenvalues of 1e-7; of 1e-6 to 1e-10, 1e-8 and 1e-9 take the fewest steps for 165 problems.
REGULARISATION = 1e-8
LARGE_IMPULSE = float(np.finfo(float).max)  # exceeds mu r_n of every contact, so the contact slips


def project(r: ArrayLike, mu: ArrayLike) -> Array:
    """Nearest point to impulses in the Coulomb cones ``|r_t| <= mu r_n``.

    Parameters
    ----------
    r : (2k,) impulses or, without friction, (k,)
    mu : (k,) friction coefficients

    Returns
    -------
    like r

    Examples
    --------
    >>> import skmpm
    >>> impulses = [1.0, 3.0, 1.0, 0.1]  # (normal, tangential) of two contacts
    >>> skmpm.coulomb.project(impulses, mu=[0.5, 0.5]).round(3).tolist()
    [2.0, 1.0, 1.0, 0.1]
    """
    r, mu = np.array(r, dtype=float), np.asarray(mu, dtype=float)
    if not r.size:
        return r
    r_n, r_t, mu = split(r, mu)
    size = np.abs(r_t).sum(axis=1, keepdims=True)
    edge = np.maximum(np.where(size <= mu * r_n, r_n, (r_n + mu * size) / (1.0 + mu**2)), 0.0)
    return np.hstack([edge, np.clip(r_t, -mu * edge, mu * edge)]).ravel()


def residual(r: ArrayLike, u: ArrayLike, mu: ArrayLike, scale: ArrayLike, *, reference: float = 1.0) -> float:
    """Residual ``|r - P(r - (u + mu |u_t| n))| / reference`` in scaled variables, zero iff (r, u) obeys the law.

    Parameters
    ----------
    r, u : (2k,) impulses [N s] and relative velocities [m/s] or, without friction, (k,)
    mu : (k,) friction coefficients
    scale : like r, diag(W) [1/kg]; rows are scaled by `row_scales`
    reference : value that the residual is relative to

    Returns
    -------
    the residual

    Notes
    -----
    With the term ``mu |u_t| n`` the natural map describes Coulomb friction exactly and not its convex relaxation (De
    Saxce & Feng, Math. Comput. Modelling 28 (1998) 225-245). The residual certifies the solution of any solver.

    Examples
    --------
    >>> import skmpm
    >>> round(skmpm.coulomb.residual(r=[0.5], u=[0.0], mu=[0.0], scale=[2.0]), 3)
    0.0
    >>> round(skmpm.coulomb.residual(r=[0.5], u=[1.0], mu=[0.0], scale=[2.0]), 3)
    0.707
    """
    return float(np.linalg.norm(residuals(r, u, mu, scale))) / reference


def residuals(r: ArrayLike, u: ArrayLike, mu: ArrayLike, scale: ArrayLike) -> Array:
    """Contribution of each contact to `residual`, in scaled variables.

    Parameters
    ----------
    r, u, mu, scale : as for `residual`

    Returns
    -------
    (k,)

    Examples
    --------
    >>> import skmpm
    >>> skmpm.coulomb.residuals(r=[0.5, 0.5], u=[0.0, 1.0], mu=[0.0, 0.0], scale=[1.0, 1.0]).round(3).tolist()
    [0.0, 0.5]
    """
    r, u, mu = np.asarray(r, dtype=float), np.asarray(u, dtype=float), np.asarray(mu, dtype=float)
    s = root(row_scales(scale, mu.size))
    return _residuals(r * s, u / s, scaled_friction(mu, s))


def _residuals(r: Array, u: Array, mu: Array) -> Array:
    """Norms (k,) of the natural map of each contact, in scaled variables."""
    return np.asarray(np.linalg.norm(natural(r, u, mu).reshape(mu.size, r.size // max(mu.size, 1)), axis=1))


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
    """Scales of the rows: diag(W), with W_nn in tangential rows without response.

    Parameters
    ----------
    diagonal : diag(W), (2k,) or (k,) [1/kg]
    contacts : k

    Returns
    -------
    like diagonal

    Notes
    -----
    Where a support prescribes the tangential motion of a contact point, W_tt is zero up to round-off and friction is
    ``r_t = -mu r_n sign(u_t)``. The round-off of u_t, 1e-16 W_nn r, is 1e-16 sqrt(W_nn / W_tt) in the scale of its
    row. Where W_tt is below `EXACT` W_nn, that exceeds 1e-10, the smallest tolerance in use.

    Examples
    --------
    >>> import skmpm
    >>> skmpm.coulomb.row_scales([2.0, 4.0, 3.0, 0.0], contacts=2).tolist()
    [2.0, 4.0, 3.0, 3.0]
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


@dataclass(frozen=True)
class Bilateral:
    """Bilateral unknowns s (m,), without a cone; their rows and columns in W follow those of the contacts.

    In these rows W r + q = 0, in those of the contacts u = W r + q, with the impulses and s for r. The part of W for
    s alone is not necessarily definite, and W not necessarily symmetric.

    Attributes
    ----------
    q : (m,) velocities without impulses
    negative : number of negative eigenvalues of what W has for s besides the response to s, where W is symmetric. If
        the solution is a minimum of energy, the matrix of its closed contacts and s has as many (`newton`); Newton
        steps end where it has fewer. None: they are not counted
    """

    q: Array
    negative: int | None = None


@dataclass(frozen=True)
class Iterate:
    """Impulses, the velocities they cause, and the natural-map residual relative to the problem's reference."""

    r: Array  # (m,)
    u: Array  # (m,)
    error: float


@dataclass(frozen=True)
class Problem:
    """The scaled problem; arguments and results of its methods are in scaled variables, too."""

    W: Matrix  # (m, m), unit diagonal
    q: Array  # (m,)
    mu: Array  # (k,)
    reference: float  # residuals are relative to this
    contacts: int  # number of rows of contacts; the rows that follow are bilateral
    slide: Array | float = 0.0  # (m,) trial impulse opposite to the velocity of tangential rows without response
    shift: float = REGULARISATION  # added to the diagonal of the matrix of a Newton step
    negative: int | None = None  # `Bilateral.negative`
    repeated: bool = False  # whether it is one of many of a time step

    def at(self, r: Array) -> Iterate:
        """Return r with its velocities and its residual."""
        u, k = self.W @ r + self.q, self.contacts
        parts = np.concatenate([natural(r[:k], u[:k], self.mu), u[k:]])
        error = float(np.linalg.norm(parts)) / self.reference
        return Iterate(r, u, error if np.isfinite(error) else np.inf)

    def violations(self, r: Array, u: Array) -> Array:
        """How much each contact violates its law at impulses and velocities, (k,)."""
        return _residuals(r[: self.contacts], u[: self.contacts], self.mu)

    def clip_to_cone(self, r: Array) -> Array:
        """Clip the impulses of the contacts to their friction cones."""
        return np.concatenate([clip_to_cone(r[: self.contacts], self.mu), r[self.contacts :]])

    def near(self, r: Array, weight: float) -> Problem:
        """The proximal problem at r, with velocities u + weight (r_new - r) at the contacts."""
        diagonal = np.where(np.arange(self.q.size) < self.contacts, weight, 0.0)
        added = sp.diags_array(diagonal, format="csr") if is_sparse(self.W) else np.diag(diagonal)
        q, shift = self.q - diagonal * r, min(self.shift, 1e-3 * weight)
        return replace(self, W=self.W + added, q=q, slide=0.0, shift=shift)


def is_sparse(W: Matrix) -> bool:
    """Whether W is a sparse matrix."""
    return bool(sp.issparse(W))


def scaled(W: Matrix, q: Array, mu: Array, contacts: int, reference: float | None = None) -> tuple[Problem, Array]:
    """Return the problem with unit diag(W), and s = sqrt(diag W); residuals are relative to `reference` or |q~|."""
    if is_sparse(W) and q.size > MAX_DENSE_ROWS:
        W = sp.csr_array(W, dtype=float)
        W = W if W.has_sorted_indices else W.sorted_indices()
        response = W.diagonal()
        s, data = _roots(response, mu, contacts), np.empty_like(W.data)
        _divide(W.indptr, W.indices, W.data, s, data)
        W = sp.csr_array((data, W.indices, W.indptr), shape=W.shape)
        W.has_sorted_indices = True
    else:
        W = np.asarray(sp.coo_array(W).toarray() if is_sparse(W) else W, dtype=float)
        response = W.diagonal()
        s = _roots(response, mu, contacts)
        W = W / (s[:, None] * s)
    q = q / s
    if contacts > mu.size:
        q[1:contacts:2][mu == 0.0] = 0.0  # frictionless contacts have no tangential unknown
    slope = scaled_friction(mu, s[:contacts])
    reference = max(float(np.linalg.norm(q)) if reference is None else reference, TINY)
    return Problem(W, q, slope, reference, contacts, _slide(W, response / s**2, q, contacts, mu.size)), s


@compiled
def _divide(indptr: Ints, indices: Ints, given: Array, s: Array, out: Array) -> None:
    """Write the entries of a CSR matrix over s_i s_j."""
    for i in range(s.size):
        for e in range(indptr[i], indptr[i + 1]):
            out[e] = given[e] / (s[i] * s[indices[e]])


def _roots(diagonal: Array, mu: Array, contacts: int) -> Array:
    """Square roots of the scales of all rows."""
    return root(np.abs(np.concatenate([row_scales(diagonal[:contacts], mu.size), diagonal[contacts:]])))


def _slide(W: Matrix, response: Array, q: Array, contacts: int, k: int) -> Array | float:
    """`Problem.slide`: LARGE_IMPULSE opposite to q in tangential rows whose entries are all round-off, else zero.

    `response` is the diagonal of W.
    """
    suspects = np.flatnonzero(response[1:contacts:2] < EXACT) if contacts > k else np.zeros(0)
    if not suspects.size:
        return 0.0
    rows = 2 * suspects + 1
    largest = abs(W[rows]).max(axis=1)
    largest = largest.toarray().ravel() if is_sparse(W) else largest
    slide = np.zeros_like(q)
    slide[rows] = np.where(largest < EXACT, -LARGE_IMPULSE * np.sign(q[rows]), 0.0)
    return slide


def unscaled(x: Array, u: Array, slope: Array, s: Array, mu: Array) -> Array:
    """Return r = x / s with r_t = +-mu r_n in floating point at slipping contacts; u are the scaled velocities."""
    x_n, a_t, slope = split(x, slope)[0], split(x - u, slope)[1], slope[:, None]
    r_n, r_t, mu = split(x / s, mu)
    edge = mu * r_n
    slips = np.abs(a_t) >= slope * x_n
    return np.hstack([r_n, np.where(slips, np.sign(a_t) * edge, np.clip(r_t, -edge, edge))]).ravel()
