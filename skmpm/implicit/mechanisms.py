"""Quasi-static steps without equilibrium: motion along collapse mechanisms, and the error that describes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skmpm.contact import Constraints
from skmpm.implicit.contact_problem import ContactIterate, ContactProblem
from skmpm.implicit.equilibrium import LOAD_TOLERANCE, RigidContacts, describe, mechanism
from skmpm.implicit.errors import StepRejected
from skmpm.implicit.floating import FloatingBodies, rigid_contacts
from skmpm.implicit.residual import Increment
from skmpm.implicit.unbalanced_motion import at_corner

Array = NDArray[np.float64]

DETECTION_INTERVAL = 0.2  # [cells] of motion between contact detections, which find contacts within 0.25 cells
MAX_FALL = 1.0  # [cells] of motion along mechanisms before a body is reported to have no equilibrium
MAX_DETECTIONS = 50  # along mechanisms
GAP_MARGIN = 0.08  # [cells] over the smallest gap of two bodies: contacts that the error message considers
NO_SLIP_FRICTION = 100.0  # Coulomb coefficient with which no contact slides


def rigid_initial_guess(
    increment: Increment, contact: ContactProblem, bodies: FloatingBodies, constraints: Constraints
) -> Array | None:
    """The velocity (2 nodes,) that moves bodies along a collapse mechanism to contacts which can carry their loads.

    It is None if there are no loads, if the contacts of the prescribed motion alone, `constraints`, can carry them,
    and if `MAX_DETECTIONS` steps along the mechanism do not suffice. Bodies move as rigid bodies until they meet
    further contacts.

    Raises
    ------
    StepRejected
        if the contacts cannot carry the loads after a motion of `MAX_FALL`
    """
    w, visited = increment.prescribed_only(), list[Constraints]()
    for detections in range(MAX_DETECTIONS if bodies.loaded else 0):
        constraints = contact.linearise(w) if detections else constraints
        contacts = rigid_contacts(increment, bodies, constraints)
        carried = _carried(contact, bodies, constraints, contacts)
        q = None if carried else mechanism(bodies.resultant, contacts)
        if q is None:
            return None if detections == 0 else w
        if float(np.abs(bodies.excess_motion(increment.dt * w)).max()) > MAX_FALL * increment.grid.cell:
            error = _unstopped(increment, bodies, [*visited, constraints])
            if error is not None:
                raise error
        visited.append(constraints)
        velocity = bodies.modes @ q
        length = DETECTION_INTERVAL * increment.grid.cell / increment.dt
        w = w + length / float(np.abs(velocity).max()) * velocity
    return None


def _unstopped(increment: Increment, bodies: FloatingBodies, visited: Sequence[Constraints]) -> StepRejected | None:
    """The error of the last contacts visited along mechanisms, None if they carry the loads.

    A body that slides on the first ones it has is described by these: where friction is associated, sliding lifts it,
    and in the end it has lost them.
    """
    last = _collapse(increment, bodies, visited[-1])
    if last is None:
        return None
    before = (_collapse(increment, bodies, constraints) for constraints in visited[:-1])
    first = next((each for each in before if each is not None and each.body == last.body and each.touches), last)
    return (first if first.slips else last).error()


def _carried(
    contact: ContactProblem, bodies: FloatingBodies, constraints: Constraints, contacts: RigidContacts
) -> bool:
    """Whether the contact forces of the previous step carry the loads, so that no linear programme is needed."""
    if contact.known.key.size == 0:
        return False
    normal, tangential = constraints.forces(constraints.impulses(contact.known.key, contact.known.force, 1.0), 1.0)
    out_of_balance = bodies.resultant + contacts.normal.T @ normal + contacts.tangent.T @ tangential
    size = np.abs(bodies.resultant.reshape(-1, 3)).max(axis=1)
    return bool((np.abs(out_of_balance) <= LOAD_TOLERANCE * np.repeat(size, 3)).all())


def diagnose(
    increment: Increment, contact: ContactIterate, bodies: FloatingBodies, error: StepRejected
) -> StepRejected:
    """The error that describes the mechanism of the last iteration's contacts, or `error` if there is none."""
    if not bodies.loaded:
        return error
    found = _collapse(increment, bodies, contact.constraints)
    return error if found is None else found.error("no equilibrium was found", retryable=increment.depends_on_dt)


@dataclass(frozen=True)
class _Collapse:
    """How a body moves in a mechanism."""

    body: int
    motion: str
    touches: bool  # whether it is not off what it moves on
    slips: bool  # whether contacts that cannot slip would carry the loads
    remedy: str

    def error(self, verdict: str = "there is no equilibrium", *, retryable: bool = False) -> StepRejected:
        """As an error."""
        return StepRejected(f"body {self.body}", f"{verdict}: it {self.motion}", self.remedy, retryable=retryable)


def _collapse(increment: Increment, bodies: FloatingBodies, constraints: Constraints) -> _Collapse | None:
    """The mechanism of the closest contacts; None if they can carry the loads."""
    closest = _closest(constraints, GAP_MARGIN * increment.grid.cell)
    contacts = rigid_contacts(increment, bodies, closest)
    rough = replace(contacts, friction=np.full(closest.size, NO_SLIP_FRICTION))
    without_slip = mechanism(bodies.resultant, rough, few=True)
    q = mechanism(bodies.resultant, contacts, few=True) if without_slip is None else without_slip
    if q is None:
        return None
    found = describe(q, contacts)
    b, verb, remedy = int(bodies.bodies[found.body]), found.verb, "" if without_slip is not None else " or friction"
    if verb == "rotates":
        verb = "topples" if at_corner(increment, closest, found.contact, b) else "rolls"
    where = "" if found.contact < 0 else f" {_on(closest, found.contact, b, increment.grid.cell)}"
    force = bodies.resultant[3 * found.body : 3 * found.body + 2]
    motion = f"{verb}{where}; its load is ({force[0]:.3g}, {force[1]:.3g}) N/m"
    touches = found.contact >= 0 and bool(closest.gap[found.contact] <= GAP_MARGIN * increment.grid.cell)
    return _Collapse(b, motion, touches, without_slip is None, f"add a Support, a wall{remedy}, or use inertia")


def _closest(constraints: Constraints, margin: float) -> Constraints:
    """The contacts of every pair of bodies with gaps up to the smallest one plus a margin [m]."""
    pairs, pair = np.unique(constraints.bodies, axis=1, return_inverse=True)
    smallest = np.full(pairs.shape[1], np.inf)
    np.minimum.at(smallest, pair.ravel(), constraints.gap)
    return constraints.among(constraints.gap <= np.maximum(smallest[pair.ravel()], 0.0) + margin)


def _on(constraints: Constraints, contact: int, body: int, cell: float) -> str:
    """The other body or wall of a contact and its position, as text."""
    first, second = constraints.bodies[:, contact].tolist()
    other = first if second == body else second
    x, y = cell * np.round(constraints.x[:, contact] / cell, 6) + 0.0  # no -2e-17
    return f"on {f'wall {-1 - other}' if other < 0 else f'body {other}'} at ({x:.4g}, {y:.4g}) m"
