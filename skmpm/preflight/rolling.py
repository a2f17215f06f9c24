"""Soft round bodies that stop on gentle slopes."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.contact import acts_at_grid_nodes
from skmpm.outline.curve import CORNER_COSINE
from skmpm.scene import Scene
from skmpm.scheme import Scheme
from skmpm.step.loading import gravity_of

WIDE = 1.3  # [cells] half-width from which on the boundary points in contact average their chords out; test_rolling
STEEP = np.radians(6.0)  # slope from which on discs roll to 12 % at any width
STRAIGHT = 1e-6  # [rad] turn of an outline that is round-off


def contacts_on_slopes(scene: Scene, scheme: Scheme) -> tuple[list[int], list[float], list[float]]:
    """Bodies on a gentle slope whose contacts under their own weight are too narrow to average over segments.

    A contact of a half-width of more than `LIGHT` segments acts at boundary points, so that the body stands on the
    chords between them. The half-width is that of Hertz's theory for a disc on a plane. Slopes are walls and the
    straight sides of bodies that a motion or a support holds.

    Also returns the half-widths [boundary segments], and cells so small that contacts average [m].
    """
    bodies, widths, cells = list[int](), list[float](), list[float]()
    gravity = gravity_of(scene)
    weight = float(np.hypot(*gravity))
    if not (scheme.inertia and weight > 0.0) or acts_at_grid_nodes(scheme.contact):
        return bodies, widths, cells
    slopes = _gentle_slopes(scene, gravity)
    for b in np.flatnonzero(scene.round & scene.movable).tolist() if slopes.size else ():
        under = slopes[slopes != b]
        under = under[scene.frictions.between(np.stack([np.full_like(under, b), under])) > 0.0]
        if under.size == 0:
            continue
        compliance = scene.compliance[b] + float(np.where(under < 0, 0.0, scene.compliance[under]).max())
        own = slice(scene.offsets[b], scene.offsets[b + 1])
        R = np.sqrt(scene.initial_volumes[own].sum() / np.pi)
        segment = 2.0 * np.pi * R / max(map(len, scene.bodies[b].points.outline))
        density = float(np.average(scene.densities[own], weights=scene.initial_volumes[own]))
        half_width = 2.0 * R * np.sqrt(density * weight * R * compliance)
        if 0.0 < half_width < WIDE * scene.cell:
            bodies.append(b)
            widths.append(float(half_width / segment))
            cells.append(float(half_width / WIDE))
    return bodies, widths, cells


def _gentle_slopes(scene: Scene, gravity: Array) -> Ints:
    """Walls, as -1, -2, ..., and held bodies that have a side inclined against gravity by less than `STEEP`, (k,)."""
    walls = -1 - np.flatnonzero(_gentle(scene.normals, gravity))
    held = [np.flatnonzero(~scene.movable), *(scene.owner[place.points] for place in scene.supported)]
    bodies = [b for b in np.unique(np.concatenate(held)).tolist() if _gentle(_sides(scene, b), gravity).any()]
    return np.concatenate([walls, np.array(bodies, dtype=np.int64)])


def _gentle(normals: Array, gravity: Array) -> Bools:
    """Whether planes of such outward normals (2, k) are inclined against gravity, but less than `STEEP`, (k,)."""
    along = np.abs(gravity[0] * normals[1] - gravity[1] * normals[0])
    across = -gravity @ normals
    return np.asarray((along > 1e-9 * across) & (along < np.tan(STEEP) * across))


def _sides(scene: Scene, b: int) -> Array:
    """Outward normals of the segments of a body beyond which its outline goes straight on or has a corner, (2, k)."""
    normals = [np.zeros((2, 0))]
    for loop in scene.bodies[b].points.outline:
        x = scene.bodies[b].points.x[:, loop]
        t = np.roll(x, -1, axis=1) - x
        t /= np.hypot(*t)
        before = np.roll(t, 1, axis=1)
        turn = np.arctan2(before[0] * t[1] - before[1] * t[0], (before * t).sum(axis=0))
        ends = (np.abs(turn) < STRAIGHT) | (np.cos(turn) < CORNER_COSINE)
        normals.append(np.stack([t[1], -t[0]])[:, ends & np.roll(ends, -1)])
    return np.concatenate(normals, axis=1)
