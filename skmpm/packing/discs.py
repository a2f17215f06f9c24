"""Non-overlapping motion of rigid discs, for `packing`: in a box with walls, or in a periodic one.

`Contacts` and `least_motion` are those of other shapes, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from skmpm import coulomb
from skmpm.arrays import Array, Bools, Ints

START = 0.3  # initial over final size of the discs
MARGIN = 0.5  # pairs with a smaller gap are constraints, and no body moves farther at once [mean radius]
OVERLAP = 1e-6, 1e-3  # allowed at the end and during growth [smallest radius]
TOLERANCE = 1e-9  # of the contact solver
ACCEPTED = 1e-5  # if the solver stalls; the next linearisation corrects the error
NEWTON = 20
ROUNDS = 12  # linearisations per step


@dataclass(frozen=True)
class Box:
    """The box, in mean radii."""

    size: Array  # (2,)
    periodic: Bools  # (2,) along x and y

    def pairs(self, x: Array, distance: float) -> tuple[Ints, Ints, Array]:
        """Pairs of centres x (2, N) closer than a distance, and the vectors (2, pairs) from second to first."""
        period = np.where(self.periodic, self.size, 0.0)  # zero for none, as cKDTree has it
        within = np.minimum(np.mod(x.T, self.size), np.nextafter(self.size, 0.0))  # mod may return the size itself
        at = np.where(self.periodic, within, x.T)
        a, b = cKDTree(at, boxsize=period).query_pairs(distance, output_type="ndarray").T
        apart = x[:, a] - x[:, b]
        return a, b, apart - period[:, None] * np.rint(apart / self.size[:, None])

    def walls(self, x: Array, R: Array) -> Array:
        """Gaps between discs and the left, bottom, right and top wall, of which there may be less, (walls N,)."""
        return np.concatenate([x - R, self.size[:, None] - x - R])[np.tile(~self.periodic, 2)].ravel()


def scatter(R: Array, box: Box, rng: np.random.Generator) -> Array:
    """Draw a centre in each of N cells of a grid: random, but without the voids of independent centres."""
    columns = int(np.ceil(np.sqrt(R.size * box.size[0] / box.size[1])))
    rows = -(-R.size // columns)
    cell = rng.permutation(rows * columns)[: R.size]
    place = np.array(np.divmod(cell, rows)) + rng.uniform(size=(2, R.size))
    inner = np.where(box.periodic[:, None], 0.0, START * R)
    return np.asarray(inner + place / [[columns], [rows]] * (box.size[:, None] - 2.0 * inner), dtype=float)


def separate(x: Array, R: Array, box: Box, friction: float, tolerance: float) -> Array | None:
    """Move the discs as little as possible until none overlap; None if that does not converge."""
    for _ in range(ROUNDS):
        contacts = contacts_of(x, R, box)
        if contacts.gap.min(initial=0.0) >= -tolerance * R.min():
            return x
        motion = least_motion(contacts, R**2, 0.5 * R**4, friction, 0.5 * OVERLAP[0] * float(R.min()))
        if motion is None or np.abs(motion[:2]).max() > MARGIN:
            return None
        x = x + motion[:2]
    return None


@dataclass(frozen=True)
class Contacts:
    """Constraints of pairs of bodies, then of bodies at walls, closer than the margin."""

    first: Ints  # (k,)
    second: Ints  # (pairs,)
    normal: Array  # (2, k) towards the first
    arm: Array  # (2, k) from the centre of the first to the contact
    arm_of_second: Array  # (2, pairs)
    gap: Array  # (k,)


def contacts_of(x: Array, R: Array, box: Box) -> Contacts:
    """The constraints of discs of radii R (N,) at x (2, N)."""
    a, b, apart = box.pairs(x, 2.0 * R.max() + MARGIN)
    distance = np.maximum(np.hypot(*apart), 1e-12)
    gap = distance - R[a] - R[b]
    near = gap < MARGIN
    wall_gap = box.walls(x, R)
    wall, disc = np.divmod(np.flatnonzero(wall_gap < MARGIN), R.size)
    inward = np.concatenate([np.eye(2), -np.eye(2)], axis=1)[:, np.tile(~box.periodic, 2)][:, wall]
    between, first = (apart / distance)[:, near], np.concatenate([a[near], disc])
    normal = np.hstack([between, inward])
    gaps = np.concatenate([gap[near], wall_gap[wall_gap < MARGIN]])
    return Contacts(first, b[near], normal, -R[first] * normal, R[b[near]] * between, gaps)


def least_motion(contacts: Contacts, mass: Array, inertia: Array, friction: float, slack: float) -> Array | None:
    """Least mass-weighted motion (3, N) that opens all gaps by a slack more, linearised; None if there is none."""
    k, pairs, n = contacts.gap.size, contacts.second.size, contacts.normal
    H, q = rows(contacts, n, mass.size), contacts.gap - slack
    if friction > 0.0:
        both = sp.vstack([H, rows(contacts, np.array([-n[1], n[0]]), mass.size)], format="csr")
        H, q = (
            sp.csr_array(both[np.arange(2 * k).reshape(2, k).T.ravel()]),
            np.stack([q, np.zeros(k)], axis=1).ravel(),
        )
    mu = np.where(np.arange(k) < pairs, friction, 0.0)
    H_M = H @ sp.diags_array(1.0 / np.concatenate([mass, mass, inertia]))
    r, info = coulomb.solve(H_M @ H.T, q, mu, tol=TOLERANCE, iterations=NEWTON)
    return (H_M.T @ r).reshape(3, -1) if info.residual < ACCEPTED else None


def rows(contacts: Contacts, d: Array, N: int) -> sp.csr_array:
    """Velocities of the first along d (2, k) less those of the second; columns x, then y, then angles, (k, 3 N)."""
    a, b, r, s = contacts.first, contacts.second, contacts.arm, contacts.arm_of_second
    i = np.arange(a.size)
    entries = [(i, a, d[0]), (i, N + a, d[1]), (i, 2 * N + a, r[0] * d[1] - r[1] * d[0])]
    j, e = i[: b.size], -d[:, : b.size]
    entries += [(j, b, e[0]), (j, N + b, e[1]), (j, 2 * N + b, s[0] * e[1] - s[1] * e[0])]
    rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    return sp.csr_array((values, (rows, columns)), shape=(a.size, 3 * N))
