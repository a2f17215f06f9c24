"""Forces and moments on every body, summed from a state, compared with the change of its momentum.

Nothing here calls the solver: weights and loads come from the scene, contact forces from the list of contacts, the
forces on walls and supports from the state. Forces of a step act at its end, so arms are those of the new positions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

import skmpm
import skmpm.outline

ROUNDING = 1e-11  # strain: gaps of 1e-16 of the positions in cells a tenth of them, summed over some hundred nodes


@dataclass(frozen=True)
class Balance:
    """What is left of the balances of one step, and the sizes of the terms that must cancel."""

    total: float  # of all bodies with walls and supports: |sum of forces - change of momentum / dt| [N/m]
    total_size: float  # [N/m]
    force: np.ndarray  # (bodies,) [N/m]
    force_size: np.ndarray  # (bodies,) [N/m]
    moment: np.ndarray  # (bodies,) about the centre of mass [N]; nan where a support holds the body
    moment_size: np.ndarray  # (bodies,) [N]
    elastic: np.ndarray  # (bodies,) sum of |stress| volume / cell: the size of nodal forces that cancel [N/m]
    turned: (
        np.ndarray
    )  # (bodies,) largest |F - I| of linear materials, whose stress has no moment about places at t = 0
    rounding: np.ndarray  # (bodies,) forces that rounding of positions makes [N/m]


def cartesian(contacts: skmpm.scene.Contacts) -> np.ndarray:
    """Forces (2, k) on the first bodies, in x and y."""
    tangent = np.stack([-contacts.normal[1], contacts.normal[0]])
    return contacts.force[0] * contacts.normal + contacts.force[1] * tangent


def value_at(given: object, t: float) -> np.ndarray:
    """Of a constant or a function of time, None as zero."""
    value = given(t) if callable(given) else given
    return np.array([0.0 if v is None else float(v) for v in value])


def given_forces(scene: skmpm.Scene, mass: np.ndarray, t: float) -> np.ndarray:
    """Weight and loads of all points at time t, (2, n) [N/m]."""
    gravity, X = scene.gravity, scene.initial_positions
    force = mass * (gravity(X, t) if callable(gravity) else np.array(gravity, dtype=float)[:, None])
    for load, place in zip(scene.loads, scene.loaded, strict=True):
        force[:, place.points] += value_at(load.force, t)[:, None] * place.share
    return force


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of vectors in the plane."""
    return a[0] * b[1] - a[1] * b[0]


def held_bodies(scene: skmpm.Scene, state: skmpm.State) -> list[np.ndarray]:
    """The bodies that each support holds."""
    return [np.unique(state.body[place.points]) for place in scene.supported]


def momentum_gained(case, old: skmpm.State, new: skmpm.State) -> np.ndarray:
    """Change of the momentum of the points, (2, n) [kg/s]; none without inertia."""
    return new.mass * (new.v - old.v) * float(case.scheme.inertia)


def spin_gained(case, old: skmpm.State, new: skmpm.State) -> np.ndarray:
    """What the affine velocities of APIC gain in angular momentum, (n,).

    A point stands for mass at the nodes X_i of its cell, at x + F (X_i - X) with the velocity v + C (X_i - X):
    sum_i N_i (X_i - X)(X_i - X)' = h^2 diag(s (1 - s)) with the place s of the point in its cell.
    """
    if not case.scheme.inertia:
        return np.zeros(new.mass.size)
    h = case.scene.cell
    s = new.x_anchor / h - np.floor(new.x_anchor / h)
    D = h**2 * s * (1.0 - s)
    F = np.einsum("abn,bcn->acn", new.F, np.moveaxis(np.linalg.inv(np.moveaxis(new.F_anchor, -1, 0)), 0, -1))
    tensor = np.einsum("acn,cn,bcn->abn", F, D, new.C - old.C)
    return new.mass * (tensor[0, 1] - tensor[1, 0])


def balance_of(case, old: skmpm.State, new: skmpm.State) -> Balance:
    """Of one step from `old` to `new`."""
    scene, bodies, body, dt = case.scene, len(case.scene.bodies), new.body, new.t - old.t
    theta, contacts = case.scheme.theta, new.contacts
    given = given_forces(scene, new.mass, old.t + theta * dt)
    gained, pushed = momentum_gained(case, old, new) / dt, cartesian(new.contacts)
    before = np.abs(new.mass * old.v).sum(axis=0) / dt * float(case.scheme.inertia)

    def sums(index: np.ndarray, values: np.ndarray) -> np.ndarray:
        return np.bincount(index, values, bodies)

    second = contacts.bodies[1] >= 0
    ends = [(contacts.bodies[0], pushed, contacts.x)]
    ends.append((contacts.bodies[1, second], -pushed[:, second], contacts.x[:, second]))
    left = np.stack([sums(body, f) for f in given - gained])
    left += sum(np.stack([sums(b, component) for component in f]) for b, f, _ in ends)
    size = sums(body, np.abs(given).sum(axis=0) + np.abs(gained).sum(axis=0) + before)
    size += sum(sums(b, np.abs(f).sum(axis=0)) for b, f, _ in ends)
    free = np.ones(bodies, dtype=bool)
    for its, force in zip(held_bodies(scene, new), new.support_force, strict=True):
        free[its] = False
        left[:, its] -= force[:, None] if its.size == 1 else np.nan
        size[its] += np.abs(force).sum()

    centre = np.stack([sums(body, new.mass * x) for x in new.x]) / sums(body, new.mass)
    arm = new.x - centre[:, body]
    spin = spin_gained(case, old, new) / dt
    moment = sums(body, cross(arm, given - gained) - spin)
    drift = np.stack([sums(body, new.mass * v) for v in old.v]) / sums(body, new.mass)
    swirl = new.mass * np.hypot(*(old.v - drift[:, body])) / dt * float(case.scheme.inertia)
    moment_size = sums(body, np.hypot(*arm) * (np.hypot(*given) + np.hypot(*gained) + swirl) + np.abs(spin))
    for b, f, x in ends:
        r = x - centre[:, b]
        moment += sums(b, cross(r, f))
        moment_size += sums(b, np.hypot(*r) * np.hypot(*f))

    outer = new.wall_force.sum(axis=0) + new.support_force.sum(axis=0)
    stress = np.sqrt(np.square(new.stress).sum(axis=(0, 1)))
    change = np.sqrt(np.square(new.F - np.eye(2)[:, :, None]).sum(axis=(0, 1)))
    linear = [isinstance(b.material, skmpm.LinearElastic) for b in scene.bodies]
    return Balance(
        total=float(np.abs((given - gained).sum(axis=1) - outer).max()),
        total_size=float(size.sum()),
        force=np.abs(left).max(axis=0),
        force_size=size,
        moment=np.where(free, np.abs(moment), np.nan),
        moment_size=moment_size,
        elastic=sums(body, stress * new.weight) / scene.cell,
        turned=np.maximum.reduceat(change, scene.offsets[:-1]) * linear,
        rounding=ROUNDING * stiffness(scene) * float(np.abs(new.x).max()),
    )


