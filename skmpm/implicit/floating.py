"""Quasi-static steps: what moves bodies that neither inertia nor supports hold, and how far."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.contact import Constraints
from skmpm.contact.constraints import component_along
from skmpm.implicit.contact_problem import ContactProblem
from skmpm.implicit.equilibrium import SHARE, Joints, mechanism, motion
from skmpm.implicit.errors import NotConverged
from skmpm.implicit.residual import Increment

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

FALL_STEP = 0.2  # [cells] between two looks for contacts, which are found within 0.25
MAX_FALL = 1.0  # [cells] that bodies may fall before they are said to have no equilibrium
MAX_ITERATION_MOTION = (
    1.0  # [cells] in one iteration beyond what is prescribed: contacts are found that are less than a cell deep
)
TRAVEL = 4.0  # [cells] the same in one step; results that move by more than one are refused by `simulate.acceptance`
CLOSE = 0.08  # [cells] by which contacts may be wider than the closest of two bodies where words are found
NO_SLIP_FRICTION = 100.0  # friction with which nothing slides
NEGLIGIBLE = 1e-3  # of a body's forces: what may be left along its rigid motions where these are neutral
MAX_FALL_STEPS = 50  # for contacts of bodies that fall
CORNER = np.cos(np.deg2rad(50.0))  # of the angle by which a boundary turns in a corner, as in `outline`


@dataclass(frozen=True)
class Floating:
    """The bodies of a quasi-static step that nothing but contact holds, as rigid bodies."""

    bodies: Ints  # (n,)
    motions: sp.csr_array  # (2 nodes, 3 n) velocities for vx, vy and spin times radius, body after body
    radius: Array  # (n,) of gyration [m]
    mean: sp.csr_array  # (3 n, 2 nodes) the rigid motions nearest to a velocity, by mass
    stopped: sp.csr_array  # (m, 3 n) combinations that supports stop
    free: sp.csr_array  # (3 n, 3 n) projects motions on those that supports leave free
    limits: Array  # (2, 2) smallest and largest prescribed displacement near by in the step [m]
    load: Array  # (3 n,) of gravity and loads [N/m]

    @property
    def loaded(self) -> bool:
        """Whether anything pulls at the bodies."""
        return bool(self.load.any())

    def beyond(self, displacement: Array) -> Array:
        """How far bodies move, and turn at their radius, beyond what is prescribed, (3, n) [m]; (2 nodes,) given."""
        moved = (self.mean @ displacement).reshape(-1, 3).T
        low, high = self.limits
        turn = np.maximum(np.abs(moved[2]) - float(np.hypot(*(high - low))), 0.0)
        clipped = np.clip(moved[:2], low[:, None], high[:, None])
        return np.stack([*(moved[:2] - clipped), np.sign(moved[2]) * turn])


def floating(increment: Increment, constraints: Constraints) -> Floating:
    """The floating bodies of a step, spins about their centres of mass at its start.

    `rows` are the contacts where nothing moves but what is prescribed.
    """
    assembly, bodies = increment.bulk.assembly, np.flatnonzero(increment.floats)
    grid, weight = increment.grid, assembly.lumped[::2]
    x = grid.position + increment.start.reshape(-1, 2).T
    arm = x - grid.means(x, weight)[:, grid.node_body]
    radius = np.sqrt(grid.means((arm**2).sum(axis=0)[None], weight)[0])
    turn = np.stack([-arm[1], arm[0]]) / np.maximum(radius, 1e-300)[grid.node_body]
    place = _places(increment, bodies)
    node = np.flatnonzero(place[grid.node_body] >= 0)
    column, one = 3 * place[grid.node_body[node]], np.ones(node.size)
    row = np.concatenate([2 * node, 2 * node + 1, 2 * node, 2 * node + 1])
    columns = np.concatenate([column, column + 1, column + 2, column + 2])
    values = np.concatenate([one, one, turn[0, node], turn[1, node]])
    motions = sp.csr_array((values, (row, columns)), shape=(2 * grid.nodes, 3 * bodies.size))
    weighed = sp.csr_array(motions.T @ sp.diags_array(assembly.lumped))
    mean = sp.csr_array(sp.diags_array(1.0 / (weighed @ motions).diagonal()) @ weighed)
    speeds = _prescribed(increment, constraints, place)
    load, stopped = np.asarray(motions.T @ increment.force), increment.stopped(motions)
    return Floating(bodies, motions, radius[bodies], mean, stopped, _free(stopped), increment.dt * speeds, load)


def _places(increment: Increment, bodies: Ints) -> Ints:
    """The number of every body among the floating ones, -1 if it is none; the last is that of walls."""
    place = np.full(increment.grid.bodies + 1, -1)
    place[bodies] = np.arange(bodies.size)
    return place


def _free(stopped: sp.csr_array) -> sp.csr_array:
    """Projects rigid motions (3 n,) of every body on those that rows (m, 3 n) do not stop."""
    gram = sp.csr_array(stopped.T @ stopped)
    blocks = [gram[i : i + 3, i : i + 3].toarray() for i in range(0, gram.shape[0], 3)]
    bases = [null_space(block) for block in blocks]
    return sp.csr_array(sp.block_diag([basis @ basis.T for basis in bases], format="csr"))


def null_space(gram: Array) -> Array:
    """An orthonormal basis (3, k) of the rigid motions q that rows G leave free, from G'G (3, 3)."""
    values, vectors = np.linalg.eigh(gram)
    return np.asarray(vectors[:, values <= 1e-10 * max(float(values[-1]), 1.0)])


