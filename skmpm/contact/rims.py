"""Contact of rim points with outlines and walls, at the configuration of the end of the step.

A rim point c of one body is projected on the smooth outline of another (`outline.Curve`): a combination of four rim
points with shares z(s). The row of the pair is N(c) w_a - sum_m z_m N(m) w_b along the curve's normal, which is the
exact derivative of the gap: momentum is exact, forces meet on one line, and a frictionless contact is conservative.
One body of a pair gives the points (the deformable one, then the finer rim, then position), the other the curve, and
its corners as points.

Gaps are those of the end of the step. Forces act along the normals of the configuration whose stress drives the
step, x + theta dt w: a disc that turns under pressure is driven by its stress, and braked by its contacts, by
p V (omega dt)^2 a step; only normals and stress of one configuration cancel each other.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm import outline
from skmpm.contact.pairs import Pairs, touching_bodies, touching_wall
from skmpm.contact.rows import Linearise, Rows, given_velocities
from skmpm.contact.sides import Roles, neighbours
from skmpm.grid import Sheets
from skmpm.outline import Outlines
from skmpm.scene import Scene, SceneError, State

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

REACH = 0.25  # contacts with gaps up to this many cells are found
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
    roles, reach, start = _roles(scene, rim, initial), REACH * sheets.cell, state.x[:, rim.point]
    margin = 0.5 * reach + 2.0 * dt * float(np.abs(state.v).max(initial=0.0))
    curve = outline.curve(rim, initial, start)
    near = neighbours(scene, curve, roles, start, sheets.cell, reach, margin)

    def touching(moved: Array) -> Pairs:
        walls = enumerate(zip(state.walls, dt * wall_velocities, strict=True))
        on_walls = (touching_wall(scene, near, i, start, moved, *wall) for i, wall in walls)
        bodies = [] if near.none and scene.walls else [touching_bodies(scene, near, start, moved, theta)]
        return Pairs.joined([*bodies, *on_walls])

    def linearise(w: Array) -> Rows:
        nonlocal near
        moved = dt * ((interpolation @ w.reshape(-1, 2)).T + given)
        farthest = float(np.abs(moved).max(initial=0.0))
        if 2.0 * farthest > near.margin:
            near = neighbours(scene, curve, roles, start, sheets.cell, reach, 4.0 * farthest)
        return _rows(scene, touching(moved), start + moved, interpolation, w, given, wall_velocities, dt)

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


def _roles(scene: Scene, rim: Outlines, x: Array) -> Roles:
    """Which bodies give the points: deformable ones, of two of them the one with the finer rim, then by position.

    The curve of a rigid body does not depend on the solution: nor do the normals of forces on it.
    """
    count = np.maximum(np.bincount(rim.body, minlength=len(scene.bodies)), 1)
    length = np.hypot(*(x[:, rim.next] - x))
    spacing = np.bincount(rim.body, length, len(scene.bodies)) / count
    rounded = np.round(spacing / max(float(spacing.max()), 1e-300), 6)
    centre = [np.bincount(rim.body, component, len(scene.bodies)) / count for component in x]
    rank = np.empty(len(scene.bodies), dtype=np.int64)
    rank[np.lexsort((centre[1], centre[0], rounded, ~scene.deformable))] = np.arange(rank.size)
    bend = np.where(scene.deformable[rim.body], 0.0, outline.bend(rim, x))
    return Roles(rank, spacing, bend)


def _rows(
    scene: Scene,
    pairs: Pairs,
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
    relative = sp.csr_array((data, place), shape=(k.size, x.shape[1]))
    prescribed = (relative @ given.T).T
    on_wall = pairs.bodies[1] < 0
    prescribed[:, on_wall] -= walls[-1 - pairs.bodies[1, on_wall]].T
    turning = sp.csr_array((pairs.turning.ravel(), (np.tile(k, 4), pairs.stencil.ravel())), shape=relative.shape)
    turning.eliminate_zeros()
    now = np.einsum("ik,ki->k", pairs.normal, relative @ (interpolation @ w.reshape(-1, 2)))
    allowed = (1.0 - PUSH_OUT) * np.minimum(pairs.before, 0.0)
    return Rows(
        bodies=pairs.bodies,
        x=x[:, pairs.point],
        normal=pairs.normal,
        gap=pairs.gap,
        friction=pairs.friction,
        key=pairs.key,
        point=scene.outlines.point[pairs.point],
        base=interpolation,
        difference=relative,
        turning=turning,
        curvature=pairs.curvature,
        given=prescribed,
        offset_normal=(pairs.gap - allowed) / dt - now,
        pushed=np.where(pairs.before < 0.0, np.maximum(np.minimum(pairs.gap, 0.0) - pairs.before, 0.0), 0.0),
    )
