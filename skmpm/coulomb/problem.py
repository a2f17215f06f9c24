"""The problem in variables scaled by diag(W)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp

from skmpm.coulomb.law import NEGLIGIBLE, Array, clip_to_cone, natural, root, row_scales, scaled_friction, split

Matrix: TypeAlias = Any  # dense or CSR, with @

FLOOR = 1e-300  # a problem with |q~| below it is at rest
DENSE = 200  # rows up to which dense algebra beats sparse bookkeeping
REGULARISATION = 1e-6
ZERO_ENTRY = 1e-14  # of entries of W~
HUGE = 1e200  # impulse that no cone contains


@dataclass(frozen=True)
class Bilateral:
    """Unknowns s (m,) without a cone: coupling r + compliance s + q = 0, and u = W r + back s + q_contact."""

    coupling: Matrix  # (m, 2k) or (m, k)
    compliance: Matrix  # (m, m) not necessarily definite
    q: Array  # (m,)
    back: Matrix | None = None  # (2k, m) or (k, m); coupling' if not given

    def join(self, W: Matrix, q: Array) -> tuple[Matrix, Array]:
        """The matrix and the right-hand side of all unknowns, contacts first."""
        back = self.coupling.T if self.back is None else self.back
        whole = sp.block_array([[sp.csr_array(W), back], [self.coupling, self.compliance]], format="csr")
        return whole, np.concatenate([q, self.q])


@dataclass(frozen=True)
class Iterate:
    """Impulses, their velocities and the natural map's residual relative to the problem's reference."""

    r: Array  # (m,)
    u: Array  # (m,)
    error: float


@dataclass(frozen=True)
class Problem:
    """The scaled problem; what its methods return is in scaled variables too."""

    W: Matrix  # (m, m), unit diagonal
    q: Array  # (m,)
    mu: Array  # (k,)
    reference: float
    contacts: int  # rows; those that follow are linear
    largest: float  # bound of the largest eigenvalue of the contacts' W
    slide: Array | float = 0.0  # (m,) against the velocity of rows that do not respond: larger than any impulse
    shift: float = REGULARISATION  # of the diagonal of a Newton step's matrix: keeps redundant contacts in hand

    @property
    def uncoupled(self) -> bool:
        """Whether W is diagonal: then r is `independent`."""
        entries = self.W.data if is_sparse(self.W) else self.W
        responding = np.count_nonzero(np.abs(self.W.diagonal()) > ZERO_ENTRY)
        return bool(np.count_nonzero(np.abs(entries) > ZERO_ENTRY) == responding)

    @property
    def independent(self) -> Array:
        """The impulses of contacts that do not act on each other: -q pulled into the cones."""
        return self.clip_to_cone(self.slide - self.q)

    def at(self, r: Array, u: Array | None = None) -> Iterate:
        """Return r with its velocities and its error."""
        u = self.W @ r + self.q if u is None else u
        k = self.contacts
        parts = np.concatenate([natural(r[:k], u[:k], self.mu), u[k:]])
        error = float(np.linalg.norm(parts)) / self.reference
        return Iterate(r, u, error if np.isfinite(error) else np.inf)

    def clip_to_cone(self, r: Array) -> Array:
        """Pull the contacts' impulses into their cones."""
        return np.concatenate([clip_to_cone(r[: self.contacts], self.mu), r[self.contacts :]])

    def pressed(self, push: float) -> Iterate:
        """The iterate with normal impulses of push |q~| on every contact."""
        normal = np.arange(self.q.size) % (self.contacts // self.mu.size) == 0
        normal[self.contacts :] = False
        return self.at(push * float(np.linalg.norm(self.q)) * normal)

    def natural_residual(self, r: Array, u: Array, gain: float) -> float:
        """Alart & Curnier's natural map, whose zero Newton seeks; any gain > 0 has the same zeros."""
        return float(np.linalg.norm(r - self.clip_to_cone(r - gain * u))) / self.reference

    def near(self, r: Array, weight: float) -> Problem:
        """The proximal problem at r: the same with velocities u + weight (r_new - r) of the contacts."""
        diagonal = np.where(np.arange(self.q.size) < self.contacts, weight, 0.0)
        added = sp.diags_array(diagonal, format="csr") if is_sparse(self.W) else np.diag(diagonal)
        q, shift = self.q - diagonal * r, min(self.shift, 1e-3 * weight)
        return replace(self, W=self.W + added, q=q, slide=0.0, shift=shift)


def is_sparse(W: Matrix) -> bool:
    """Whether W is a sparse matrix."""
    return bool(sp.issparse(W))


def scaled(W: Matrix, q: Array, mu: Array, contacts: int, reference: float | None = None) -> tuple[Problem, Array]:
    """Return the problem with unit diag(W), and s = sqrt(diag W); residuals are relative to `reference` or |q~|."""
    if is_sparse(W) and q.size > DENSE:
        W = sp.csr_array(W, dtype=float).sorted_indices()  # a copy: scaled in place
        s = _roots(W, mu, contacts)
        W.data /= np.repeat(s, np.diff(W.indptr)) * s[W.indices]
    else:
        W = np.asarray(sp.coo_array(W).toarray() if is_sparse(W) else W, dtype=float)
        s = _roots(W, mu, contacts)
        W = W / (s[:, None] * s)
    q = q / s
    if contacts > mu.size:
        q[1:contacts:2][mu == 0.0] = 0.0  # rows without an unknown
    slope = scaled_friction(mu, s[:contacts])
    reference = max(float(np.linalg.norm(q)) if reference is None else reference, FLOOR)
    largest, slide = _largest_eigenvalue(W[:contacts, :contacts]), _slide(W, q, contacts, mu.size)
    return Problem(W, q, slope, reference, contacts, largest, slide), s


def _roots(W: Matrix, mu: Array, contacts: int) -> Array:
    """Square roots of the scales of all rows."""
    diagonal = W.diagonal()
    return root(np.abs(np.concatenate([row_scales(diagonal[:contacts], mu.size), diagonal[contacts:]])))


def _slide(W: Matrix, q: Array, contacts: int, k: int) -> Array | float:
    """What `Problem.slide` is: HUGE against q where all entries of a tangential row are round-off, else zero."""
    suspects = np.flatnonzero(W.diagonal()[1:contacts:2] < NEGLIGIBLE) if contacts > k else np.zeros(0)
    if not suspects.size:
        return 0.0
    rows = 2 * suspects + 1
    largest = abs(W[rows]).max(axis=1)
    largest = largest.toarray().ravel() if is_sparse(W) else largest
    slide = np.zeros_like(q)
    slide[rows] = np.where(largest < ZERO_ENTRY, -HUGE * np.sign(q[rows]), 0.0)
    return slide


def _largest_eigenvalue(W: Matrix) -> float:
    """Bound the largest eigenvalue of W~: power iterations with a margin, at most the largest row sum."""
    x = 1.0 + np.sin(np.arange(W.shape[0]))  # any vector without symmetry will do
    for _ in range(8):
        x = W @ (x / max(float(np.linalg.norm(x)), FLOOR))
    bound = min(1.2 * float(np.linalg.norm(x)), float(abs(W).sum(axis=1).max()))
    return bound if bound > 0.0 else 1.0


def unscaled(x: Array, u: Array, slope: Array, s: Array, mu: Array) -> Array:
    """Return r = x / s with slipping contacts on the cone mu r_n to the last bit; u are the scaled velocities."""
    x_n, a_t, slope = split(x, slope)[0], split(x - u, slope)[1], slope[:, None]
    r_n, r_t, mu = split(x / s, mu)
    edge = mu * r_n
    slips = np.abs(a_t) >= slope * x_n
    return np.hstack([r_n, np.where(slips, np.sign(a_t) * edge, np.clip(r_t, -edge, edge))]).ravel()