def _prescribed(increment: Increment, constraints: Constraints, place: Ints) -> Array:
    """Smallest and largest prescribed velocity of supports and of what contacts lie on, or rest, (2, 2) [m/s]."""
    fixed = place[np.maximum(constraints.bodies, -1)] < 0
    velocity = np.where(fixed[1], -constraints.prescribed, constraints.prescribed)[:, fixed.any(axis=0)]
    every = np.concatenate([np.zeros((2, 1)), velocity, increment.prescribed.reshape(-1, 2).T], axis=1)
    return np.stack([every.min(axis=1), every.max(axis=1)])


def joints(increment: Increment, bodies: Floating, constraints: Constraints) -> Joints:
    """Contacts and supports as those of rigid bodies."""
    place = _places(increment, bodies.bodies)
    by_places = sp.csr_array(sp.kron(constraints.base, np.eye(2), format="csr") @ bodies.motions)
    normal, tangent = (
        sp.csr_array(component_along(constraints.difference, d) @ by_places)
        for d in (constraints.normal, constraints.tangent)
    )
    return Joints(place[np.maximum(constraints.bodies, -1)], normal, tangent, constraints.friction, bodies.stopped)


def landed(increment: Increment, contact: ContactProblem, bodies: Floating, constraints: Constraints) -> Array | None:
    """The velocity (2 nodes,) that takes bodies to contacts which can carry their loads, None if they are there.

    `rows` are the contacts where nothing moves but what is prescribed. Bodies follow the mechanism until they have
    new contacts, as rigid ones. Every contact within reach counts.

    Raises
    ------
    NotConverged
        where no contacts can carry the loads, not even after a fall of a cell
    """
    w = increment.prescribed_alone()
    for looks in range(MAX_FALL_STEPS if bodies.loaded else 0):
        constraints = contact.linearise(w) if looks else constraints
        joined = joints(increment, bodies, constraints)
        q = None if _carried(contact, bodies, constraints, joined) else mechanism(bodies.load, joined)
        if q is None:
            return None if looks == 0 else w
        if float(np.abs(bodies.beyond(increment.dt * w)).max()) > MAX_FALL * increment.grid.cell:
            found = no_equilibrium(increment, bodies, constraints)
            if found is not None:
                raise found
        velocity = bodies.motions @ q
        w = w + FALL_STEP * increment.grid.cell / increment.dt / float(np.abs(velocity).max()) * velocity
    return None


def _carried(contact: ContactProblem, bodies: Floating, constraints: Constraints, joined: Joints) -> bool:
    """Whether the contact forces of the step before carry the loads: then no programme need look for others."""
    if contact.key.size == 0:
        return False
    normal, tangential = constraints.forces(constraints.impulses(contact.key, contact.force, 1.0), 1.0)
    left = bodies.load + joined.normal.T @ normal + joined.tangent.T @ tangential
    size = np.abs(bodies.load.reshape(-1, 3)).max(axis=1)
    return bool((np.abs(left) <= SHARE * np.repeat(size, 3)).all())


def check_near(increment: Increment, bodies: Floating, w: Array) -> None:
    """Raise NotConverged where a body has moved by more than `TRAVEL` beyond what is prescribed."""
    beyond = np.abs(bodies.beyond(increment.dt * w)).max(axis=0) / increment.grid.cell
    b = int(np.argmax(beyond))
    if beyond[b] > TRAVEL:
        moves = bool(bodies.limits.any())  # else a smaller dt is the same step
        raise NotConverged(
            f"body {bodies.bodies[b]}",
            f"it moves by {beyond[b]:.2g} cells without finding an equilibrium",
            f"{'use a smaller dt, ' if moves else ''}add a Support or friction, apply loads in steps, or use inertia",
            retryable=moves,
        )


def near(
    increment: Increment, bodies: Floating, w: Array, direction: Array, stride: float = MAX_ITERATION_MOTION
) -> Array:
    """The direction, less what takes bodies `stride` cells farther beyond what is prescribed than they are at w.

    Only motions that supports leave free are shortened: others would move the supports, and what they carry holds.
    """
    before, after = (bodies.beyond(increment.dt * v) for v in (w, w + direction))
    allowed = np.abs(before) + stride * increment.grid.cell
    excess = after - np.clip(after, -allowed, allowed)
    if not excess.any():
        return direction
    return np.asarray(direction - bodies.motions @ (bodies.free @ excess.T.ravel()) / increment.dt)


def negligible(increment: Increment, contact: ContactProblem, bodies: Floating, resultants: Array) -> bool:
    """Whether resultants (3 n,) [kg/s] are a small share of the forces on every body."""
    return bool((np.abs(resultants) <= NEGLIGIBLE * np.repeat(forces_on(increment, contact, bodies), 3)).all())


