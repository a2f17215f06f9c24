"""What is said of static steps that fail: of a body that moves on and on, and of sharp edges of rigid bodies.

Stress is unbounded at the latter, as those of a flat punch, which indent deformable bodies. In plane strain a point
of the boundary is an edge of the body.
"""

from __future__ import annotations

import numpy as np

from skmpm.arrays import Array
from skmpm.contact import Constraints
from skmpm.outline.curve import CORNER_COSINE
from skmpm.scene import Contacts, Scene
from skmpm.step.equations import Increment
from skmpm.step.errors import StepRejected, place
from skmpm.step.newton import Solution
from skmpm.step.rotation import RigidMotion

# [cells] Radius of edges that indented 13 of 14 blocks by 40 % of their height without inertia (test_punch).
MIN_EDGE_RADIUS = 0.5


def travel(increment: Increment, motion: RigidMotion, velocity: Array) -> Array:
    """How far surfaces move by the rigid motions of bodies at nodal velocities (2 nodes,), (bodies,) [cells]."""
    return increment.dt / increment.grid.cell * motion.at_surface(motion.velocity(velocity))


def no_equilibrium(
    increment: Increment, motion: RigidMotion, solution: Solution, solves: int, body: int, share: float
) -> StepRejected:
    """The error that says how a body moves after some solves, a `share` of the forces on it out of balance."""
    step = increment.on_nodes(solution.w) - increment.prescribed_only()
    moved = travel(increment, motion, step)[body]
    verb, remedy = _motion(increment, motion, solution, body)
    problem = (
        f"no equilibrium was found: it {verb}, by {moved:.2g} cells in {solves} solves so far, and"
        f" {100.0 * min(share, 1.0):.3g} % of the forces on it are out of balance"
    )
    return StepRejected(f"body {body}", problem, remedy, retryable=increment.depends_on_dt)


def _motion(increment: Increment, motion: RigidMotion, solution: Solution, body: int) -> tuple[str, str]:
    """How a body moves, on or from what, and the remedy."""
    contact, step = solution.contact, increment.on_nodes(solution.w - increment.v0)
    remedy = "add a Support, a wall, or use inertia"
    *along, turning = motion.velocity(step)[:, body]
    free = "turns" if abs(turning) > float(np.hypot(*along)) else "falls"
    if contact is None or contact.constraints.size == 0:
        return free, remedy
    constraints = contact.constraints
    own = np.flatnonzero((constraints.bodies == body).any(axis=0))
    normal, tangential = constraints.forces(contact.r, increment.dt)
    pressed = own[normal[own] > 0.0] if own.size else own
    if pressed.size == 0 or normal[own].sum() < 0.0:  # hangs by cohesion
        return ("separates" if (normal[own] < 0.0).any() else free), remedy
    corners = [each for each in pressed.tolist() if at_corner(increment, constraints, each)]
    most = int(pressed[np.argmax(normal[pressed])])
    slides = abs(tangential[most]) >= (1.0 - 1e-6) * constraints.friction[most] * normal[most]
    if slides or np.unique(constraints.bodies[:, pressed]).size > 2:  # friction does not keep it from rolling on one
        remedy = "add a Support, a wall or friction, or use inertia"
    if slides:
        verb = "slides"
    else:
        verb = "topples" if corners else "rolls"
        most = max(corners, key=lambda each: normal[each], default=most)
    at = place(constraints.x[:, most], increment.grid.cell)
    return f"{verb} on {_other(constraints, most, body)} at {at}", remedy


def _other(constraints: Constraints, contact: int, body: int) -> str:
    """What a body touches at a contact, as text."""
    first, second = constraints.bodies[:, contact].tolist()
    other = first if second == body else second
    return f"wall {-1 - other}" if other < 0 else f"body {other}"


def at_corner(increment: Increment, constraints: Constraints, contact: int) -> bool:
    """Whether the boundary point of a body that is nearest to the contact is a corner, on either side."""
    return any(
        _corner_of(increment, constraints, contact, body)
        for body in constraints.bodies[:, contact].tolist()
        if body >= 0
    )


def _corner_of(increment: Increment, constraints: Constraints, contact: int, body: int) -> bool:
    grid = increment.grid
    deformable = np.flatnonzero(np.diff(constraints.base.indptr) > 0)
    owner = grid.node_body[constraints.base.indices[constraints.base.indptr[deformable]]]
    of_body = deformable[owner == body]
    if of_body.size == 0:
        return False
    x = (constraints.base[of_body] @ grid.at(increment.displacement_at_start).T).T
    nearest = int(np.argmin(np.hypot(*(x - constraints.x[:, contact, None]))))
    a, b, c = x[:, [nearest - 1, nearest, (nearest + 1) % of_body.size]].T
    ahead, back = c - b, b - a
    return bool(float(ahead @ back) < CORNER_COSINE * float(np.hypot(*ahead) * np.hypot(*back)))


def round_the_edge(scene: Scene, contacts: Contacts) -> str:
    """What helps against the rigid edge that carries the largest contact force, as text; empty if none does.

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
        f"use inertia, or round the edge of body {first} at ({x:.6g}, {y:.6g}) m by"
        f" {MIN_EDGE_RADIUS * scene.cell:.4g} m: on it acts the largest contact force, stress is unbounded there, and"
        f" body {second} may snap through"
    )
