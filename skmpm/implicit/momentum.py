"""The momentum of every body balanced to round-off at the end of a dynamic step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.residual import Increment

Array = NDArray[np.float64]

MAX_DRIFT = 1e-4  # [cells] displacement of a body by the final momentum correction, too small to change gaps


def with_balanced_momentum(
    increment: Increment, w: Array, contact_impulse: Array, last_impulse: Array
) -> Array | None:
    """The velocity w with the momentum of every body balanced to round-off; None if that would change gaps.

    Bodies are translated. The balance includes the contact impulse at w or, in long steps of bodies under pressure,
    that of the last contact solve, `last_impulse`, along the normals of the previous iteration: a full Newton step
    balances the latter to round-off, whatever the mass. After a shortened or accelerated step both corrections may
    move a body by more than `MAX_DRIFT`. Without inertia and in scenes with supports, which balance momentum by their
    reactions, w is returned as it is, and in explicit steps, where `Increment.end` balances it.
    """
    if increment.scheme.explicit:
        return w
    for impulse in _balanced_by(increment, contact_impulse, last_impulse):
        error = _error(increment, w, impulse)
        if _displacement(increment, error).max() <= MAX_DRIFT:
            return np.asarray(w - error.T[increment.grid.node_body].ravel())
    return None


def drift(increment: Increment, w: Array, contact_impulse: Array, last_impulse: Array) -> Array:
    """The smaller of the displacements of bodies by these corrections, (bodies,) [cells]."""
    impulses = _balanced_by(increment, contact_impulse, last_impulse)
    return np.asarray(min((_displacement(increment, _error(increment, w, i)) for i in impulses), key=np.max))


def _balanced_by(increment: Increment, contact_impulse: Array, last_impulse: Array) -> tuple[Array, ...]:
    """The contact impulses that the momentum of a solution may balance."""
    return (contact_impulse, last_impulse) if increment.long else (contact_impulse,)


def _displacement(increment: Increment, velocity: Array) -> Array:
    """Displacements in the step at velocities (2, bodies) [m/s], (bodies,) [cells]."""
    return np.asarray(np.hypot(*velocity) * increment.dt / increment.grid.cell)


def _error(increment: Increment, w: Array, contact_impulse: Array) -> Array:
    """Resultant out-of-balance impulse over mass, (2, bodies) [m/s]; zero in scenes with supports."""
    assembly, grid = increment.bulk.assembly, increment.grid
    if not increment.scheme.inertia or increment.supports is not None:
        return np.zeros((2, grid.bodies))
    force = increment.theta_dt * (increment.load(w) - increment.spring_force(w))
    imbalance = assembly.lumped * (w - increment.inertial_velocity) - force - contact_impulse
    resultant, mass = (grid.sums(a.reshape(-1, 2).T) for a in (imbalance, assembly.lumped))
    return np.asarray(resultant / np.maximum(mass, 1e-300))
