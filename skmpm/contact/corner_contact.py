"""Two corners that meet tip to tip.

The places of one corner where two bodies overlap are a wedge, that of the Minkowski difference of the bodies: its
sides are the outermost normals that both corners have in common. Its tip is rounded by a disc, so that the gap has a
direction wherever the corners are, the one in the middle where they meet head-on; gap and normal are continuous where
the disc meets the sides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.outline import Curve

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

PARALLEL_NORMALS = 1e-6  # difference of the normals of corners below which they point the same way


def edges(curve: Curve, x: Array, c: Ints) -> tuple[Array, Array]:
    """Unit vectors (2, k) from the boundary points c to the ones after and before them."""
    boundary = curve.outlines
    ahead, back = x[:, boundary.next[c]] - x[:, c], x[:, boundary.previous[c]] - x[:, c]
    return ahead / np.maximum(np.hypot(*ahead), 1e-300), back / np.maximum(np.hypot(*back), 1e-300)


def dot(a: Array, b: Array) -> Array:
    """Products of vectors (2, k), (k,)."""
    return np.asarray(np.einsum("ik,ik->k", a, b))


@dataclass(frozen=True)
class CornerContact:
    """The wedge that corners c may not enter because of corners j, its tip rounded by a disc that its sides touch."""

    seen: Bools  # (k,) whether c sees the tip, and not the sides
    normal: Array  # (2, k)
    gap: Array  # (k,) [m]
    key: Ints  # (k,)


def wedge(curve: Curve, x: Array, c: Ints, j: Ints, depth: float) -> CornerContact:
    """From the normals that both corners have in common: m in the middle of them, `half` to either side.

    In the disc the gap is measured along m, so that a corner that has gone past the tip still finds back.
    """
    m = _mean_normal(curve, x, j) - _mean_normal(curve, x, c)
    first, last = _fan(curve, x, j, m)
    from_c, to_c = _fan(curve, x, c, -m)
    keys = _keys(curve, c, j, from_c > first, to_c < last)
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
    seen = (size > PARALLEL_NORMALS) & (half >= 0.0) & (np.abs(across) <= above * np.tan(half))
    # Not in the middle, where tips meet head-on: there they should not forget their impulses.
    key = np.where(across > -0.5 * radius * np.sin(half), keys[1], keys[0])
    return CornerContact(seen, normal, gap, key)


def _keys(curve: Curve, c: Ints, j: Ints, before: Bools, after: Bools) -> tuple[Ints, Ints]:
    """Of the contacts that tips become at either end of the wedge: c with a side of j, or j with a side of c."""
    boundary, sides = curve.outlines, curve.side
    ends = ((before, boundary.previous), (after, np.arange(boundary.size)))
    first, last = (np.where(own, j, c) * curve.sides + sides[of[np.where(own, c, j)]] for own, of in ends)
    return first, last


def _fan(curve: Curve, x: Array, c: Ints, m: Array) -> tuple[Array, Array]:
    """Angles against m of the normals of the edges before and after corners c, (k,) each [rad]."""
    ahead, back = edges(curve, x, c)
    normals = (np.stack([-back[1], back[0]]), np.stack([ahead[1], -ahead[0]]))
    first, last = (np.arctan2(m[0] * n[1] - m[1] * n[0], dot(m, n)) for n in normals)
    return first, last


def _mean_normal(curve: Curve, x: Array, c: Ints) -> Array:
    inward = np.sum(edges(curve, x, c), axis=0)
    return np.asarray(-inward / np.maximum(np.hypot(*inward), 1e-300))
