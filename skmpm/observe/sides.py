"""The boundary of one body: its sides from corner to corner, and where on them contacts act."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from skmpm import outline
from skmpm.outline import Outlines
from skmpm.scene import Contacts

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# A notch or a thin part has two sides near a contact, which acts on the one that faces it: normals at right angles
# count as this distance [cells], that of contact detection and more than the depth of contacts.
MISALIGNED = 0.25
AT_CORNER = 1e-6  # distance from a corner, in segments, within which a contact acts on both of its sides


@dataclass(frozen=True, eq=False)
class Side:
    """A smooth part of an outline from corner to corner, or a loop without corners (`closed`)."""

    point: Ints  # (n,) boundary points in order, both corners included; the first of a closed side is not repeated
    closed: bool
    begin: float  # arc length along the loop where the side begins [m]
    s: Array  # (n,) arc length on the side [m]
    total: float  # its length [m]

    @property
    def segments(self) -> Ints:
        """Segments, named by the boundary points where they begin."""
        return self.point if self.closed else self.point[:-1]

    @property
    def weight(self) -> Array:
        """Half of the segments at each point, (n,) [m]."""
        half = 0.5 * np.diff(np.append(self.s, self.total)) if self.closed else 0.5 * np.diff(self.s)
        return half + np.roll(half, 1) if self.closed else np.append(half, 0.0) + np.append(0.0, half)


def sides(outlines: Outlines, corner: Bools, x: Array, body: int) -> list[Side]:
    """The sides of one body; `corner` (m,) and x (2, m) [m] are those of all boundary points.

    Loops, which are ranges of boundary points, are followed from their first corner or, without corners, their start.
    """
    found = []
    for first in np.flatnonzero((outlines.body == body) & (outlines.previous >= np.arange(outlines.size))):
        loop = np.arange(first, outlines.previous[first] + 1)
        turned = np.roll(loop, -int(np.argmax(corner[loop])))
        length = np.hypot(*(x[:, outlines.next[turned]] - x[:, turned]))
        s, around = np.append(0.0, np.cumsum(length)), np.append(turned, turned[0])
        cuts = np.flatnonzero(np.append(corner[turned], True))
        if cuts.size == 1:
            found.append(Side(loop, True, 0.0, s[:-1], float(s[-1])))
        for i, j in pairwise(cuts):
            path = slice(i, j + 1)
            found.append(Side(around[path], False, float(s[i]), s[path] - s[i], float(s[j] - s[i])))
    return found


@dataclass(frozen=True, eq=False)
class Placed:
    """Where contacts act on the boundary; a contact at a corner acts on both of its sides."""

    contact: Ints  # (k,) index of the contact
    segment: Ints  # (k,) boundary point where the segment begins
    t: Array  # (k,) position on the segment, 0 to 1
    share: Array  # (k,) of the force of the contact
    sign: Array  # (k,) 1 where the body is the first of the pair, else -1


def place(contacts: Contacts, outlines: Outlines, corner: Bools, x: Array, body: int, cell: float) -> Placed:
    """Place the contacts of a body where they are closest to the polygon of its boundary points x (2, m) [m].

    At a corner the force is divided between the two sides by the angles between their normals and that of the
    contact: all of it acts on the side whose normal is that of the contact.
    """
    k, second = np.nonzero(np.equal(contacts.bodies.T, body))  # a contact of a body with itself acts on it twice
    sign, own = np.where(second == 0, 1.0, -1.0), np.flatnonzero(outlines.body == body)
    outward = -sign * contacts.normal[:, k]
    step = x[:, outlines.next] - x
    normal = np.stack([step[1], -step[0]]) / np.maximum(np.hypot(*step), np.finfo(np.float64).tiny)
    start = np.tile(x[:, own], k.size)
    x_contact = np.where(second == 0, contacts.at(0)[:, k], contacts.at(1)[:, k])
    every = outline.closest(np.repeat(x_contact, own.size, axis=1), start, start + np.tile(step[:, own], k.size))
    t, distance = (a.reshape(k.size, own.size) for a in every)
    best = (distance + MISALIGNED * cell * (1.0 - outward.T @ normal[:, own])).argmin(axis=1)
    t, segment = t[np.arange(k.size), best], own[best]
    back = corner[segment] & (t < AT_CORNER)
    ahead = ~back & corner[outlines.next[segment]] & (t > 1.0 - AT_CORNER)
    last = np.where(back, outlines.previous[segment], segment)
    first = np.where(ahead, outlines.next[segment], segment)
    turn, angle = _angle(normal[:, last], normal[:, first]), _angle(normal[:, last], outward)
    both = np.flatnonzero(back | ahead)
    share = np.clip(angle[both] / turn[both], 0.0, 1.0)
    one = np.flatnonzero(~(back | ahead))
    order = np.concatenate([one, both, both])
    return Placed(
        contact=k[order],
        segment=np.concatenate([segment[one], last[both], first[both]]),
        t=np.concatenate([t[one], np.ones(both.size), np.zeros(both.size)]),
        share=np.concatenate([np.ones(one.size), 1.0 - share, share]),
        sign=sign[order],
    )


def _angle(a: Array, b: Array) -> Array:
    """Angles from a to b, both (2, k), in [-pi, pi] [rad]."""
    return np.asarray(np.arctan2(a[0] * b[1] - a[1] * b[0], (a * b).sum(axis=0)))
