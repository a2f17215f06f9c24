"""Round bodies on gentle slopes: whether their contacts are too wide to roll and too narrow to average."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.contact import acts_at_grid_nodes
from skmpm.observe.bodies import diameters
from skmpm.outline.curve import CORNER_COSINE
from skmpm.outline.measures import turning_angles
from skmpm.preflight.metrics import SceneMetrics
from skmpm.preflight.quantities import Reading, floored
from skmpm.scene import Scene
from skmpm.stepping.loading import gravity_of

WIDE = 1.3  # [cells] half-width from which on the boundary points in contact average their chords out; test_rolling
STEEP = np.radians(6.0)  # slope from which on discs roll to 12 % at any width
STRAIGHT = 1e-6  # [rad] turn of an outline that is round-off


def wide_contacts(m: SceneMetrics) -> Reading | None:
    """Half-widths [boundary segments] of contacts of round bodies that lie on gentle slopes, by their own weight.

    Wide contacts act at boundary points, so that the body stands on the chords between them, unless they cover so
    many that these average out. The half-width is that of Hertz's theory for a disc on a plane. Slopes are walls and
    the straight sides of bodies that a motion or a support holds.
    """
    scene, gravity = m.scene, gravity_of(m.scene)
    if not (m.scheme.inertia and gravity.any()) or acts_at_grid_nodes(m.scheme.contact):
        return None
    slopes, discs = _gentle_slopes(scene, gravity), np.flatnonzero(scene.round & scene.movable)
    pairs = np.stack([np.repeat(discs, slopes.size), np.tile(slopes, discs.size)])
    pairs = pairs[:, pairs[0] != pairs[1]]
    pairs = pairs[:, scene.frictions.between(pairs) > 0.0]
    compliance = np.zeros(len(scene.bodies))
    of_slope = np.where(pairs[1] < 0, 0.0, scene.compliance[pairs[1]])
    np.maximum.at(compliance, pairs[0], scene.compliance[pairs[0]] + of_slope)
    b = np.flatnonzero(compliance)
    R = 0.5 * diameters(scene)[b]
    pressure = np.bincount(scene.owner, scene.masses)[b] * np.hypot(*gravity) / (np.pi * R)  # weight over pi R
    half_width = 2.0 * R * np.sqrt(pressure * compliance[b])
    narrow = half_width < WIDE * m.cell
    b, R, half_width = b[narrow], R[narrow], half_width[narrow]
    segment = 2.0 * np.pi * R / [max(map(len, scene.bodies[i].points.outline)) for i in b.tolist()]
    cells = [floored(a / WIDE) for a in half_width.tolist()]
    return Reading(b, half_width / segment, facts={"cell": np.array(cells)})


def _gentle_slopes(scene: Scene, gravity: Array) -> Ints:
    """Walls, as -1, -2, ..., and held bodies that have a side inclined against gravity by less than `STEEP`, (k,)."""
    boundary, x = scene.outlines, scene.initial_positions[:, scene.outlines.point]
    turn = np.abs(turning_angles(boundary, x))
    ends = (turn < STRAIGHT) | (np.cos(turn) < CORNER_COSINE)
    along, held = x[:, boundary.next] - x, ~scene.movable | scene.supported_bodies.any(axis=0)
    sides = ends & ends[boundary.next] & held[boundary.body] & _gentle(np.stack([along[1], -along[0]]), gravity)
    walls = -1 - np.flatnonzero(_gentle(scene.normals, gravity))
    return np.concatenate([walls, np.unique(boundary.body[sides])])


def _gentle(normals: Array, gravity: Array) -> Bools:
    """Whether planes of such outward normals (2, k) are inclined against gravity, but less than `STEEP`, (k,)."""
    along = np.abs(gravity[0] * normals[1] - gravity[1] * normals[0])
    across = -gravity @ normals
    return np.asarray((along > 1e-9 * across) & (along < np.tan(STEEP) * across))
