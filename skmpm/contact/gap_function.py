"""The contacts of a configuration: which points touch which curve or wall, where, and how far from it they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.contact.projection import Neighbours, foot_points, project, tangent_shares
from skmpm.scene import Scene

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class ContactPairs:
    """The contacts of a configuration."""

    bodies: Ints  # (2, k)
    point: Ints  # (k,) boundary vertex
    key: Ints  # (k,) identity from step to step
    stencil: Ints  # (4, k) boundary vertices that carry the other side; unused for walls
    weights: Array  # (4, k) their shares; zero for walls
    tangent_shares: Array  # (4, k) shares in the curve's unit tangent [1/m]; zero for walls and at corners
    curvature: Array  # (k,) of the curve, negative where it bulges [1/m]; zero for walls and at corners
    normal: Array  # (2, k) at x + theta dt w
    gap: Array  # (k,) [m] at its end
    before: Array  # (k,) [m] at its start
    friction: Array  # (k,)


def contacts_between_bodies(scene: Scene, near: Neighbours, start: Array, moved: Array, theta: float) -> ContactPairs:
    """Contacts between bodies whose boundary points move from `start` by `moved` (2, m)."""
    curve, boundary = near.curve, near.curve.outlines
    now = curve.through(start + moved)
    end, begin = foot_points(near, now)
    at = now if theta == 1.0 else curve.through(start + theta * moved)
    driving = end if theta == 1.0 else project(near, at, end.point, end.segment, end.s, end.corner_pair)
    shares, curvature = tangent_shares(at, driving)
    return ContactPairs(
        bodies=boundary.body[np.stack([end.point, end.segment])],
        point=end.point,
        key=end.key,
        stencil=curve.stencil(driving.segment),
        weights=curve.weights(driving.segment, driving.s),
        tangent_shares=shares,
        curvature=curvature,
        normal=driving.normal,
        gap=end.gap,
        # Beside the end of a side there was no overlap with it.
        before=np.where(begin.beside, np.maximum(begin.gap, 0.0), begin.gap),
        friction=np.full(end.point.size, float(scene.friction)),
    )


def contacts_with_wall(
    scene: Scene, near: Neighbours, i: int, start: Array, moved: Array, point: Array, step: Array
) -> ContactPairs:
    """Contacts with wall i, which moves from `point` by `step`."""
    wall, curve, boundary = scene.walls[i], near.curve, near.curve.outlines
    normal = np.asarray(wall.normal, dtype=float)
    before = normal @ (start - point[:, None])
    gap = before + normal @ (moved - step[:, None])
    c = np.flatnonzero((gap < near.reach) & scene.deformable[boundary.body])
    return ContactPairs(
        bodies=np.stack([boundary.body[c], np.full(c.size, -1 - i)]),
        point=c,
        key=boundary.size * (curve.sides + i) + c,
        stencil=np.repeat(c[None], 4, axis=0),
        weights=np.zeros((4, c.size)),
        tangent_shares=np.zeros((4, c.size)),
        curvature=np.zeros(c.size),
        normal=np.repeat(normal[:, None], c.size, axis=1),
        gap=gap[c],
        before=before[c],
        friction=np.full(c.size, float(wall.friction)),
    )
