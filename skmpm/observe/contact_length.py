"""The length of boundary in contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.observe.contact_network import CLOSED, forced
from skmpm.outline import Outlines, half_segments
from skmpm.scene import Contacts

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def contact_length(contacts: Contacts, lengths: Array, bodies: int) -> Array:
    """Sum the lengths (k,) [m] of contacts for each body, (bodies,) [m]; they count for both bodies of a pair.

    Those of a body with itself count for both of its parts.
    """
    own = contacts.bodies.ravel() >= 0
    total = np.bincount(contacts.bodies.ravel()[own], np.tile(lengths, 2)[own], bodies)
    return total.astype(np.float64)  # bincount of nothing is integer


def contact_lengths(contacts: Contacts, outlines: Outlines, x: Array, cell: float) -> Array:
    """Measure the boundary in contact of each contact, (k,) [m]; nan at grid nodes.

    A boundary point of the first body of a pair is in contact if its gap is below 0.02 cells or if it lies between
    two forced contacts of the pair, on a stretch of boundary that stays within the reach of contact detection. Its
    length is half of its two segments, without one that turns away by more than 30 degrees (a corner).
    A segment in contact with several bodies is shared.

    Parameters
    ----------
    x : (2, m) positions of the boundary points [m]
    """
    at_node = contacts.point < 0
    result = np.where(at_node, np.nan, 0.0)
    contact = np.flatnonzero(~at_node)
    index = np.zeros(int(outlines.point.max(initial=-1)) + 1, dtype=np.int64)
    index[outlines.point] = np.arange(outlines.size)
    first, second = contacts.bodies[:, contact]
    share = _share(first, second, np.round(contacts.image[:, contact] / cell, 6))
    contact, share = contact[share > 0.0], share[share > 0.0]
    c, second = index[contacts.point[contact]], contacts.bodies[1, contact]
    enclosed = _between(c, second - second.min(initial=0), forced(contacts)[contact], outlines)
    closed = np.flatnonzero((contacts.gap[contact] < CLOSED * cell) | enclosed)
    contact, c, share = contact[closed], c[closed], share[closed]
    result[contact] = share * half_segments(outlines, x, c, contacts.normal[:, contact]).sum(axis=0)
    return result


def _share(first: Ints, second: Ints, image: Array) -> Array:
    """1 for contacts at points of the body that gives most points of its pair, 0 for those of the other, (k,).

    A body and its image at a displacement, (2, k) [cells], are a pair, too, and its contacts with the opposite image
    are those of the other. All those of a body with itself in one place are 1.
    """
    width = int(max(first.max(initial=0), second.max(initial=0))) + 1
    wall, itself = second < 0, first == second
    pair, reverse = (np.where(wall, -1, a * width + b) for a, b in ((first, second), (second, first)))
    if (itself & image.any(axis=0)).any():
        lattice = np.where(itself, image, 0.0)
        vectors, there = np.unique(np.concatenate([lattice, -lattice], axis=1), axis=1, return_inverse=True)
        ahead, back = np.split(there.ravel(), 2)
        pair, reverse = (np.where(wall, -1, a * vectors.shape[1] + b) for a, b in ((pair, ahead), (reverse, back)))
    there, count = np.unique(pair, return_counts=True)
    at = np.minimum(np.searchsorted(there, reverse), max(there.size - 1, 0))
    own = count[np.searchsorted(there, pair)]
    other = np.where(there[at] == reverse, count[at], 0)
    return np.where(wall | (pair == reverse), 1.0, 0.5 + 0.5 * np.sign(own - other))


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
