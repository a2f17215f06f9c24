"""The contact network: pairs of bodies in contact, coordination, and the stress of the contact forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm.arrays import ROUND_OFF, Array, Bools, Ints
from skmpm.outline.images import first_half
from skmpm.scene import Contacts

CLOSED = 0.02  # largest gap that counts as contact [cells]


def forced(contacts: Contacts) -> Bools:
    """Whether contacts carry a force, (k,)."""
    size = np.hypot(*contacts.force)
    result: Bools = size > ROUND_OFF * size.max(initial=0.0)
    return result


def touching(contacts: Contacts, cell: float) -> Bools:
    """Whether bodies touch at the contacts, (k,): those with a force or, if there are none, with a closed gap.

    No contact carries a force before the first step. Contacts at shared grid nodes have no gap and do not count then.
    """
    contact = forced(contacts)
    return contact if contact.any() else (contacts.gap < CLOSED * cell) & (contacts.point >= 0)


def between(contacts: Contacts) -> Bools:
    """Whether contacts are not those of a body with itself, (k,); one with an image of itself counts."""
    return np.asarray((contacts.bodies[0] != contacts.bodies[1]) | contacts.image.any(axis=0))


@dataclass(frozen=True, eq=False)
class Pairs:
    """Distinct pairs of bodies, or of body and wall, that contacts belong to.

    The first body is the one with the smaller index, walls (-1, -2, ...) are second. In a periodic box a pair is a
    body and one image of another, or of itself.
    """

    bodies: Ints  # (2, pairs) sorted
    lattice: Ints  # (edges, pairs) k of the lattice vector H k to the image of the second body; zero without a box
    of: Ints  # (contacts,) the pair of each contact
    same: Bools  # (contacts,) whether the first body of a contact is that of its pair


def pairs_of(contacts: Contacts, box: Array | None) -> Pairs:
    """The pairs of all contacts, with the edges (2, 1) or (2, 2) of the periodic box [m]."""
    bodies, lattice = contacts.bodies, np.zeros_like(contacts.bodies)
    if box is not None:
        lattice = np.rint(np.linalg.pinv(box) @ contacts.image).astype(np.int64)
    most = int(bodies.max(initial=0))
    number = np.where(bodies < 0, most - bodies, bodies)  # walls follow the bodies
    same = np.where(number[0] == number[1], ~first_half(-lattice), number[0] < number[1])
    names = np.concatenate([np.where(same, number, number[::-1]), np.where(same, lattice, -lattice)])
    names, of = np.unique(names, axis=1, return_inverse=True)
    return Pairs(np.where(names[:2] > most, most - names[:2], names[:2]), names[2:], of.ravel(), same)


def touching_pairs(contacts: Contacts, cell: float, box: Array | None) -> Ints:
    """Pairs of bodies that touch, (2, pairs), as `pairs_of` orders them; a body is no neighbour of itself."""
    return pairs_of(contacts.among(touching(contacts, cell) & between(contacts)), box).bodies


def sums(pairs: Ints, values: Array | float, bodies: int) -> Array:
    """Sum values (k,) of pairs (2, k) over each body, (bodies,); they count for both bodies, not for walls."""
    own = pairs >= 0
    return np.bincount(pairs[own], np.broadcast_to(values, pairs.shape)[own], bodies).astype(np.float64)


def without_rattlers(pairs: Ints, friction: Array, movable: Bools) -> Array:
    """Coordination among the bodies that are no rattlers and the walls, (bodies,); nan for rattlers.

    Rattlers are the bodies that their contacts cannot hold: fewer than three neighbours, or two with friction. They
    are removed together with their contacts until none is left, because a neighbour may have lost one by it.

    Parameters
    ----------
    pairs : (2, k) bodies in contact, walls negative
    friction : (k,) Coulomb coefficient
    movable : (bodies,) bodies whose motion is not prescribed
    """
    loose = np.zeros(movable.size, dtype=bool)
    while True:
        held = ~np.any((pairs >= 0) & loose[np.maximum(pairs, 0)], axis=0)
        rough = sums(pairs[:, held & (friction > 0.0)], 1.0, movable.size) > 0.0
        coordination = sums(pairs[:, held], 1.0, movable.size)
        found = movable & (coordination < np.where(rough, 2, 3))
        if np.array_equal(found, loose):
            return np.where(loose, np.nan, coordination)
        loose = found


@dataclass(frozen=True, eq=False)
class HalfBranches:
    """Each contact from the side of each of its bodies that forces move."""

    body: Ints  # (k,)
    force: Array  # (2, k) on the body [N/m]
    centre: Array  # (2, k) of the body [m]
    x: Array  # (2, k) the contact point [m]


def half_branches(contacts: Contacts, centre: Array, movable: Bools) -> HalfBranches:
    """Split the branches between the centres (2, bodies) [m] at the contact points.

    Bodies whose motion is prescribed have no branch of their own, like walls.
    """
    f = contacts.vectors
    body = contacts.bodies.ravel()
    own = np.flatnonzero((body >= 0) & movable[np.maximum(body, 0)])
    x, force = np.concatenate([contacts.at(0), contacts.at(1)], axis=1), np.concatenate([f, -f], axis=1)
    return HalfBranches(body[own], force[:, own], centre[:, body[own]], x[:, own])


def moments(branches: HalfBranches, weight: Array | float, torque_free: Bools) -> Array:
    """Sum force (x) arm of each body, arm from the centre to the contact: (2, 2, bodies) [N].

    Divided by a volume it is a stress, tension positive. The sum over the bodies is Love's and Weber's,
    -sum f (x) branch (Christoffersen, Mehrabadi & Nemat-Nasser, J. Appl. Mech. 48, 1981). It is symmetric for bodies
    `torque_free` (bodies,): a moment of their contacts is an error of the discretisation (`step.gauge`).
    """
    arm, n = weight * (branches.x - branches.centre), torque_free.size
    M = np.array([[np.bincount(branches.body, f * a, n) for a in arm] for f in branches.force])
    return np.where(torque_free, 0.5 * (M + M.swapaxes(0, 1)), M)
