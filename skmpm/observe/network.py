"""The contact network: coordination, contact length, and the stress of the contact forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.outline import Outlines
from skmpm.scene import Contacts

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

CLOSED = 0.02  # largest gap that counts as contact [cells]
FORCED = 1e-9  # share of the largest force below which a force counts as zero
SHARP = 0.5  # sine of the largest angle between boundary and contact plane within a contact


def forced(contacts: Contacts) -> Bools:
    """Whether contacts carry a force, (k,)."""
    size = np.hypot(*contacts.force)
    result: Bools = size > FORCED * size.max(initial=0.0)
    return result


def coordination(contacts: Contacts, bodies: int, cell: float) -> Array:
    """Count the distinct bodies and walls that touch each body, (bodies,).

    Bodies touch if a contact carries a force. If no contact does, as before the first step, they touch if a gap is
    below 0.02 cells; contacts at shared grid nodes have no gap and do not count then.
    """
    contact = forced(contacts)
    if not contact.any():
        contact = (contacts.gap < CLOSED * cell) & (contacts.point >= 0)
    # Walls are negative: shifted, a pair is one number.
    walls = -int(contacts.bodies.min(initial=0))
    width = bodies + walls
    first, second = contacts.bodies[:, contact]
    low, high = np.minimum(first, second) + walls, np.maximum(first, second) + walls
    pair = np.unique(low * width + high)
    ends = np.concatenate([pair // width, pair % width]) - walls
    return np.bincount(ends[ends >= 0], minlength=bodies).astype(np.float64)


@dataclass(frozen=True, eq=False)
class HalfBranches:
    """Each contact from the side of each of its deformable bodies."""

    body: Ints  # (k,)
    force: Array  # (2, k) on the body [N/m]
    centre: Array  # (2, k) of the body [m]
    x: Array  # (2, k) the contact point [m]


def half_branches(contacts: Contacts, centre: Array, deformable: Bools) -> HalfBranches:
    """Split the branches between the centres (2, bodies) [m] at the contact points.

    Rigid bodies have no branch of their own, like walls, because their motion is prescribed.
    """
    n = contacts.normal
    f = contacts.force[0] * n + contacts.force[1] * np.stack([-n[1], n[0]])
    body = contacts.bodies.ravel()
    own = np.flatnonzero((body >= 0) & deformable[np.maximum(body, 0)])
    x, force = np.tile(contacts.x, 2), np.concatenate([f, -f], axis=1)
    return HalfBranches(body[own], force[:, own], centre[:, body[own]], x[:, own])


def moments(branches: HalfBranches, weight: Array | float, bodies: int) -> Array:
    """Sum force (x) arm of each body, arm from the centre to the contact: (2, 2, bodies) [N].

    Divided by a volume it is a stress, tension positive. The sum over the bodies is Love's and Weber's,
    -sum f (x) branch (Christoffersen, Mehrabadi & Nemat-Nasser, J. Appl. Mech. 48, 1981).
    """
    arm = weight * (branches.x - branches.centre)
    M = np.empty((2, 2, bodies))
    for i, j in np.ndindex(2, 2):
        M[i, j] = np.bincount(branches.body, branches.force[i] * arm[j], bodies)
    return M


def contact_length(contacts: Contacts, outlines: Outlines, x: Array, bodies: int, cell: float) -> Array:
    """Measure the boundary in contact of each body, (bodies,) [m]; nan for bodies that touch at grid nodes.

    A boundary point of the first body of a pair is in contact if its gap is below 0.02 cells or if it lies between
    two forced contacts of the pair, on a stretch of boundary that stays within the reach of contact detection. Its
    length is half of its two segments, without one that turns away by more than 30 degrees (a corner).
    A segment in contact with several bodies is shared. The length counts for both bodies, at a wall for one.

    Parameters
    ----------
    x : (2, m) positions of the boundary points [m]
    """
    at_node = contacts.point < 0
    touched = contacts.bodies[:, at_node]
    contact = np.flatnonzero(~at_node)
    index = np.zeros(int(outlines.point.max(initial=-1)) + 1, dtype=np.int64)
    index[outlines.point] = np.arange(outlines.size)
    share = _share(*contacts.bodies[:, contact])
    contact, share = contact[share > 0.0], share[share > 0.0]
    c, (first, second) = index[contacts.point[contact]], contacts.bodies[:, contact]
    enclosed = _between(c, second - second.min(initial=0), forced(contacts)[contact], outlines)
    closed = np.flatnonzero((contacts.gap[contact] < CLOSED * cell) | enclosed)
    c, first, second, share = c[closed], first[closed], second[closed], share[closed]
    length = np.zeros(c.size)
    for neighbour in (outlines.next, outlines.previous):
        length += _halves(c, contacts.normal[:, contact[closed]], x[:, neighbour[c]] - x[:, c], outlines.size)
    length, both = share * length, second >= 0
    ends, twice = np.append(first, second[both]), np.append(length, length[both])
    total = np.bincount(ends, twice, bodies).astype(np.float64)  # bincount of nothing is integer
    total[touched[touched >= 0]] = np.nan
    return total


def _share(first: Ints, second: Ints) -> Array:
    """1 for contacts at points of the body that gives most points of its pair, 0 for those of the other, (k,)."""
    width = int(max(first.max(initial=0), second.max(initial=0))) + 1
    wall = second < 0
    pair, reverse = (np.where(wall, -1, a * width + b) for a, b in ((first, second), (second, first)))
    there, count = np.unique(pair, return_counts=True)
    at = np.minimum(np.searchsorted(there, reverse), max(there.size - 1, 0))
    own = count[np.searchsorted(there, pair)]
    other = np.where(there[at] == reverse, count[at], 0)
    return np.where(wall, 1.0, 0.5 + 0.5 * np.sign(own - other))


def _halves(c: Ints, normal: Array, edge: Array, m: int) -> Array:
    """Half the edge length at each boundary point c, zero if it turns away; shared among contacts, (k,) [m]."""
    length = np.hypot(*edge)
    counts = np.einsum("ik,ik->k", normal, edge) <= SHARP * length
    several = np.maximum(np.bincount(c[counts], minlength=m), 1)
    return np.where(counts, length / 2.0, 0.0) / several[c]


def _between(c: Ints, other: Ints, forced: Bools, outlines: Outlines) -> Bools:
    """Whether contacts of boundary points c with `other` lie between forced ones on a stretch of contacts, (k,)."""
    k = c.size
    width = int(other.max(initial=0)) + 1
    key = c * width + other
    order = np.argsort(key)
    found = []
    for neighbour in (outlines.next, outlines.previous):
        wanted = neighbour[c] * width + other
        at = np.minimum(np.searchsorted(key[order], wanted), max(k - 1, 0))
        jump = np.append(np.where(key[order[at]] == wanted, order[at], k), k)
        reached = np.append(forced, False)
        for _ in range(k.bit_length()):  # each pass reaches twice as far along the boundary
            reached |= reached[jump]
            jump = jump[jump]
        found.append(reached[:k])
    result: Bools = found[0] & found[1]
    return result
