"""Cohesion: the tension that contacts bear whose gaps at the start of a step are in range.

Contact Dynamics shifts the cone of Coulomb's law by the tensile strength c l of a contact, so that r + c l dt n obeys
the law without cohesion (Jean, Comput. Methods Appl. Mech. Eng. 177 (1999) 235-257; Radjai, Preechawuttipong &
Peyroux, in: Continuous and Discontinuous Modelling of Cohesive-Frictional Materials, Springer, 2001). With a range
delta > 0 an open gap is pulled by c as long as it is below delta: the cohesive zone of Dugdale and Maugis.

The boundary in contact is divided among the contact points by the trapezoidal rule: a boundary point has half of each
of its two segments. Where a corner of the other body ends the contact within a segment, the covered part of the
segment is divided between the corner and the covered end, so that the lengths add up to that of the contact.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.contact.constraints import lookup
from skmpm.contact.gap_function import ContactPairs
from skmpm.outline import Outlines
from skmpm.outline.images import Images
from skmpm.outline.measures import TURNED_AWAY, half_segments
from skmpm.scene import TOUCHING, Scene


def tensile_strength(scene: Scene, surfaces: Images, x: Array, found: ContactPairs, rank: Ints) -> Array:
    """Largest tension c l of contact pairs in a step, (k,) [N/m]; zero where the gap is out of range.

    The pairs are those of the boundary points x (2, m) [m] at the start of the step, so that no iterate changes the
    strength. Without a range the closed ones bear tension: gaps up to `TOUCHING`, as of bodies that may touch at the
    start. Contacts that bear less than their strength end steps with gaps below 1e-5 cells (test_cohesion). c [Pa] is
    the cohesion of the two bodies or of the wall, and l the length of boundary that belongs to the contact point: of
    the boundary of the body of lower `rank` (bodies,), which gives the points.
    """
    c, range_ = scene.cohesion_between(surfaces.bodies_of(found.bodies)), scene.cohesion_range
    acts = (c > 0.0) & (found.gap <= max(range_, TOUCHING * scene.cell))
    return np.where(acts, c * contact_length(surfaces.outlines, x, found, rank, acts, range_), 0.0)


def contact_length(
    outlines: Outlines, x: Array, found: ContactPairs, rank: Ints, acts: Bools, range_: float
) -> Array:
    """Length of boundary that belongs to each contact, (k,) [m]; contacts that act at a point share its length.

    Of two parts of one body that which comes first along the outline gives the points (`neighbours`).
    """
    first, second = found.bodies
    order = np.where(first == second, found.stencil[1] - found.point, rank[np.maximum(second, 0)] - rank[first])
    order[second < 0] = 1
    length = np.zeros((2, first.size))
    giving = np.flatnonzero((order > 0) & acts)
    lowest = int(second.min(initial=0))

    def identity(point: Ints, other: Ints) -> Ints:
        return np.asarray(point * (rank.size - lowest) + other - lowest)

    length[:, giving] = half_segments(outlines, x, found.point[giving], found.normal[:, giving])
    if range_ > 0.0:
        length[:, giving] *= _in_range(outlines, x, found, giving, range_, identity)
    corners = np.flatnonzero(order < 0)
    if corners.size:
        at, ends = identity(found.point, second)[giving], found.stencil[1:3, corners]
        kept, length[0, corners] = _ends(outlines, x, found, corners)
        for side in (0, 1):  # the segment lies ahead of its first end and behind its second
            length[side, giving] *= lookup(identity(ends[side], first[corners]), kept[side], at, 1.0)
    return np.asarray(length.sum(axis=0))


def _in_range(
    outlines: Outlines, x: Array, found: ContactPairs, giving: Ints, range_: float, identity: Callable[..., Ints]
) -> Array:
    """Factors (2, k) on the half segments after and before boundary points, for segments that are partly in range.

    The gap is linear along a segment. Of a segment whose other end is out of range, the part in range belongs to the
    point. The gap at an end beyond detection is estimated from the curvature of the other surface at the point.
    """
    c, second, gap = found.point[giving], found.bodies[1, giving], found.gap[giving]
    known = identity(found.point, found.bodies[1])
    factors = []
    for neighbour in (outlines.next, outlines.previous):
        edge = x[:, neighbour[c]] - x[:, c]
        away = np.einsum("ik,ik->k", found.normal[:, giving], edge)
        beside = gap + away - 0.5 * found.curvature[giving] * ((edge**2).sum(axis=0) - away**2)
        detected = lookup(known, found.gap, identity(neighbour[c], second), np.inf)
        end = np.where(np.isfinite(detected), detected, np.maximum(beside, range_))
        part = (range_ - gap) / np.maximum(end - gap, 1e-300)
        factors.append(np.where(end <= range_, 1.0, 2.0 * part))
    return np.stack(factors)


def _ends(outlines: Outlines, x: Array, found: ContactPairs, corners: Ints) -> tuple[Array, Array]:
    """Segments on which corners of the bodies that do not give points end their contacts.

    The factors (2, k) on the ends' halves of the segments, and the lengths of the corners (k,) [m]. The end that the
    body covers and the corner share the part between them, the other end has nothing. A blunt corner, both of whose
    edges are in contact, covers both ends and changes nothing.
    """
    c, normal, stencil = found.point[corners], found.normal[:, corners], found.stencil[:, corners]
    along = x[:, stencil[2]] - x[:, stencil[1]]
    foot = np.einsum("mk,imk->ik", found.weights[:, corners], x[:, stencil])
    direction = np.zeros(c.size)
    for neighbour in (outlines.next, outlines.previous):
        edge = x[:, neighbour[c]] - x[:, c]
        in_contact = np.einsum("ik,ik->k", normal, edge) <= TURNED_AWAY * np.hypot(*edge)
        direction += np.where(in_contact, np.sign(np.einsum("ik,ik->k", along, edge)), 0.0)
    covered = np.hypot(*(x[:, np.where(direction > 0.0, stencil[2], stencil[1])] - foot))
    share = np.minimum(covered / np.maximum(np.hypot(*along), 1e-300), 1.0)
    kept = np.stack([np.select([sign < 0.0, sign > 0.0], [share, 0.0], 1.0) for sign in (direction, -direction)])
    return kept, np.where(direction == 0.0, 0.0, 0.5 * covered)
