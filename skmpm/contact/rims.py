"""Contact of rim points with outlines and walls, at the configuration of the end of the step.

A rim point c of one body is projected on the outline of another: segment (i, j), parameter s. The row of the pair is
N(c) w_a - (1 - s) N(i) w_b - s N(j) w_b along the interpolated vertex normal, so momentum is exact and the gap
sub-cell. One body of a pair gives the points (the finer rim, then position), the other the segments.

Gaps are those of the end of the step, but forces act along the normals of its middle: the work of a contact that
slides on a curved surface is then zero to second order. Along the normals of the end it would be
r |sliding|^2 / (2 R) > 0, a source of energy that makes frictionless discs spin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm import outline
from skmpm.contact.rows import Linearise, Rows, given_velocities
from skmpm.grid import Sheets
from skmpm.outline import Outlines
from skmpm.scene import Scene, SceneError, State

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

REACH = 0.25  # contacts with gaps up to this many cells are known to the solver
DEPTH = 1.0  # a point deeper than this many cells belongs to the other side of the body
FACING = -0.3  # largest cosine between the normals of two surfaces in contact
PUSH_OUT = 0.2  # share of an overlap left by an earlier step that a step removes


@dataclass(frozen=True)
class _Projections:
    """Rim points and their projections on the nearest segment of another body, at one configuration."""

    point: Ints  # (k,) rim vertex
    ends: Ints  # (2, k) rim vertices of the segment
    weights: Array  # (2, k) of the segment's two ends; zero for walls
    normal: Array  # (2, k) from the segment to the point
    gap: Array  # (k,) [m]
    distance: Array  # (k,) [m]
    facing: Array  # (k,) cosine between the normals of the two surfaces

    def __getitem__(self, chosen: Ints) -> _Projections:
        return _Projections(*(a[..., chosen] for a in self.__dict__.values()))


def outlines(scene: Scene, state: State, sheets: Sheets, dt: float) -> Linearise:
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
    rank, reach, start = _rank(scene, rim), REACH * sheets.cell, state.x[:, rim.point]
    margin = 0.5 * reach + 2.0 * dt * float(np.abs(state.v).max(initial=0.0))
    near = _neighbours(scene, rim, rank, start, reach, margin)

    def linearise(w: Array) -> Rows:
        nonlocal near
        moved = dt * ((interpolation @ w.reshape(-1, 2)).T + given)
        farthest = float(np.abs(moved).max(initial=0.0))
        if 2.0 * farthest > near.margin:
            near = _neighbours(scene, rim, rank, start, reach, 4.0 * farthest)
        pairs = _touching(scene, near, start, moved, sheets.cell)
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


def _rank(scene: Scene, rim: Outlines) -> Ints:
    """Order of the bodies (bodies,): of a pair the lower rank gives the points. Finer rims first, then position."""
    x = np.concatenate([body.points.x for body in scene.bodies], axis=1)[:, rim.point]
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

    rim: Outlines
    reach: float
    margin: float
    point: Ints
    segment: Ints


def _neighbours(scene: Scene, rim: Outlines, rank: Ints, x: Array, reach: float, margin: float) -> _Neighbours:
    point, segment = outline.candidates(rim, x, reach + margin)
    free = scene.deformable
    first, second = rim.body[point], rim.body[segment]
    kept = (rank[first] < rank[second]) & (free[first] | free[second])
    return _Neighbours(rim, reach, margin, point[kept], segment[kept])


def _project(near: _Neighbours, x: Array) -> _Projections:
    """Project every point on the nearest segment of every body near it; always the same pairs in the same order."""
    rim, c, i = near.rim, near.point, near.segment
    j = rim.next[i]
    s, distance = outline.closest(x[:, c], x[:, i], x[:, j])
    order = np.lexsort((distance, rim.body[i], c))
    pair = np.stack([c[order], rim.body[i][order]])
    first = np.ones(order.size, dtype=bool)
    first[1:] = (pair[:, 1:] != pair[:, :-1]).any(axis=0)
    kept = order[first]
    c, i, j, s = c[kept], i[kept], j[kept], s[kept]

    normals = outline.normals(rim, x)
    normal = (1.0 - s) * normals[:, i] + s * normals[:, j]
    normal = normal / np.maximum(np.hypot(*normal), 1e-300)
    foot = (1.0 - s) * x[:, i] + s * x[:, j]
    gap = np.einsum("ik,ik->k", x[:, c] - foot, normal)
    facing = np.einsum("ik,ik->k", normals[:, c], normal)
    return _Projections(c, np.stack([i, j]), np.stack([1.0 - s, s]), normal, gap, distance[kept], facing)


@dataclass(frozen=True)
class _Pairs:
    """The contacts of a configuration."""

    bodies: Ints  # (2, k)
    point: Ints  # (k,) rim vertex
    ends: Ints  # (2, k)
    weights: Array  # (2, k)
    normal: Array  # (2, k) in the middle of the step
    gap: Array  # (k,) [m] at its end
    before: Array  # (k,) [m] at its start
    friction: Array  # (k,)


def _touching(scene: Scene, near: _Neighbours, start: Array, moved: Array, cell: float) -> list[_Pairs]:
    """Contacts between bodies."""
    end = _project(near, start + moved)
    near_enough = (end.gap > -DEPTH * cell) & (end.gap < near.reach) & (end.distance < DEPTH * cell)
    chosen = np.flatnonzero(near_enough & (end.facing < FACING))
    middle, begin = _project(near, start + 0.5 * moved)[chosen], _project(near, start).gap[chosen]
    bodies = near.rim.body[np.stack([middle.point, middle.ends[0]])]
    friction = np.full(chosen.size, float(scene.friction))
    gap = end.gap[chosen]
    return [_Pairs(bodies, middle.point, middle.ends, middle.weights, middle.normal, gap, begin, friction)]


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
        ends=np.stack([c, c]),
        weights=np.zeros((2, c.size)),
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
    data = np.concatenate([np.ones(k.size), -pairs.weights[0], -pairs.weights[1]])
    place = (np.tile(k, 3), np.concatenate([pairs.point, *pairs.ends]))
    relative = sp.csr_array((data, place), shape=(k.size, rim.point.size))
    prescribed = (relative @ given.T).T
    on_wall = pairs.bodies[1] < 0
    prescribed[:, on_wall] -= walls[-1 - pairs.bodies[1, on_wall]].T
    difference = sp.csr_array(relative @ interpolation)
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
        given=prescribed,
        offset_normal=(pairs.gap - allowed) / dt - now,
    )
