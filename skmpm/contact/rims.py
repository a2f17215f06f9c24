"""Contact of rim points with outlines and walls, at the configuration of the end of the step.

A rim point c of one body is projected on the outline of another: segment (i, j), parameter s. The row of the pair is
N(c) w_a - (1 - s) N(i) w_b - s N(j) w_b along the interpolated vertex normal, so momentum is exact and the gap
sub-cell. One body of a pair gives the points (the finer rim, then position), the other the segments.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm import outline
from skmpm.contact.rows import Linearise, Rows, given_velocities, lookup
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
class _Pairs:
    """Rim points beside segments (or walls) at one configuration."""

    bodies: Ints  # (2, k)
    point: Ints  # (k,) rim vertex
    weight: Array  # (2, k) of the segment's two ends; zero for walls
    ends: Ints  # (2, k) rim vertices of the segment
    normal: Array  # (2, k)
    gap: Array  # (k,) [m]
    friction: Array  # (k,)


def outlines(scene: Scene, state: State, sheets: Sheets, dt: float) -> Linearise:
    """Rim points against outlines and walls (the default contact law).

    The gap is re-measured where `w` brings the bodies at the end of the step; contacts obey
    u_n(w') = [g(w) - g_allowed] / dt + n . (relative velocity of w' - w) >= 0. Whatever overlap a pair had at the
    start of the step, it may keep 0.8 of it (`PUSH_OUT`).
    """
    missing = [b for b, body in enumerate(scene.bodies) if not body.points.outline]
    if missing:
        raise SceneError(
            f"body {missing[0]} has no outline; give its Points an outline"
            " or use Scheme(contact=shared_nodes, anchor=0)"
        )
    rim = scene.outlines
    interpolation = _rim_interpolation(scene, state, sheets, rim)
    given = given_velocities(scene, state.t + 0.5 * dt)[:, rim.body]
    wall_step = dt * scene.wall_velocities(state.t + 0.5 * dt)
    rank = _rank(scene, rim)
    start = state.x[:, rim.point]
    margin = 0.5 * REACH * sheets.cell + 2.0 * dt * float(np.abs(state.v).max(initial=0.0))
    near = _Neighbours(scene, rim, rank, REACH * sheets.cell, start, margin)
    before = _find(scene, near, start, state.walls, sheets.cell)
    key_before, gap_before = _key(scene, before), before.gap

    def linearise(w: Array) -> Rows:
        nonlocal near
        moved = dt * ((interpolation @ w.reshape(-1, 2)).T + given)
        if 2.0 * float(np.abs(moved).max(initial=0.0)) > near.margin:
            near = _Neighbours(scene, rim, rank, near.reach, start, 4.0 * float(np.abs(moved).max()))
        pairs = _find(scene, near, start + moved, state.walls + wall_step, sheets.cell)
        key = _key(scene, pairs)
        allowed = (1.0 - PUSH_OUT) * np.minimum(lookup(key_before, gap_before, key, 0.0), 0.0)
        rows = _rows(pairs, key, rim, start + moved, interpolation, given, wall_step / dt)
        now = np.einsum("ik,ki->k", rows.normal, rows.difference @ w.reshape(-1, 2))
        offset = (pairs.gap - allowed) / dt - now
        return Rows(**{**rows.__dict__, "offset_normal": offset})

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


@dataclass(frozen=True, init=False)
class _Neighbours:
    """Candidates that stay complete as long as no rim point moves by more than half the margin."""

    rim: Outlines
    reach: float
    margin: float
    point: Ints
    segment: Ints

    def __init__(self, scene: Scene, rim: Outlines, rank: Ints, reach: float, x: Array, margin: float) -> None:
        point, segment = outline.candidates(rim, x, reach + margin)
        free = scene.deformable
        first, second = rim.body[point], rim.body[segment]
        kept = (rank[first] < rank[second]) & (free[first] | free[second])
        for name, value in (
            ("rim", rim),
            ("reach", reach),
            ("margin", margin),
            ("point", point[kept]),
            ("segment", segment[kept]),
        ):
            object.__setattr__(self, name, value)


def _find(scene: Scene, near: _Neighbours, x: Array, walls: Array, cell: float) -> _Pairs:
    normals = outline.normals(near.rim, x)
    found = [_against_outlines(scene, near, x, normals, cell)]
    found += [_against_wall(scene, near, x, walls[i], i) for i in range(len(scene.walls))]
    return _Pairs(
        *(np.concatenate(parts, axis=-1) for parts in zip(*(p.__dict__.values() for p in found), strict=True))
    )


def _against_outlines(scene: Scene, near: _Neighbours, x: Array, normals: Array, cell: float) -> _Pairs:
    rim, c, i = near.rim, near.point, near.segment
    j = rim.next[i]
    s, distance = outline.closest(x[:, c], x[:, i], x[:, j])
    order = np.lexsort((distance, rim.body[i], c))  # the nearest segment of each (point, body)
    pair = np.stack([c[order], rim.body[i][order]])
    first = np.ones(order.size, dtype=bool)
    first[1:] = (pair[:, 1:] != pair[:, :-1]).any(axis=0)
    kept = order[first]
    c, i, j, s = c[kept], i[kept], j[kept], s[kept]

    normal = (1.0 - s) * normals[:, i] + s * normals[:, j]
    normal = normal / np.hypot(*normal)
    foot = (1.0 - s) * x[:, i] + s * x[:, j]
    gap = np.einsum("ik,ik->k", x[:, c] - foot, normal)
    facing = np.einsum("ik,ik->k", normals[:, c], normal)
    near_enough = (gap > -DEPTH * cell) & (gap < near.reach) & (distance[kept] < DEPTH * cell)
    k = np.flatnonzero(near_enough & (facing < FACING))
    c, i, j, s = c[k], i[k], j[k], s[k]
    return _Pairs(
        bodies=np.stack([rim.body[c], rim.body[i]]),
        point=c,
        weight=np.stack([1.0 - s, s]),
        ends=np.stack([i, j]),
        normal=normal[:, k],
        gap=gap[k],
        friction=np.full(k.size, float(scene.friction)),
    )


def _against_wall(scene: Scene, near: _Neighbours, x: Array, point: Array, i: int) -> _Pairs:
    rim, wall = near.rim, scene.walls[i]
    normal = np.asarray(wall.normal, dtype=float)
    gap = normal @ (x - point[:, None])
    c = np.flatnonzero((gap < near.reach) & scene.deformable[rim.body])
    return _Pairs(
        bodies=np.stack([rim.body[c], np.full(c.size, -1 - i)]),
        point=c,
        weight=np.zeros((2, c.size)),
        ends=np.stack([c, c]),
        normal=np.repeat(normal[:, None], c.size, axis=1),
        gap=gap[c],
        friction=np.full(c.size, float(wall.friction)),
    )


def _key(scene: Scene, pairs: _Pairs) -> Ints:
    other = np.where(pairs.bodies[1] < 0, len(scene.bodies) - 1 - pairs.bodies[1], pairs.bodies[1])
    return np.asarray(pairs.point * (len(scene.bodies) + len(scene.walls)) + other)


def _rows(
    pairs: _Pairs, key: Ints, rim: Outlines, x: Array, interpolation: sp.csr_array, given: Array, walls: Array
) -> Rows:
    k = np.arange(pairs.gap.size)
    data = np.concatenate([np.ones(k.size), -pairs.weight[0], -pairs.weight[1]])
    place = (np.tile(k, 3), np.concatenate([pairs.point, *pairs.ends]))
    relative = sp.csr_array((data, place), shape=(k.size, rim.point.size))
    moved = (relative @ given.T).T
    on_wall = pairs.bodies[1] < 0
    moved[:, on_wall] -= walls[-1 - pairs.bodies[1, on_wall]].T
    return Rows(
        bodies=pairs.bodies,
        x=x[:, pairs.point],
        normal=pairs.normal,
        gap=pairs.gap,
        friction=pairs.friction,
        key=key,
        point=rim.point[pairs.point],
        difference=sp.csr_array(relative @ interpolation),
        given=moved,
        offset_normal=pairs.gap,
    )
