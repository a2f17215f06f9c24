"""The momentum of every body balanced to round-off at the end of a dynamic step, and its angular momentum."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.residual import Increment

Array = NDArray[np.float64]

MAX_DRIFT = 1e-4  # [cells] displacement of a body by the final momentum correction, too small to change gaps
# [cells] Displacement by the missing spin in a step of the same length. Steps move bodies by at most 0.2 g dt^2 cells
# under gravity, so that the default tolerance of Newton's method leaves out-of-balance moments of this size. Contacts
# hold bodies against larger ones.
MAX_SPIN = 1e-3


def with_balanced_momentum(
    increment: Increment, w: Array, contact_impulse: Array, last_impulse: Array
) -> Array | None:
    """The velocity w with the momentum of every body balanced to round-off; None if that would change gaps.

    Bodies are translated. The balance includes the contact impulse at w or, in long steps of bodies under pressure,
    that of the last contact solve, `last_impulse`, along the normals of the previous iteration: a full Newton step
    balances the latter to round-off, whatever the mass. After a shortened step both corrections may move a body by
    more than `MAX_DRIFT`. In scenes with supports, which balance momentum by their reactions, w is returned as it is.
    """
    for impulse in _balanced_by(increment, contact_impulse, last_impulse):
        error = _error(increment, w, impulse)
        if _displacement(increment, error).max() <= MAX_DRIFT:
            return increment.with_scalars(
                increment.on_nodes(w) - error.T[increment.grid.node_body].ravel(), increment.of_scalars(w)
            )
    return None


def drift(increment: Increment, w: Array, contact_impulse: Array, last_impulse: Array) -> Array:
    """The smaller of the displacements of bodies by these corrections, (bodies,) [cells]."""
    impulses = _balanced_by(increment, contact_impulse, last_impulse)
    return np.asarray(min((_displacement(increment, _error(increment, w, i)) for i in impulses), key=np.max))


def missing_spin(increment: Increment, w: Array, out_of_balance: Array) -> Array | float:
    """The spins of bodies that the moments of the out-of-balance impulse amount to, as velocities (2 nodes,) [m/s].

    Added to the velocity at the end of a step, not to that which moves the nodes, they leave its gaps as they are and
    pass the moments on to the next step. Otherwise a disc that rolls down a gentle slope, where the force along the
    slope is a hundredth of its weight, loses a tenth of its angular momentum to the tolerance of Newton's method.
    Bodies that supports hold, and those that would turn too far, have none.
    """
    if increment.metric is not None:
        return 0.0
    grid, mass = increment.grid, increment.bulk.assembly.lumped[::2]
    x = grid.position.T + increment.at(w).displacement.reshape(-1, 2)
    impulse = increment.without_gauge_torque(increment.on_nodes(out_of_balance)).reshape(-1, 2)
    arm, (moment, inertia, total) = grid.moments(x, mass, impulse)
    spin = -moment / np.maximum(inertia, 1e-300)
    turned = np.abs(spin) * np.sqrt(inertia / np.maximum(total, 1e-300)) * increment.dt / grid.cell
    spin[turned > MAX_SPIN] = 0.0
    spin[grid.node_body[increment.constrained_dofs // 2]] = 0.0
    return np.asarray((np.stack([-arm[:, 1], arm[:, 0]], axis=1) * spin[grid.node_body, None]).ravel())


def _balanced_by(increment: Increment, contact_impulse: Array, last_impulse: Array) -> tuple[Array, ...]:
    """The contact impulses that the momentum of a solution may balance."""
    return (contact_impulse, last_impulse) if increment.long else (contact_impulse,)


def _displacement(increment: Increment, velocity: Array) -> Array:
    """Displacements in the step at velocities (2, bodies) [m/s], (bodies,) [cells]."""
    return np.asarray(np.hypot(*velocity) * increment.dt / increment.grid.cell)


def _error(increment: Increment, w: Array, contact_impulse: Array) -> Array:
    """Resultant out-of-balance impulse over mass, (2, bodies) [m/s]; zero in scenes with supports."""
    grid = increment.grid
    if increment.supports is not None:
        return np.zeros((2, grid.bodies))
    force = increment.external_force(increment.at(w))
    change, pushed = (increment.on_nodes(each) for each in (w - increment.v0, contact_impulse))
    imbalance = _weight(increment) * change - increment.theta_dt * force - pushed
    return _over_mass(increment, imbalance)


def _over_mass(increment: Increment, impulse: Array) -> Array:
    """Resultants of nodal impulses (2 nodes,) over the masses of bodies, (2, bodies) [m/s]."""
    resultant, mass = (increment.grid.sums(a.reshape(-1, 2).T) for a in (impulse, _weight(increment)))
    return np.asarray(resultant / np.maximum(mass, 1e-300))


def _weight(increment: Increment) -> Array:
    """The masses of the points at the nodes, in a static step their metric, (2 nodes,) [kg/m]."""
    return increment.bulk.assembly.lumped if increment.metric is None else increment.metric
