"""Frozen contact geometry, the moments due to it, and solutions without it.

Where Newton's method does not converge with the contact geometry of every iterate, normals and contact points, and so
the contact Jacobian, are kept from one iterate (lagged contact kinematics). They are frozen; gaps are still computed
at every iterate. Where contacts have slid since, the two forces of a contact no longer act on one line: equal and
opposite, they make a couple. Where contacts have turned since, the solution is that of other normals; from it,
Newton's method mostly converges with the geometry of every iterate.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.contact_problem import ContactIterate
from skmpm.implicit.errors import StepRejected
from skmpm.implicit.iteration import Solution
from skmpm.implicit.residual import Increment

Array = NDArray[np.float64]

# Largest moment due to frozen contact geometry, over the radius of gyration and half the sum of the forces on a body.
MAX_FROZEN_MOMENT = 2e-3

# Mean angle between frozen normals and those at the solution, weighted with forces, from which on a solution without
# frozen geometry is looked for [rad]: forces are off by as much as by the largest moment. It is 1e-4 in most steps,
# and up to 0.2 where a prescribed motion changes under friction.
SMALL_ANGLE = MAX_FROZEN_MOMENT


def with_present_geometry(solution: Solution, again: Callable[[], Solution]) -> Solution:
    """The solution, or the one that `again` finds from it if the frozen normals of the first are off.

    `again` goes on from the solution without frozen geometry, for as many iterations as led to the first one: what
    more of them find is another equilibrium, farther away. It may fail or freeze the geometry once more, and is
    repeated as long as normals are off by less than half as much. Beside sharp edges, where normals alternate, they
    are not, and the solution is one with normals that are off.
    """
    while solution.frozen_angle > SMALL_ANGLE:
        try:
            found = again()
        except StepRejected:
            break
        if found.frozen_angle > 0.5 * solution.frozen_angle:
            break
        solution = found
    return solution


def frozen_geometry_moment(increment: Increment, contact: ContactIterate | None, w: Array) -> Array:
    """Moment on every body due to frozen contact geometry, over radius of gyration and force scale, (bodies,).

    Only its excess over `newton_tol` times the largest force scale of all bodies counts, the tolerance of the
    balance. It is zero for bodies without free rigid-body modes, whose supports balance it.
    """
    grid, restrained = increment.grid, 0.0 if increment.supports is None else increment.supports.holds
    if contact is None or contact.frozen is None:
        return np.zeros(grid.bodies)
    weight = increment.bulk.assembly.lumped[::2]
    arm = grid.arms(grid.position + increment.start.reshape(-1, 2).T, weight)
    radius = grid.radii_of_gyration(arm, weight)
    forces = force_scale(increment, contact)
    moment = np.abs(_sums(contact, _moments(contact, w), grid.bodies))
    excess = moment / np.where(radius > 0.0, radius, np.inf) - increment.scheme.newton_tol * forces.max()
    return np.asarray(np.where(restrained, 0.0, np.maximum(excess, 0.0) / np.maximum(forces, 1e-300)))


def _moments(contact: ContactIterate, w: Array) -> Array:
    """Moments of the contact impulses, (k,) [kg m/s], due to the displacement of frozen contact points."""
    constraints, increment = contact.constraints, contact.increment
    if contact.frozen is None or contact.frozen.size == 0:
        return np.zeros(constraints.size)
    x = increment.grid.position.T + (increment.start + increment.dt * w).reshape(-1, 2)
    arm = ((constraints.difference - contact.current.difference) @ (constraints.base @ x)).T
    r = constraints.forces(contact.r, 1.0)
    force = r[0] * constraints.normal + r[1] * constraints.tangent
    return np.asarray(arm[0] * force[1] - arm[1] * force[0])


def force_scale(increment: Increment, contact: ContactIterate) -> Array:
    """Half the sum of the magnitudes of contact forces and load on every deformable body, times dt, (bodies,)."""
    grid = increment.grid
    load = increment.dt * np.hypot(*grid.sums(increment.load(increment.v0).reshape(-1, 2).T))
    size = increment.dt * np.hypot(*contact.constraints.forces(contact.r, increment.dt))
    deformable = np.bincount(grid.node_body, minlength=grid.bodies) > 0
    return np.asarray(np.where(deformable, 0.5 * (load + _sums(contact, size, grid.bodies)), 0.0))


def unmet_moment(increment: Increment, contact: ContactIterate | None, w: Array) -> list[tuple[str, str]]:
    """The body with the largest moment due to frozen contact geometry, and that moment; nothing if all are small."""
    moment = frozen_geometry_moment(increment, contact, w)
    if moment.max() <= MAX_FROZEN_MOMENT:
        return []
    size = (
        f"contacts near a limit point, whose frozen geometry causes a moment of {moment.max():.2g} of the forces"
        f" (tolerance {MAX_FROZEN_MOMENT:g})"
    )
    return [(f"body {np.argmax(moment)}", size)]


def _sums(contact: ContactIterate, values: Array, bodies: int) -> Array:
    """Sums of values (k,) of contacts over both their bodies, (bodies,)."""
    sides = (
        np.bincount(members[members >= 0], values[members >= 0], bodies) for members in contact.constraints.bodies
    )
    return np.asarray(sum(sides), dtype=np.float64)
