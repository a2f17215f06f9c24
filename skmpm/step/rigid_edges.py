"""Sharp edges of rigid bodies, as those of a flat punch, that indent deformable bodies, where stress is unbounded.

An edge is a boundary point where the boundary bends with less than a given radius; in plane strain it is an edge of
the body. Corners, also of deformable bodies, are turns of an outline by more than 50 degrees (`outline.curve`).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from skmpm import outline
from skmpm.arrays import ROUND_OFF, Array, Bools, Ints
from skmpm.outline.measures import bend
from skmpm.scene import Contacts, Scene

# [cells] Radius of edges that indented 13 of 14 blocks by 40 % of their height without inertia (test_punch).
MIN_EDGE_RADIUS = 0.5


def indenting_edge_message(scene: Scene, contacts: Contacts) -> str:
    """The text on the rigid edge that carries the largest contact force, for error messages; empty if none does.

    Rigid bodies contribute boundary points to contacts only at edges, as the first body of a contact.
    """
    if contacts.gap.size == 0:
        return ""
    k = int(np.argmax(contacts.force[0]))
    first, second = contacts.bodies[:, k].tolist()
    if contacts.force[0, k] <= 0.0 or contacts.point[k] < 0 or second < 0 or scene.deformable[first]:
        return ""
    x, y = contacts.x[:, k]
    return (
        f"; the largest contact force acts on an edge of body {first} at ({x:.6g}, {y:.6g}) m, where stress is"
        f" unbounded and body {second} may snap through: if a smaller dt does not help, use inertia, or round the"
        f" edge by {MIN_EDGE_RADIUS * scene.cell:.4g} m"
    )


def facing_edges(scene: Scene, v: Array, radius: float) -> Ints:
    """Edges of rigid bodies with radii of less than `radius` [m] that meet deformable bodies, (3, k).

    Rows are the rigid body, the material point of the edge, the deformable body. An edge meets a body whose points
    lie within a cell of it, or whose bounding box it approaches with the velocities v (2, n) [m/s] of the points.
    """
    boundary, x = scene.outlines, scene.initial_positions
    at = x[:, boundary.point]
    edges = np.flatnonzero(~scene.deformable[boundary.body] & (bend(boundary, at) * radius > 1.0 + ROUND_OFF))
    if edges.size == 0:
        return np.zeros((3, 0), dtype=np.int64)
    point, normal = boundary.point[edges], outline.normals(boundary, at)[:, edges]
    e, soft = np.nonzero(_ahead(scene, point, normal, v) | _beside(scene, point))
    return np.stack([boundary.body[edges[e]], point[e], soft])


def _ahead(scene: Scene, point: Ints, normal: Array, v: Array) -> Bools:
    """Whether points with outward normals (2, k) approach the bounding boxes of deformable bodies, (k, bodies)."""
    x, start = scene.initial_positions, scene.offsets[:-1]
    low, high = (f.reduceat(x, start, axis=1) for f in (np.minimum, np.maximum))
    u = v[:, point, None] - (np.add.reduceat(v, start, axis=1) / np.diff(scene.offsets))[:, None]
    to = np.stack([side[:, None] - x[:, point, None] for side in (low, high)]) / np.where(u == 0.0, 1e-300, u)
    enters, leaves = to.min(axis=0).max(axis=0), to.max(axis=0).min(axis=0)
    faces = np.einsum("ik,ikb->kb", normal, u) > 0.0
    return np.asarray((enters <= leaves) & (leaves > 0.0) & faces & scene.deformable)


def _beside(scene: Scene, point: Ints) -> Bools:
    """Whether a deformable body has the nearest point to points (k,), within a cell, (k, bodies)."""
    x, deformable = scene.initial_positions, np.flatnonzero(scene.deformable[scene.owner])
    distance, nearest = (np.asarray(a) for a in cKDTree(x[:, deformable].T).query(x[:, point].T))
    bodies = np.arange(len(scene.bodies))
    return np.asarray((distance[:, None] < scene.cell) & (scene.owner[deformable[nearest]][:, None] == bodies))
