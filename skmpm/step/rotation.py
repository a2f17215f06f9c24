"""How the iteration balances the momentum of bodies, and rotates them exactly.

Along a straight line in the space of velocities a body that rotates by phi is stretched by phi^2 / 2, in slow motion
more than contact forces compress it. So the rotation in a step of the iteration is applied as a rotation, a
retraction as in optimisation on manifolds (Absil, Mahony & Sepulchre, Optimization Algorithms on Matrix Manifolds,
2008, chapter 4). To first order it is the straight line, so that Newton's method converges as before.

The energy of a body does not change when it rotates. So its matrix turns with it, A -> R A R^T, and one that was
factorised at an earlier iterate serves after any rotation (corotational formulation: Felippa & Haugen, Comput.
Methods Appl. Mech. Eng. 194 (2005) 2285-2335). Without that, the old rotation stretches the body: a rotation by 0.01
rad that follows one of 0.01 rad strains it by 1e-4, in loose packings far more than contact forces do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.compiled import compiled
from skmpm.grid import BodyGrids
from skmpm.linear import Solver
from skmpm.linear.corrected import Rotated
from skmpm.scene import TOUCHING
from skmpm.step.equations import Increment
from skmpm.step.terms import Configuration

# [cells] Displacement of a body by the final correction of its momentum. With 1e-3 stresses of contacts miss those of
# walls by 4e-6 (test_shear_cell).
MAX_DRIFT = 1e-4


@dataclass(frozen=True)
class RigidMotion:
    """Two translations and the rotation of each body at the start of a step; spins are times radii of gyration."""

    grid: BodyGrids
    mass: Array  # lumped (nodes,) [kg/m]
    arm: Array  # from the centre of mass (2, nodes) [m]
    total: Array  # masses (bodies,) [kg/m]
    radius: Array  # of gyration (bodies,) [m]
    turns: Bools  # (bodies,) whether anything resists rotations

    @staticmethod
    def at_start(increment: Increment) -> RigidMotion:
        """The rigid motions of the bodies of a step; those on the gauge turn freely."""
        grid, mass = increment.grid, increment.bulk.assembly.mass[::2]
        arm = grid.arms(grid.at(increment.displacement_at_start), mass)
        radius = np.maximum(grid.radii_of_gyration(arm, mass), 1e-300)
        turns = np.ones(grid.bodies, dtype=bool) if increment.gauge is None else ~increment.gauge.bodies
        return RigidMotion(grid, mass, arm, np.maximum(grid.sums(mass[None])[0], 1e-300), radius, turns)

    def resultants(self, impulse: Array) -> Array:
        """Two components of nodal impulses (2 nodes,), and the moment over the radius of gyration, (3, bodies)."""
        x, y = impulse.reshape(-1, 2).T
        out = self.grid.sums(np.stack([x, y, self.arm[0] * y - self.arm[1] * x]))
        out[2] *= self.turns / self.radius
        return out

    def velocity(self, w: Array) -> Array:
        """The mean velocities of bodies and their spins, (3, bodies) [m/s], from nodal velocities (2 nodes,)."""
        return np.asarray(self.resultants(np.repeat(self.mass, 2) * w) / self.total)

    def at_surface(self, velocity: Array) -> Array:
        """The speeds of surfaces, those of discs, by motions (3, bodies), (bodies,) [m/s]."""
        return np.asarray(np.hypot(velocity[0], velocity[1]) + np.sqrt(2.0) * np.abs(velocity[2]))


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
    Bodies that supports or bars hold, and those that would turn too far, have none: contacts hold these
    (test_rolling).
    """
    if increment.metric is not None:
        return 0.0
    grid, mass = increment.grid, increment.bulk.assembly.lumped[::2]
    configuration = increment.at(w)
    x = grid.position.T + configuration.displacement.reshape(-1, 2)
    impulse = increment.without_gauge_torque(increment.on_nodes(out_of_balance)).reshape(-1, 2)
    arm, (moment, inertia, total) = grid.moments(x, mass, impulse)
    rotation = np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    resisted = _resisted(increment, rotation.ravel(), configuration).reshape(-1, 2)
    spin = -moment / np.maximum(grid.sums((rotation * resisted).sum(axis=1)[None])[0], 1e-300)
    turned = np.abs(spin) * np.sqrt(inertia / np.maximum(total, 1e-300)) * increment.dt / grid.cell
    spin[turned > TOUCHING] = 0.0
    spin[grid.node_body[increment.constrained_dofs // 2]] = 0.0
    spin[_on_bars(increment, configuration)] = 0.0
    return np.asarray((rotation * spin[grid.node_body, None]).ravel())


def _balanced_by(increment: Increment, contact_impulse: Array, last_impulse: Array) -> tuple[Array, ...]:
    """The contact impulses that the momentum of a solution may balance."""
    return (contact_impulse, last_impulse) if increment.long else (contact_impulse,)


def _displacement(increment: Increment, velocity: Array) -> Array:
    """Displacements in the step at velocities (2, bodies) [m/s], (bodies,) [cells]."""
    return np.asarray(np.hypot(*velocity) * increment.dt / increment.grid.cell)


def _error(increment: Increment, w: Array, contact_impulse: Array) -> Array:
    """The translations that balance momentum, (2, bodies) [m/s]; zero in scenes with supports, and on bars.

    A bar may be so stiff that its force changes by more than the body's weight over the shortest translation.
    """
    grid = increment.grid
    if increment.supports is not None:
        return np.zeros((2, grid.bodies))
    configuration = increment.at(w)
    change, pushed = (increment.on_nodes(each) for each in (w - increment.v0, contact_impulse))
    imbalance = _weight(increment) * change - increment.theta_dt * increment.external_force(configuration) - pushed
    resisted = _resisted(increment, np.ones_like(imbalance), configuration)
    resultant, resistance = (grid.sums(a.reshape(-1, 2).T) for a in (imbalance, resisted))
    resultant[:, _on_bars(increment, configuration)] = 0.0
    return np.asarray(resultant / np.maximum(resistance, 1e-300))


def _on_bars(increment: Increment, configuration: Configuration) -> Ints:
    """The bodies that terms couple with others or with the ground."""
    nodes = [ends.indices // 2 for ends, _ in increment.couplings(configuration)]
    return np.asarray(increment.grid.node_body[np.concatenate([np.zeros(0, dtype=np.int64), *nodes])])


def _resisted(increment: Increment, v: Array, configuration: Configuration) -> Array:
    """The impulses (2 nodes,) with which masses and external forces resist motions v (2 nodes,) [m/s] of bodies."""
    weight = _weight(increment)
    stiffnesses = [term.stiffness(configuration) for term in increment.others if not term.balanced]
    external = [each for each in stiffnesses if each is not None]
    if not external:
        return weight * v
    K, M = sum(external, np.zeros_like(external[0])), weight.reshape(-1, 2, 1) * np.eye(2)  # `matrix` takes K's array
    return np.asarray(increment.bulk.assembly.matrix(K, increment.theta_dt**2, M) @ v)


def _weight(increment: Increment) -> Array:
    """The masses of the points at the nodes, in a static step their metric, (2 nodes,) [kg/m]."""
    return increment.bulk.assembly.lumped if increment.metric is None else increment.metric


def retracted(increment: Increment, w: Array, step: Array) -> Array:
    """The velocity (n,) [m/s] after a step (n,) [m/s] from w, with the exact rotation of every body on a grid.

    A step is the sum of its mean, a rotation about the centre of mass, and the rest, which the rotation
    carries along. The mean, and with it the momentum, stays. Linear materials resist rotations and supports prescribe
    components of the velocity: there it is the sum w + step.
    """
    if increment.bulk.linear or increment.supports is not None:
        return w + step
    grid, mass = increment.grid, increment.bulk.assembly.lumped
    x, out = (grid.position.T + increment.displacement_at_start.reshape(-1, 2)).ravel(), w + step
    _retract(grid.blocks, x, mass, increment.theta_dt, w, step, out)
    return out


@compiled
def _retract(blocks: Ints, x: Array, mass: Array, interval: float, w: Array, step: Array, out: Array) -> None:
    """Write to `out` the velocities after a step, of nodes at x (2 nodes,) [m] at the start of the interval."""
    for b in range(blocks.size - 1):
        total, x_mean, y_mean, u_mean, v_mean = 1e-300, 0.0, 0.0, 0.0, 0.0
        for i in range(blocks[b], blocks[b + 1], 2):
            total += mass[i]
            x_mean += mass[i] * (x[i] + interval * w[i])
            y_mean += mass[i] * (x[i + 1] + interval * w[i + 1])
            u_mean += mass[i] * step[i]
            v_mean += mass[i] * step[i + 1]
        x_mean, y_mean, u_mean, v_mean = x_mean / total, y_mean / total, u_mean / total, v_mean / total
        momentum, inertia = 0.0, 1e-300
        for i in range(blocks[b], blocks[b + 1], 2):
            x_arm, y_arm = x[i] + interval * w[i] - x_mean, x[i + 1] + interval * w[i + 1] - y_mean
            momentum += mass[i] * (x_arm * (step[i + 1] - v_mean) - y_arm * (step[i] - u_mean))
            inertia += mass[i] * (x_arm**2 + y_arm**2)
        spin = momentum / inertia
        sine, versine = np.sin(interval * spin), 2.0 * np.sin(0.5 * interval * spin) ** 2
        for i in range(blocks[b], blocks[b + 1], 2):
            x_arm, y_arm = x[i] + interval * w[i] - x_mean, x[i + 1] + interval * w[i + 1] - y_mean
            u, v = step[i] - u_mean + spin * y_arm, step[i + 1] - v_mean - spin * x_arm  # the rest
            x_turned, y_turned = x_arm / interval + u, y_arm / interval + v
            out[i] = w[i] + u_mean + u - sine * y_turned - versine * x_turned
            out[i + 1] = w[i + 1] + v_mean + v + sine * x_turned - versine * y_turned


def matrix_turns(increment: Increment) -> bool:
    """Whether A turns with bodies: supports have directions that stay, and some terms."""
    return increment.supports is None and all(term.turns for term in increment.terms)


def turned_solver(increment: Increment, solver: Solver, old: Array, new: Array) -> Rotated:
    """The solver for A at old nodal displacements (2 nodes,), turned as bodies have turned on the way to new ones.

    Rotations are those that fit best by mass. Bodies on the gauge do not turn.
    """
    grid, weight = increment.grid, increment.bulk.assembly.lumped[::2]
    a, b = (grid.arms(grid.at(u), weight) for u in (old, new))
    moments = grid.sums(np.stack([weight * (a[0] * b[1] - a[1] * b[0]), weight * (a * b).sum(axis=0)]))
    angle = np.arctan2(moments[0], moments[1])
    if increment.gauge is not None:
        angle[increment.gauge.bodies] = 0.0
    return Rotated(solver, grid.node_body, angle)
