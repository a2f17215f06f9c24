"""The contact network: who touches whom, over what length, and the stress that the forces make."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.outline import Outlines
from skmpm.scene import Contacts

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

CLOSED = 0.02  # gaps below this many cells are contact
FORCED = 1e-9  # forces below this share of the largest are none
SHARP = 0.5  # sine of the angle by which a boundary may turn away from a contact and still belong to it


def forced(contacts: Contacts) -> Bools:
    """Say which contacts carry a force, (k,)."""
    size = np.hypot(*contacts.force)
    result: Bools = size > FORCED * size.max(initial=0.0)
    return result


def coordination(contacts: Contacts, bodies: int, cell: float) -> Array:
    """Count the distinct bodies and walls that touch each body, (bodies,).

    Touching means a force. If no contact at all carries one, as before the first step, it means a gap below
    0.02 cells; at shared grid nodes, which know no gap, nothing touches then.
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
    """Each contact seen from each of its deformable bodies."""

    body: Ints  # (k,)
    force: Array  # (2, k) on the body [N/m]
    centre: Array  # (2, k) of the body [m]
    x: Array  # (2, k) the contact point [m]


def half_branches(contacts: Contacts, centre: Array, deformable: Bools) -> HalfBranches:
    """Split the branches between the centres (2, bodies) [m] at the contact points.

    Walls and rigid bodies move as prescribed: like walls, rigid bodies have no branch of their own.
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
    two forced contacts of the pair, on a stretch of boundary that stays within the reach of the contact law. It
    stands for the halves of its two segments, except for one that turns away by more than 30 degrees (a
    corner). What two pairs claim is shared. The length counts for both bodies, that with a wall for one.

    Parameters
    ----------
    x : (2, m) positions of the boundary points [m]
    """
    at_node = contacts.point < 0
    touched = contacts.bodies[:, at_node]
    contact = np.flatnonzero(~at_node)
    place = np.zeros(int(outlines.point.max(initial=-1)) + 1, dtype=np.int64)
    place[outlines.point] = np.arange(outlines.size)
    share = _share(*contacts.bodies[:, contact])
    contact, share = contact[share > 0.0], share[share > 0.0]
    c, (first, second) = place[contacts.point[contact]], contacts.bodies[:, contact]
    held = _between(c, second - second.min(initial=0), forced(contacts)[contact], outlines)
    closed = np.flatnonzero((contacts.gap[contact] < CLOSED * cell) | held)
    c, first, second, share = c[closed], first[closed], second[closed], share[closed]
    length = np.zeros(c.size)
    for neighbour in (outlines.next, outlines.previous):
        length += _halves(c, contacts.normal[:, contact[closed]], x[:, neighbour[c]] - x[:, c], outlines.size)
    length, both = share * length, second >= 0
    ends, twice = np.append(first, second[both]), np.append(length, length[both])
    total = np.bincount(ends, twice, bodies).astype(np.float64)  # integer if there are none
    total[touched[touched >= 0]] = np.nan
    return total


def _share(first: Ints, second: Ints) -> Array:
    """1 where contacts are points of the body that gives most of its pair's points, of the other, its corners, 0."""
    width = int(max(first.max(initial=0), second.max(initial=0))) + 1
    wall = second < 0
    pair, reverse = (np.where(wall, -1, a * width + b) for a, b in ((first, second), (second, first)))
    there, count = np.unique(pair, return_counts=True)
    place = np.minimum(np.searchsorted(there, reverse), max(there.size - 1, 0))
    own = count[np.searchsorted(there, pair)]
    other = np.where(there[place] == reverse, count[place], 0)
    return np.where(wall, 1.0, 0.5 + 0.5 * np.sign(own - other))


def _halves(c: Ints, normal: Array, edge: Array, m: int) -> Array:
    """Half the length of the edge at each boundary point c, unless it turns away; shared among its contacts."""
    length = np.hypot(*edge)
    counts = np.einsum("ik,ik->k", normal, edge) <= SHARP * length
    several = np.maximum(np.bincount(c[counts], minlength=m), 1)
    return np.where(counts, length / 2.0, 0.0) / several[c]


def _between(c: Ints, other: Ints, forced: Bools, outlines: Outlines) -> Bools:
    """Which contacts of boundary points c with `other` lie between loaded ones along an unbroken boundary."""
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
        for _ in range(k.bit_length()):  # each turn looks twice as far along the boundary
            reached |= reached[jump]
            jump = jump[jump]
        found.append(reached[:k])
    result: Bools = found[0] & found[1]
    return result
