"""Contact of rim points with outlines and walls, at the configuration of the end of the step.

A rim point c of one body is projected on the smooth outline of another (`outline.Curve`): a combination of four rim
points with shares z(s). The row of the pair is N(c) w_a - sum_m z_m N(m) w_b along the curve's normal, which is the
exact derivative of the gap: momentum is exact, forces meet on one line, and a frictionless contact is conservative.
One body of a pair gives the points (the finer rim, then position), the other the curve.

Gaps are those of the end of the step. Forces act along the normals of the configuration whose stress drives the
step, x + theta dt w: a disc that turns under pressure is driven by its stress, and braked by its contacts, by
p V (omega dt)^2 a step; only normals and stress of one configuration cancel each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm import outline
from skmpm.contact.rows import Linearise, Rows, given_velocities
from skmpm.grid import Sheets
from skmpm.outline import Curve, Outlines
from skmpm.scene import Scene, SceneError, State

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

REACH = 0.25  # contacts with gaps up to this many cells are known to the solver
DEPTH = 1.0  # a point deeper than this many cells belongs to the other side of the body
FACING = -0.3  # largest cosine between the normals of two surfaces in contact
PUSH_OUT = 0.2  # share of an overlap left by an earlier step that a step removes


def outlines(scene: Scene, state: State, sheets: Sheets, dt: float, theta: float = 1.0) -> Linearise:
    """Rim points against outlines and walls (the default contact law).

    The gap is re-measured where `w` brings the bodies at the end of the step; contacts obey
    u_n(w') = [g(w) - g_allowed] / dt + n . (relative velocity of w' - w) >= 0. Whatever overlap a pair had at the
    start of the step, it may keep 0.8 of it (`PUSH_OUT`).

    Raises
    ------
    SceneError
        if a body has no outline
    """
    for b, body in enumerate(scene.bodies):
        if not body.points.outline:
            raise SceneError(
                f"body {b} has no outline; give its Points an outline or use Scheme(contact=shared_nodes, anchor=0)"
            )
    rim = scene.outlines
    interpolation = _rim_interpolation(scene, state, sheets, rim)
    given = given_velocities(scene, state.t + 0.5 * dt)[:, rim.body]
    wall_velocities = scene.wall_velocities(state.t + 0.5 * dt)
    initial = scene.initial_positions[:, rim.point]
    rank, reach, start = _rank(scene, rim, initial), REACH * sheets.cell, state.x[:, rim.point]
    margin = 0.5 * reach + 2.0 * dt * float(np.abs(state.v).max(initial=0.0))
    curve = outline.curve(rim, initial)
    near = _neighbours(scene, curve, rank, start, reach, margin)

    def linearise(w: Array) -> Rows:
        nonlocal near
        moved = dt * ((interpolation @ w.reshape(-1, 2)).T + given)
        farthest = float(np.abs(moved).max(initial=0.0))
        if 2.0 * farthest > near.margin:
            near = _neighbours(scene, curve, rank, start, reach, 4.0 * farthest)
        pairs = [_touching(scene, near, start, moved, theta, sheets.cell)]
        pairs += [
            _on_wall(scene, rim, i, start, moved, state.walls[i], dt * v, reach)
            for i, v in enumerate(wall_velocities)
        ]
        joined = _Pairs(
            *(np.concatenate(parts, axis=-1) for parts in zip(*(p.__dict__.values() for p in pairs), strict=True))
        )
        return _rows(scene, joined, rim, start + moved, interpolation, w, given, wall_velocities, dt)

    return linearise


def _rim_interpolation(scene: Scene, state: State, sheets: Sheets, rim: Outlines) -> sp.csr_array:
    """Nodal values to rim points, (m, nodes); zero rows on rigid bodies."""
    unknown = scene.deformable[state.body]
    place = np.cumsum(unknown) - 1
    own = unknown[rim.point]
    chosen = sp.csr_array(
        (own.astype(float), (np.arange(rim.point.size), np.where(own, place[rim.point], 0))),
        shape=(rim.point.size, sheets.local.shape[1]),
    )
    return sp.csr_array(chosen @ sheets.interpolation)


def _rank(scene: Scene, rim: Outlines, x: Array) -> Ints:
    """Order of the bodies (bodies,): of a pair the lower rank gives the points. Finer rims first, then position."""
    count = np.maximum(np.bincount(rim.body, minlength=len(scene.bodies)), 1)
    length = np.hypot(*(x[:, rim.next] - x))
    spacing = np.bincount(rim.body, length, len(scene.bodies)) / count
    rounded = np.round(spacing / max(float(spacing.max()), 1e-300), 6)
    centre = [np.bincount(rim.body, component, len(scene.bodies)) / count for component in x]
    rank = np.empty(len(scene.bodies), dtype=np.int64)
    rank[np.lexsort((centre[1], centre[0], rounded))] = np.arange(rank.size)
    return rank


@dataclass(frozen=True)
class _Neighbours:
    """Points and segments that stay all there can be as long as no rim point moves by more than half the margin."""

    curve: Curve
    reach: float
    margin: float
    point: Ints
    segment: Ints


def _neighbours(scene: Scene, curve: Curve, rank: Ints, x: Array, reach: float, margin: float) -> _Neighbours:
    rim = curve.outlines
    point, segment = outline.candidates(rim, x, reach + margin)
    free = scene.deformable
    first, second = rim.body[point], rim.body[segment]
    kept = (rank[first] < rank[second]) & (free[first] | free[second])
    return _Neighbours(curve, reach, margin, point[kept], segment[kept])


def _nearest(near: _Neighbours, x: Array, farthest: float) -> tuple[Ints, Ints, Array]:
    """Of every point and every body near it the nearest segment, and where on it, if not farther than `farthest`."""
    rim, c, i = near.curve.outlines, near.point, near.segment
    s, distance = outline.closest(x[:, c], x[:, i], x[:, rim.next[i]])
    along = x[:, rim.next[i]] - x[:, i]
    # Of two segments that meet in the nearest point, a corner, the one that faces the point's own surface more.
    facing = np.einsum("ik,ik->k", outline.normals(rim, x)[:, c], np.stack([along[1], -along[0]]))
    order = np.lexsort((distance + 1e-6 * facing, rim.body[i], c))
    order = order[distance[order] < farthest]
    pair = np.stack([c[order], rim.body[i][order]])
    first = np.ones(order.size, dtype=bool)
    first[1:] = (pair[:, 1:] != pair[:, :-1]).any(axis=0)
    kept = order[first]
    return c[kept], i[kept], s[kept]


@dataclass(frozen=True)
class _Projections:
    """Rim points projected on the curves of other bodies."""

    point: Ints  # (k,) rim vertex
    segment: Ints  # (k,)
    s: Array  # (k,)
    normal: Array  # (2, k) from the curve to the point
    gap: Array  # (k,) [m]

    def __getitem__(self, chosen: Ints) -> _Projections:
        return _Projections(*(a[..., chosen] for a in self.__dict__.values()))


def _project(curve: Curve, x: Array, c: Ints, segment: Ints, s: Array) -> _Projections:
    """Project points c (k,) on curves, from a start nearby; a point off a corner sees the corner itself."""
    segment, s = curve.project(x, x[:, c], segment, s)
    apart, normal = x[:, c] - curve.at(x, segment, s), curve.normals(x, segment, s)
    gap, distance = np.einsum("ik,ik->k", apart, normal), np.hypot(*apart)
    # By the length of the segment, not of the gap: a point right on the corner has no direction of its own.
    along = np.abs(apart[0] * normal[1] - apart[1] * normal[0])
    off_corner = curve.at_corner(segment, s) & (along > 1e-6 * np.hypot(*curve.at(x, segment, s, 1)))
    beside = off_corner & (gap > 0.0)
    normal = np.where(beside, apart / np.where(beside, distance, 1.0), normal)
    return _Projections(c, segment, s, normal, np.where(beside, distance, gap))


@dataclass(frozen=True)
class _Pairs:
    """The contacts of a configuration."""

    bodies: Ints  # (2, k)
    point: Ints  # (k,) rim vertex
    stencil: Ints  # (4, k) rim vertices that carry the other side; unused for walls
    weights: Array  # (4, k) their shares; zero for walls
    turning: Array  # (4, k) shares in the curve's unit tangent [1/m]; zero for walls and at corners
    curvature: Array  # (k,) of the curve, negative where it bulges [1/m]; zero for walls and at corners
    normal: Array  # (2, k) at x + theta dt w
    gap: Array  # (k,) [m] at its end
    before: Array  # (k,) [m] at its start
    friction: Array  # (k,)


def _touching(scene: Scene, near: _Neighbours, start: Array, moved: Array, theta: float, cell: float) -> _Pairs:
    """Contacts between bodies."""
    curve, rim, after = near.curve, near.curve.outlines, start + moved
    end = _project(curve, after, *_nearest(near, after, DEPTH * cell))
    facing = np.einsum("ik,ik->k", outline.normals(rim, after)[:, end.point], end.normal)
    end = end[np.flatnonzero((end.gap > -DEPTH * cell) & (end.gap < near.reach) & (facing < FACING))]
    driving = end if theta == 1.0 else _project(curve, start + theta * moved, end.point, end.segment, end.s)
    begin = _project(curve, start, end.point, end.segment, end.s)
    at = start + theta * moved
    speed = np.hypot(*curve.at(at, driving.segment, driving.s, 1))
    bend, smooth = curve.at(at, driving.segment, driving.s, 2), ~curve.at_corner(driving.segment, driving.s)
    return _Pairs(
        bodies=rim.body[np.stack([end.point, end.segment])],
        point=end.point,
        stencil=curve.stencil(driving.segment),
        weights=curve.weights(driving.segment, driving.s),
        turning=np.where(smooth, curve.weights(driving.segment, driving.s, 1) / speed, 0.0),
        curvature=np.where(smooth, np.einsum("ik,ik->k", driving.normal, bend) / speed**2, 0.0),
        normal=driving.normal,
        gap=end.gap,
        before=begin.gap,
        friction=np.full(end.point.size, float(scene.friction)),
    )


def _on_wall(
    scene: Scene, rim: Outlines, i: int, start: Array, moved: Array, point: Array, step: Array, reach: float
) -> _Pairs:
    """Contacts with wall i, which moves from `point` by `step`."""
    wall = scene.walls[i]
    normal = np.asarray(wall.normal, dtype=float)
    before = normal @ (start - point[:, None])
    gap = before + normal @ (moved - step[:, None])
    c = np.flatnonzero((gap < reach) & scene.deformable[rim.body])
    return _Pairs(
        bodies=np.stack([rim.body[c], np.full(c.size, -1 - i)]),
        point=c,
        stencil=np.repeat(c[None], 4, axis=0),
        weights=np.zeros((4, c.size)),
        turning=np.zeros((4, c.size)),
        curvature=np.zeros(c.size),
        normal=np.repeat(normal[:, None], c.size, axis=1),
        gap=gap[c],
        before=before[c],
        friction=np.full(c.size, float(wall.friction)),
    )


def _key(scene: Scene, pairs: _Pairs) -> Ints:
    other = np.where(pairs.bodies[1] < 0, len(scene.bodies) - 1 - pairs.bodies[1], pairs.bodies[1])
    return np.asarray(pairs.point * (len(scene.bodies) + len(scene.walls)) + other)


def _rows(
    scene: Scene,
    pairs: _Pairs,
    rim: Outlines,
    x: Array,
    interpolation: sp.csr_array,
    w: Array,
    given: Array,
    walls: Array,
    dt: float,
) -> Rows:
    """The pairs as rows, linearised about w, which brings the rim points to x (2, m)."""
    k = np.arange(pairs.gap.size)
    data = np.concatenate([np.ones(k.size), -pairs.weights.ravel()])
    place = (np.tile(k, 5), np.concatenate([pairs.point, pairs.stencil.ravel()]))
    relative = sp.csr_array((data, place), shape=(k.size, rim.point.size))
    prescribed = (relative @ given.T).T
    on_wall = pairs.bodies[1] < 0
    prescribed[:, on_wall] -= walls[-1 - pairs.bodies[1, on_wall]].T
    difference = sp.csr_array(relative @ interpolation)
    turning = sp.csr_array((pairs.turning.ravel(), (np.tile(k, 4), pairs.stencil.ravel())), shape=relative.shape)
    now = np.einsum("ik,ki->k", pairs.normal, difference @ w.reshape(-1, 2))
    allowed = (1.0 - PUSH_OUT) * np.minimum(pairs.before, 0.0)
    return Rows(
        bodies=pairs.bodies,
        x=x[:, pairs.point],
        normal=pairs.normal,
        gap=pairs.gap,
        friction=pairs.friction,
        key=_key(scene, pairs),
        point=rim.point[pairs.point],
        difference=difference,
        turning=sp.csr_array(turning @ interpolation),
        curvature=pairs.curvature,
        given=prescribed,
        offset_normal=(pairs.gap - allowed) / dt - now,
        pushed=np.where(pairs.before < 0.0, np.maximum(np.minimum(pairs.gap, 0.0) - pairs.before, 0.0), 0.0),
    )