def stiffness(scene: skmpm.Scene) -> np.ndarray:
    """Moduli of pressure waves, (bodies,) [Pa]; zero for rigid bodies."""
    materials = [body.material for body in scene.bodies]
    soft = [None if isinstance(m, skmpm.Rigid) else (m.E, m.nu) for m in materials]
    return np.array([0.0 if s is None else s[0] * (1 - s[1]) / ((1 + s[1]) * (1 - 2 * s[1])) for s in soft])


def slip_on_walls(scene: skmpm.Scene, old: skmpm.State, new: skmpm.State) -> tuple[np.ndarray, np.ndarray]:
    """Which contacts are of points on walls, and how far these slide in the step, (index, slip) [m]."""
    contacts = new.contacts
    index = np.flatnonzero((contacts.bodies[1] < 0) & (contacts.point >= 0))
    wall, normal = -1 - contacts.bodies[1, index], contacts.normal[:, index]
    moved = displacements(scene, old, new, index) - (new.walls - old.walls)[wall].T
    return index, normal[0] * moved[1] - normal[1] * moved[0]


def displacements(scene: skmpm.Scene, old: skmpm.State, new: skmpm.State, index: np.ndarray) -> np.ndarray:
    """Displacements (2, k) [m] in the step of the places on smooth outlines where contacts of the new state act."""
    boundary, contacts = scene.outlines, new.contacts
    number = np.zeros(new.body.size, dtype=int)
    number[boundary.point] = np.arange(boundary.size)
    curve = skmpm.outline.curve(boundary, scene.initial_positions[:, boundary.point])
    before, after = (curve.through(state.x[:, boundary.point]) for state in (old, new))
    segment = number[contacts.point[index]]
    segment, s = after.project(contacts.x[:, index], segment, np.zeros(index.size))
    return after.at(segment, s) - before.at(segment, s)


def behind_walls(scene: skmpm.Scene, state: skmpm.State) -> np.ndarray:
    """How far boundary points lie behind walls, (walls, m) [m]; minus infinity where a support moves them there."""
    x = state.x[:, scene.outlines.point]
    depth = np.full((len(scene.walls), x.shape[1]), -np.inf)
    for w, wall in enumerate(scene.walls):
        normal = np.asarray(wall.normal, dtype=float)
        free = np.ones(state.body.size, dtype=bool)
        for support, place in zip(scene.supports, scene.supported, strict=True):
            velocity = support.velocity(0.0) if callable(support.velocity) else support.velocity
            held = np.array([v is not None for v in velocity])
            if np.abs(normal[held]).max(initial=0.0) > 1e-9:  # cells share what is prescribed
                near, _ = cKDTree(scene.initial_positions[:, place.points].T).query(scene.initial_positions.T)
                free &= near > 2.0 * scene.cell
        own = free[scene.outlines.point]
        depth[w, own] = -(normal @ (x - state.walls[w][:, None]))[own]
    return depth


def supports_missed(scene: skmpm.Scene, old: skmpm.State, new: skmpm.State) -> float:
    """How far the mean displacement of a support's points is from what is prescribed, at most [m]."""
    dt, missed = new.t - old.t, 0.0
    for support, place in zip(scene.supports, scene.supported, strict=True):
        velocity = support.velocity(0.5 * (old.t + new.t)) if callable(support.velocity) else support.velocity
        moved = (new.x - old.x)[:, place.points]
        for component, wanted in zip(moved, velocity, strict=True):
            if wanted is not None:
                missed = max(missed, abs(float(component.mean()) - dt * float(wanted)))
    return missed


def travel(scene: skmpm.Scene, old: skmpm.State, new: skmpm.State) -> float:
    """The longest way of a point in a step, over the diameter of the largest body."""
    sizes = [float(np.hypot(*np.ptp(body.points.x, axis=1))) for body in scene.bodies]
    return float(np.hypot(*(new.x - old.x)).max()) / max(sizes)
