"""Whether rigid bodies at the positions of the scene's are in equilibrium: a linear programme in contact forces.

It knows no solver of the library, no elasticity and no stability: forces within Coulomb's cones at what nearly
touches, and of the supports, which balance weight and loads of every body.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np
import scipy.sparse as sp
from balance import cross, given_forces
from geometry import edges_of, loops_of
from scipy.optimize import linprog

import skmpm

NEAR = 0.05  # [cells] within which things touch
ENOUGH = 1e-2  # of the size of the loads that may be left: polygons turn normals by half an edge


def missing(scene: skmpm.Scene, state: skmpm.State, *, near: float = NEAR, t: float = 0.0) -> float:
    """The least that any forces leave of the loads, over the size of the loads: 0 where there is an equilibrium."""
    given = given_forces(scene, state.mass, t)
    body, bodies = state.body, len(scene.bodies)
    centre = np.stack([np.bincount(body, state.mass * x) for x in state.x]) / np.bincount(body, state.mass)
    arm, reach = state.x - centre[:, body], float(np.ptp(scene.initial_positions, axis=1).max())
    loads = np.concatenate([np.bincount(body, f, bodies) for f in (*given, cross(arm, given) / reach)])
    size = float(np.hypot(*given).sum())
    if size == 0.0:
        return 0.0
    columns, lower, cones = _columns(scene, state, near * scene.cell, centre, reach)
    if columns.shape[1] == 0:
        return float(np.abs(loads).max()) / size
    # Minimise s with |columns f + loads| <= s in every row.
    rows = sp.vstack(
        [
            sp.hstack([columns, -np.ones((3 * bodies, 1))]),
            sp.hstack([-columns, -np.ones((3 * bodies, 1))]),
            sp.hstack([cones, np.zeros((cones.shape[0], 1))]),
        ]
    )
    bound = np.concatenate([-loads, loads, np.zeros(cones.shape[0])]) / size
    target = np.concatenate([np.zeros(columns.shape[1]), [1.0]])
    limits = [*((low, None) for low in lower), (0.0, None)]
    found = linprog(target, A_ub=rows.tocsc(), b_ub=bound, bounds=limits)
    return float(found.fun) if found.status == 0 else float("nan")


def has_equilibrium(scene: skmpm.Scene, state: skmpm.State, *, near: float = NEAR) -> bool:
    """Whether rigid bodies could stand where the state has them."""
    return missing(scene, state, near=near) < ENOUGH


def contact(scene: skmpm.Scene, state: skmpm.State, near: float) -> list[tuple[int, int, np.ndarray, np.ndarray]]:
    """(first body, second or -1 - wall, place, normal on the first) of boundary points closer than `near` [m]."""
    found = []
    for a, _ in enumerate(scene.bodies):
        points = np.concatenate([np.zeros((2, 0)), *loops_of(scene, state, a)], axis=1)
        for w, wall in enumerate(scene.walls):
            normal = np.asarray(wall.normal, dtype=float)
            close = normal @ (points - state.walls[w][:, None]) < near
            found += [(a, -1 - w, x, normal) for x in points[:, close].T]
    for a, b in permutations(range(len(scene.bodies)), 2):
        points, others = (np.concatenate([np.zeros((2, 0)), *loops_of(scene, state, k)], axis=1) for k in (a, b))
        if points.size == 0 or others.size == 0:
            continue
        start, end = edges_of(loops_of(scene, state, b))
        along = end - start
        share = ((points[:, None] - start[:, :, None]) * along[:, :, None]).sum(axis=0) / np.square(along).sum(
            axis=0
        )[:, None]
        apart = points[:, None] - start[:, :, None] - np.clip(share, 0.0, 1.0) * along[:, :, None]
        distance = np.hypot(*apart)
        edge = distance.argmin(axis=0)
        for k in np.flatnonzero(distance.min(axis=0) < near):
            normal = np.array([along[1, edge[k]], -along[0, edge[k]]])
            found.append((a, b, points[:, k], normal / np.hypot(*normal)))
    return found


def _columns(
    scene: skmpm.Scene, state: skmpm.State, near: float, centre: np.ndarray, reach: float
) -> tuple[sp.csc_array, list[float | None], sp.csr_array]:
    """What unit forces give in the balances, the lower bounds of the forces, and the cones' rows |t| <= mu n."""
    bodies, data, lower, cones = len(scene.bodies), [], [], []

    def column(ends: list[tuple[int, float]], x: np.ndarray, direction: np.ndarray) -> np.ndarray:
        values = np.zeros(3 * bodies)
        for b, sign in ends:
            values[[b, bodies + b]] = sign * direction
            values[2 * bodies + b] = sign * cross(x - centre[:, b], direction) / reach
        return values

    for a, b, x, n in contact(scene, state, near):
        ends = [(a, 1.0)] if b < 0 else [(a, 1.0), (b, -1.0)]
        mu = scene.friction if b >= 0 else scene.walls[-1 - b].friction
        cones += [(len(data), sign, mu) for sign in (1.0, -1.0)]
        data += [column(ends, x, n), column(ends, x, np.array([-n[1], n[0]]))]
        lower += [0.0, None]
    for support, place in zip(scene.supports, scene.supported, strict=True):
        velocity = support.velocity(0.0) if callable(support.velocity) else support.velocity
        for axis in (k for k in range(2) if velocity[k] is not None):
            for p in place.points:
                data.append(column([(int(state.body[p]), 1.0)], state.x[:, p], np.eye(2)[axis]))
                lower.append(None)
    matrix = np.zeros((len(cones), len(data)))
    for row, (k, sign, mu) in enumerate(cones):
        matrix[row, k], matrix[row, k + 1] = -mu, sign
    stacked = np.stack(data, axis=1) if data else np.zeros((3 * bodies, 0))
    return sp.csc_array(stacked), lower, sp.csr_array(matrix)
