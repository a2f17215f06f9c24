"""Sharp edges of rigid bodies that may press on deformable ones."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from skmpm import outline
from skmpm.arrays import Array, Bools, Ints
from skmpm.contact import acts_at_grid_nodes
from skmpm.outline.measures import bend
from skmpm.preflight.metrics import SceneMetrics
from skmpm.preflight.quantities import Reading, ceiled, floored
from skmpm.scene import Scene
from skmpm.step.driven import driven_bodies, driven_by_force
from skmpm.step.initial_state import initial_motion
from skmpm.step.no_equilibrium import MIN_EDGE_RADIUS

ROUND_ENOUGH = 1.02  # of the least radius: what is advised, since chords of an arc bend by a little more than the arc


def edge_radii(m: SceneMetrics) -> Reading | None:
    """Radii of the edges of rigid bodies that meet deformable ones without inertia [cells]; 0 at corners.

    At corners the boundary turns by more than 50 degrees, however far apart its points are; on arcs with points 0.8
    radii apart it turns by 46.
    """
    if m.scheme.inertia or not m.touches or acts_at_grid_nodes(m.scheme.contact):
        return None
    scene, x, advised = m.scene, m.boundary, ROUND_ENOUGH * MIN_EDGE_RADIUS * m.cell
    bends, convex = bend(scene.outlines, x), outline.curve(scene.outlines, x).convex
    rigid = ~scene.deformable[scene.outlines.body]
    edge = np.flatnonzero(rigid & (convex | (bends * MIN_EDGE_RADIUS * m.cell > 1.0)))
    if edge.size == 0:
        return None
    radius = np.where(convex[edge], 0.0, 1.0 / np.maximum(bends[edge], 1e-300))
    met = _ahead(scene, scene.outlines.point[edge], outline.normals(scene.outlines, x)[:, edge], _reach(m))
    found, soft = np.nonzero(met)
    at, radius = edge[found], radius[found] / m.cell
    facts = {"x": x[0, at], "y": x[1, at], "soft": soft}
    facts |= {"radius": ceiled(advised), "spacing": floored(0.8 * advised)}
    return Reading(scene.outlines.body[at], radius, facts=facts)


def _reach(m: SceneMetrics) -> float:
    """Distance at which edges and bodies may meet [m]: by prescribed motions of both, until the end of the run.

    Without the end, or where forces drive bodies or walls, nothing is known of it.
    """
    forces = driven_bodies(m.scene).size or any(driven_by_force(m.scene))
    speed = m.fastest[1]
    return np.inf if m.until is None or forces or speed == 0.0 else m.cell + 2.0 * speed * m.until


def _ahead(scene: Scene, point: Ints, normal: Array, reach: float) -> Bools:
    """Whether points with outward normals (2, k) may meet a deformable body within reach [m], (k, bodies).

    The nearest body counts, within a cell or in front of the edge, unless they part at the start; and those whose
    bounding boxes the edge approaches then.
    """
    x, bodies = scene.initial_positions, np.flatnonzero(scene.deformable[scene.owner])
    v, start = initial_motion(scene)[0], scene.offsets[:-1]
    u = v[:, point, None] - (np.add.reduceat(v, start, axis=1) / np.diff(scene.offsets))[:, None]
    distance, nearest = (np.asarray(a) for a in cKDTree(x[:, bodies].T).query(x[:, point].T))
    to, owner = x[:, bodies[nearest]] - x[:, point], scene.owner[bodies[nearest]]
    parts = (u[:, np.arange(point.size), owner] * to).sum(axis=0) < 0.0
    near = (distance < scene.cell) | (((to * normal).sum(axis=0) > 0.0) & (distance < reach) & ~parts)
    low, high = (f.reduceat(x, start, axis=1) for f in (np.minimum, np.maximum))
    sides = np.stack([side[:, None] - x[:, point, None] for side in (low, high)]) / np.where(u == 0.0, 1e-300, u)
    enters, leaves = sides.min(axis=0).max(axis=0), sides.max(axis=0).min(axis=0)
    approaches = (enters <= leaves) & (leaves > 0.0) & (np.einsum("ik,ikb->kb", normal, u) > 0.0) & scene.deformable
    found: Bools = (near[:, None] & (owner[:, None] == np.arange(len(scene.bodies)))) | approaches
    return found
