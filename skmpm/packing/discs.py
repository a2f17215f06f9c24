"""Non-overlapping motion of rigid discs, for `packing`: in a box with walls, or in a periodic one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from skmpm import coulomb

Array = NDArray[np.float64]

START = 0.3  # initial over final size of the discs
MARGIN = 0.5  # pairs with a smaller gap are constraints [mean radius]
OVERLAP = 1e-6, 1e-3  # allowed at the end and during growth [smallest radius]
TOLERANCE = 1e-9  # of the contact solver
ACCEPTED = 1e-5  # if the solver stalls; the next linearisation corrects the error
NEWTON = 20
ROUNDS = 12  # linearisations per step


@dataclass(frozen=True)
class Box:
    """The box, in mean radii."""

    size: Array  # (2,)
    periodic: bool

    def pairs(self, x: Array, distance: float) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
        """Pairs of centres x (2, N) closer than a distance, and the vectors (2, pairs) from second to first."""
        if not self.periodic:
            a, b = cKDTree(x.T).query_pairs(distance, output_type="ndarray").T
            return a, b, x[:, a] - x[:, b]
        within = np.minimum(np.mod(x.T, self.size), np.nextafter(self.size, 0.0))  # mod may return the size itself
        a, b = cKDTree(within, boxsize=self.size).query_pairs(distance, output_type="ndarray").T
        apart = x[:, a] - x[:, b]
        return a, b, apart - self.size[:, None] * np.rint(apart / self.size[:, None])

    def walls(self, x: Array, R: Array) -> Array:
        """Gaps between discs and the left, bottom, right and top wall, (4 N,), where there are walls."""
        if self.periodic:
            return np.zeros(0)
        return np.concatenate([x - R, self.size[:, None] - x - R]).ravel()


def scatter(R: Array, box: Box, rng: np.random.Generator) -> Array:
    """Draw a centre in each of N cells of a grid: random, but without the voids of independent centres."""
    columns = int(np.ceil(np.sqrt(R.size * box.size[0] / box.size[1])))
    rows = -(-R.size // columns)
    cell = rng.permutation(rows * columns)[: R.size]
    place = np.array(np.divmod(cell, rows)) + rng.uniform(size=(2, R.size))
    inner = 0.0 * R if box.periodic else START * R
    return np.asarray(inner + place / [[columns], [rows]] * (box.size[:, None] - 2.0 * inner), dtype=float)


def separate(x: Array, R: Array, box: Box, friction: float, tolerance: float) -> Array | None:
    """Move the discs as little as possible until none overlap; None if that does not converge."""
    for _ in range(ROUNDS):
        contacts = contacts_of(x, R, box)
        if contacts.gap.min(initial=0.0) >= -tolerance * R.min():
            return x
        motion = _motion(contacts, R, friction)
        if motion is None or np.abs(motion).max() > MARGIN:
            return None
        x = x + motion
    return None


@dataclass(frozen=True)
class Contacts:
    """Pairs of discs, then discs at walls, closer than the margin."""

    first: NDArray[np.intp]  # (k,)
    second: NDArray[np.intp]  # (pairs,)
    normal: Array  # (2, k) towards the first
    gap: Array  # (k,)


def contacts_of(x: Array, R: Array, box: Box) -> Contacts:
    """The constraints of discs of radii R (N,) at x (2, N)."""
    a, b, apart = box.pairs(x, 2.0 * R.max() + MARGIN)
    distance = np.maximum(np.hypot(*apart), 1e-12)
    gap = distance - R[a] - R[b]
    near = gap < MARGIN
    wall_gap = box.walls(x, R)
    wall, disc = np.divmod(np.flatnonzero(wall_gap < MARGIN), R.size)
    inward = np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0]])[:, wall]
    return Contacts(
        np.concatenate([a[near], disc]),
        b[near],
        np.hstack([(apart / distance)[:, near], inward]),
        np.concatenate([gap[near], wall_gap[wall_gap < MARGIN]]),
    )


def _motion(contacts: Contacts, R: Array, friction: float) -> Array | None:
    """Least mass-weighted motion (2, N) that opens all gaps, linearised; None if there is none."""
    k, pairs = contacts.gap.size, contacts.second.size
    mu = np.where(np.arange(k) < pairs, friction, 0.0)
    mass, inertia = R**2, 0.5 * R**4
    if friction > 0.0:
        H, q = rows(contacts, R), np.zeros(2 * k)
    else:
        H, q = rows(contacts, R)[::2], np.zeros(k)
    q[:: q.size // k] = contacts.gap - 0.5 * OVERLAP[0] * R.min()
    H_M = H @ sp.diags_array(1.0 / np.concatenate([mass, mass, inertia]))
    r, info = coulomb.solve(H_M @ H.T, q, mu, tol=TOLERANCE, iterations=NEWTON)
    return (H_M.T @ r)[: 2 * R.size].reshape(2, -1) if info.residual < ACCEPTED else None


def rows(contacts: Contacts, R: Array) -> sp.csr_array:
    """Contact Jacobian (2k, 3N): normal and tangential rows in turn; columns x, then y, then angles of all discs."""
    N, pairs = R.size, contacts.second.size
    n = contacts.normal
    t = np.array([-n[1], n[0]])
    a, b = contacts.first, contacts.second
    i = 2 * np.arange(a.size)
    j = i[:pairs]
    entries = [
        (i, a, n[0]),
        (i, N + a, n[1]),
        (i + 1, a, t[0]),
        (i + 1, N + a, t[1]),
        (i + 1, 2 * N + a, -R[a]),
    ]
    entries += [(j, b, -n[0, :pairs]), (j, N + b, -n[1, :pairs])]
    entries += [(j + 1, b, -t[0, :pairs]), (j + 1, N + b, -t[1, :pairs]), (j + 1, 2 * N + b, -R[b])]
    rows, columns, values = (np.concatenate(e) for e in zip(*entries, strict=True))
    return sp.csr_array((values, (rows, columns)), shape=(2 * a.size, 3 * N))
