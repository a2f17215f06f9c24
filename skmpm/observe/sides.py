"""The boundary of one body: its sides from corner to corner, where on them contacts act, and on what length."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from skmpm import outline
from skmpm.arrays import Array, Bools, Ints
from skmpm.observe.contact_network import CLOSED, forced, pairs_of
from skmpm.outline import Outlines
from skmpm.outline.measures import half_segments
from skmpm.scene import Contacts, Scene, State

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
    x: Array  # (2, n) [m]

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
            found.append(Side(loop, True, 0.0, s[:-1], float(s[-1]), x[:, loop]))
        for i, j in pairwise(cuts):
            path, total = slice(i, j + 1), float(s[j] - s[i])
            found.append(Side(around[path], False, float(s[i]), s[path] - s[i], total, x[:, around[path]]))
    return found


@dataclass(frozen=True, eq=False)
class Placed:
    """Where contacts act on the boundary; a contact at a corner acts on both of its sides."""

    contact: Ints  # (k,) index of the contact
    segment: Ints  # (k,) boundary point where the segment begins
    t: Array  # (k,) position on the segment, 0 to 1
    share: Array  # (k,) of the force of the contact
    sign: Array  # (k,) 1 where the body is the first of the pair, else -1
    width: Array  # (k,) of boundary that belongs to the boundary point of the contact [m]

    def with_middles(self, segments: Ints, lengths: Array) -> Placed:
        """The places with the middles of segments (s,) of lengths (s,) [m], which are of no contact."""
        one = np.ones(segments.size)
        added = (np.full(segments.size, -1), segments, 0.5 * one, one, one, lengths)
        both = zip((self.contact, self.segment, self.t, self.share, self.sign, self.width), added, strict=True)
        return Placed(*(np.append(old, new) for old, new in both))


def place(contacts: Contacts, outlines: Outlines, corner: Bools, x: Array, body: int, cell: float) -> Placed:
    """Place the contacts of a body where they are closest to the polygon of its boundary points x (2, m) [m].

    At a corner the force is divided between the two sides by the angles between their normals and that of the
    contact: all of it acts on the side whose normal is that of the contact.
    """
    k, second = np.nonzero(np.equal(contacts.bodies.T, body))  # a contact of a body with itself acts on it twice
    sign, own = np.where(second == 0, 1.0, -1.0), np.flatnonzero(outlines.body == body)
    outward = -sign * contacts.normal[:, k]
    step = x[:, outlines.next] - x
    length = np.hypot(*step)
    normal = np.stack([step[1], -step[0]]) / np.maximum(length, np.finfo(np.float64).tiny)
    width = np.zeros(int(outlines.point.max(initial=-1)) + 1)
    width[outlines.point] = 0.5 * (length + length[outlines.previous])
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
        width=width[contacts.point[k[order]]],
    )


def _angle(a: Array, b: Array) -> Array:
    """Angles from a to b, both (2, k), in [-pi, pi] [rad]."""
    return np.asarray(np.arctan2(a[0] * b[1] - a[1] * b[0], (a * b).sum(axis=0)))


def contact_lengths(scene: Scene, state: State) -> Array:
    """Measure the boundary in contact of each contact, (k,) [m]; nan at grid nodes.

    A boundary point of the first body of a pair is in contact if its gap is below 0.02 cells or if it lies between
    two forced contacts of the pair, on a stretch of boundary that stays within the reach of contact detection. Its
    length is half of its two segments, without one that turns away by more than 30 degrees (a corner).
    A segment in contact with several bodies is shared.
    """
    contacts, outlines = state.contacts, scene.outlines
    at_node = contacts.point < 0
    result = np.where(at_node, np.nan, 0.0)
    contact = np.flatnonzero(~at_node)
    index = np.zeros(int(outlines.point.max(initial=-1)) + 1, dtype=np.int64)
    index[outlines.point] = np.arange(outlines.size)
    share = _share(contacts.among(contact), state.box)
    contact, share = contact[share > 0.0], share[share > 0.0]
    c, second = index[contacts.point[contact]], contacts.bodies[1, contact]
    enclosed = _between(c, second - second.min(initial=0), forced(contacts)[contact], outlines)
    closed = np.flatnonzero((contacts.gap[contact] < CLOSED * scene.cell) | enclosed)
    contact, c, share = contact[closed], c[closed], share[closed]
    x = state.x[:, outlines.point]
    result[contact] = share * half_segments(outlines, x, c, contacts.normal[:, contact]).sum(axis=0)
    return result


def _share(contacts: Contacts, box: Array | None) -> Array:
    """1 for contacts at points of the body that gives most points of its pair, 0 for those of the other, (k,).

    A body and its image are a pair, too, and its contacts with the opposite image are those of the other. All those
    of a body with itself in one place are 1.
    """
    itself = contacts.bodies[0] == contacts.bodies[1]
    pairs = pairs_of(replace(contacts, image=np.where(itself, contacts.image, 0.0)), box)
    side = np.where(pairs.same, 1.0, -1.0)
    return np.asarray(0.5 + 0.5 * side * np.sign(np.bincount(pairs.of, side)[pairs.of]))


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
