"""Contact of two convex corners.

The positions of one convex corner for which it overlaps another one form a wedge, a corner of the Minkowski
difference of the bodies. The normals of the sides of the wedge are the outermost normals that the normal cones of
both corners share. Its tip is rounded by a disc, so that the gap has a normal for all positions of the corners: the
mean normal where they meet head-on. Gap and normal are continuous where the disc meets the sides.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from skmpm.arrays import ROUND_OFF, Array, Bools, Ints
from skmpm.outline import Curve


def edges(curve: Curve, x: Array, c: Ints) -> tuple[Array, Array]:
    """Unit vectors (2, k) from the boundary points c (k,) to the next and to the previous ones."""
    boundary = curve.outlines
    ahead, back = x[:, boundary.next[c]] - x[:, c], x[:, boundary.previous[c]] - x[:, c]
    return ahead / np.maximum(np.hypot(*ahead), 1e-300), back / np.maximum(np.hypot(*back), 1e-300)


def dot(a: Array, b: Array) -> Array:
    """Scalar products (k,) of vectors (2, k)."""
    return np.asarray(np.einsum("ik,ik->k", a, b))


@dataclass(frozen=True)
class CornerContact:
    """Contact of corners c with the wedge of corners j, whose tip is rounded by a disc tangent to its sides."""

    seen: Bools  # (k,) whether c is closest to the disc at the tip and not to a side
    normal: Array  # (2, k)
    gap: Array  # (k,) [m]
    key: Ints  # (k,) identity of the contact
    other_key: Ints  # (k,) identity that it has on the other side of the axis of the wedge


def wedge(
    curve: Curve, identity: Callable[[Ints, Ints], Ints], x: Array, c: Ints, j: Ints, depth: float
) -> CornerContact:
    """Contact of corners c with corners j, from the normals common to both: mean normal m, half angle `half`.

    `identity` gives the keys of contacts of points with the sides of segments. `depth` [m] is the distance of the
    centre of the disc below the tip. Inside the disc the gap is measured along m, so that a corner that has passed
    the tip is still pushed back.
    """
    m = _mean_normal(curve, x, j) - _mean_normal(curve, x, c)
    first, last = _fan(curve, x, j, m)
    from_c, to_c = _fan(curve, x, c, -m)
    keys = _keys(curve, identity, c, j, from_c > first, to_c < last)
    first, last = np.maximum(first, from_c), np.minimum(last, to_c)
    turn, half = 0.5 * (first + last), 0.5 * (last - first)
    size = np.hypot(*m)
    m = m / np.maximum(size, 1e-300)
    m = np.cos(turn) * m + np.sin(turn) * np.stack([-m[1], m[0]])
    apart = x[:, c] - x[:, j]
    radius = depth * np.cos(half)
    across, along = apart[1] * m[0] - apart[0] * m[1], dot(apart, m) + depth
    above = np.maximum(along, np.sqrt(np.maximum(radius**2 - across**2, 0.0)))
    distance = np.maximum(np.hypot(across, above), 1e-300)
    normal = (above * m + across * np.stack([-m[1], m[0]])) / distance
    gap = distance - radius + (along - above) * above / distance
    # Corners whose mean normals are the same point the same way and cannot touch.
    seen = (size > ROUND_OFF) & (half >= 0.0) & (np.abs(across) <= above * np.tan(half))
    # The key changes beside the axis: corners that meet head-on keep it, and with it their impulses.
    beyond = across > -0.5 * radius * np.sin(half)
    return CornerContact(seen, normal, gap, np.where(beyond, keys[1], keys[0]), np.where(beyond, *keys))


def _keys(
    curve: Curve, identity: Callable[[Ints, Ints], Ints], c: Ints, j: Ints, before: Bools, after: Bools
) -> tuple[Ints, Ints]:
    """Keys of the contacts that adjoin at the two ends of the wedge: c with a side of j, or j with a side of c."""
    boundary = curve.outlines
    ends = ((before, boundary.previous), (after, np.arange(boundary.size)))
    first, last = (identity(np.where(own, j, c), of[np.where(own, c, j)]) for own, of in ends)
    return first, last


def _fan(curve: Curve, x: Array, c: Ints, m: Array) -> tuple[Array, Array]:
    """Angles (k,) [rad] from m to the normals of the edges before and after corners c."""
    ahead, back = edges(curve, x, c)
    normals = (np.stack([-back[1], back[0]]), np.stack([ahead[1], -ahead[0]]))
    first, last = (np.arctan2(m[0] * n[1] - m[1] * n[0], dot(m, n)) for n in normals)
    return first, last


def _mean_normal(curve: Curve, x: Array, c: Ints) -> Array:
    """Unit outward normals (2, k) that bisect the normal cones of corners c."""
    inward = np.sum(edges(curve, x, c), axis=0)
    return np.asarray(-inward / np.maximum(np.hypot(*inward), 1e-300))