def turned(increment: Increment, contact: ContactProblem, bodies: Floating, w: Array) -> Array:
    """Moment that kept contact normals make on every body, over its radius of gyration and forces on it, (n,).

    Beyond `newton_tol` of the largest forces on any body, which the balance of moments may lack anyway.
    """
    place, couples = _places(increment, bodies.bodies), contact.couples(w)
    owner = place[np.maximum(contact.constraints.bodies, -1)]
    both = sum(np.bincount(own[own >= 0], couples[own >= 0], bodies.bodies.size) for own in owner)
    forces = forces_on(increment, contact, bodies)
    made = np.abs(both) / bodies.radius - increment.scheme.newton_tol * forces.max()
    return np.asarray(np.maximum(made, 0.0) / np.maximum(forces, 1e-300))


def forces_on(increment: Increment, contact: ContactProblem, bodies: Floating) -> Array:
    """Half the sum of all contact forces and loads on every floating body, times the step, (n,) [kg/s]."""
    constraints, place = contact.constraints, _places(increment, bodies.bodies)
    size = increment.dt * np.hypot(*constraints.forces(contact.r, increment.dt))
    load = increment.dt * np.hypot(*bodies.load.reshape(-1, 3).T[:2])
    owner = place[np.maximum(constraints.bodies, -1)]
    every = [np.bincount(own[own >= 0], size[own >= 0], bodies.bodies.size) for own in owner]
    return np.asarray(0.5 * (load + every[0] + every[1]))


def explained(increment: Increment, contact: ContactProblem, bodies: Floating, error: NotConverged) -> NotConverged:
    """Why no equilibrium was found: what the contacts of the last iteration cannot carry, if so, else the error."""
    if not bodies.loaded or not hasattr(contact, "constraints"):
        return error
    found = no_equilibrium(increment, bodies, contact.constraints, "no equilibrium was found")
    if found is None:
        return error
    found.retryable = bool(bodies.limits.any())  # where nothing prescribed moves, a smaller dt is the same step
    return found


def no_equilibrium(
    increment: Increment, bodies: Floating, constraints: Constraints, what: str = "there is no equilibrium"
) -> NotConverged | None:
    """What loads do where contacts cannot carry them, by those that are closest; None where these can."""
    closest = _closest(constraints, CLOSE * increment.grid.cell)
    joined = joints(increment, bodies, closest)
    rough = mechanism(bodies.load, replace(joined, friction=np.full(closest.size, NO_SLIP_FRICTION)), few=True)
    q = mechanism(bodies.load, joined, few=True) if rough is None else rough
    if q is None:
        return None
    found = motion(q, joined)
    b, verb, remedy = int(bodies.bodies[found.body]), found.verb, "" if rough is not None else " or friction"
    if verb == "turns":
        verb = "topples" if _corner(increment, closest, found.contact, b) else "rolls"
    where = "" if found.contact < 0 else f" {_on(closest, found.contact, b, increment.grid.cell)}"
    force = bodies.load[3 * found.body : 3 * found.body + 2]
    return NotConverged(
        f"body {b}",
        f"{what}: it {verb}{where}; its load is ({force[0]:.3g}, {force[1]:.3g}) N/m",
        f"add a Support, a wall{remedy}, or use inertia",
        retryable=False,
    )


def _closest(constraints: Constraints, margin: float) -> Constraints:
    """Of the contacts of every two bodies the closest, and those that are wider by no more than a margin [m]."""
    pairs, pair = np.unique(constraints.bodies, axis=1, return_inverse=True)
    smallest = np.full(pairs.shape[1], np.inf)
    np.minimum.at(smallest, pair.ravel(), constraints.gap)
    return constraints.among(constraints.gap <= np.maximum(smallest[pair.ravel()], 0.0) + margin)


def _on(constraints: Constraints, contact: int, body: int, cell: float) -> str:
    """What a body moves on, as text."""
    one, other = constraints.bodies[:, contact].tolist()
    other = one if other == body else other
    x, y = cell * np.round(constraints.x[:, contact] / cell, 6) + 0.0  # no -2e-17
    return f"on {f'wall {-1 - other}' if other < 0 else f'body {other}'} at ({x:.4g}, {y:.4g}) m"


def _corner(increment: Increment, constraints: Constraints, contact: int, body: int) -> bool:
    """Whether a body touches with a corner: the boundary point that is nearest to the contact is one."""
    grid = increment.grid
    known = np.flatnonzero(np.diff(constraints.base.indptr) > 0)
    own = known[grid.node_body[constraints.base.indices[constraints.base.indptr[known]]] == body]
    x = (constraints.base[own] @ (grid.position + increment.start.reshape(-1, 2).T).T).T
    nearest = int(np.argmin(np.hypot(*(x - constraints.x[:, contact, None]))))
    a, b, c = x[:, [nearest - 1, nearest, (nearest + 1) % own.size]].T
    ahead, back = c - b, b - a
    return bool(float(ahead @ back) < CORNER * float(np.hypot(*ahead) * np.hypot(*back)))
