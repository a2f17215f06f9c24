"""Floating bodies of a quasi-static step, their rigid-body modes, and limits of their motion.

A body floats if at least one of its rigid-body modes is free of supports, so that contact alone may constrain it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.contact import Constraints
from skmpm.contact.rows import components
from skmpm.implicit.contact_problem import ContactIterate
from skmpm.implicit.equilibrium import RigidContacts
from skmpm.implicit.errors import StepRejected
from skmpm.implicit.frozen_geometry import force_scale
from skmpm.implicit.residual import Increment, null_space

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# [cells] Largest rigid motion in one iteration outside the range of the prescribed displacements; contact detection
# finds penetrations of less than a cell.
MAX_ITERATION_MOTION = 1.0
# [cells] The same from the start of the step, in any iteration; solutions are checked by `simulate.acceptance`.
MAX_STEP_MOTION = 4.0
ROUND_OFF = 1e-12  # over the sum of the forces on a body: a resultant that is none, as that of a pressure all around
NEGLIGIBLE_RESULTANT = 1e-3  # over the forces on a body: out-of-balance resultant accepted along neutral modes


@dataclass(frozen=True)
class FloatingBodies:
    """The n floating bodies of a quasi-static step; modes are vx, vy and spin times radius of gyration."""

    bodies: Ints  # (n,)
    modes: sp.csr_array  # (2 nodes, 3 n) nodal velocities of the rigid-body modes, body after body
    projection: sp.csr_array  # (3 n, 2 nodes) mass-weighted least-squares fit of the modes to nodal velocities
    supports: sp.csr_array  # (m, 3 n) combinations of modes that supports set to zero, or springs to ground oppose
    free: sp.csr_array  # (3 n, 3 n) projection on the modes that supports leave free
    prescribed_range: Array  # (2, 2) smallest and largest prescribed displacement of supports and surfaces [m]
    resultant: Array  # (3 n,) of gravity and loads [N/m]

    @property
    def loaded(self) -> bool:
        """Whether gravity or loads act on the bodies."""
        return bool(self.resultant.any())

    def excess_motion(self, displacement: Array) -> Array:
        """Rigid motion of a displacement (2 nodes,) [m] outside the prescribed range, (3, n) [m]."""
        moved = (self.projection @ displacement).reshape(-1, 3).T
        low, high = self.prescribed_range
        rotation = np.maximum(np.abs(moved[2]) - float(np.hypot(*(high - low))), 0.0)
        clipped = np.clip(moved[:2], low[:, None], high[:, None])
        return np.stack([*(moved[:2] - clipped), np.sign(moved[2]) * rotation])


def check_resultants(increment: Increment) -> None:
    """Raise StepRejected where the loads have a resultant on a rigid-body mode of a floating body."""
    if not increment.floating.any():
        return
    grid, motions = increment.grid, increment.grid.rigid_motions()
    turned, load = grid.rigid_motions(increment.start), increment.load(np.zeros_like(increment.start))
    for b in np.flatnonzero(increment.floating).tolist():
        dofs = slice(grid.blocks[b], grid.blocks[b + 1])
        free = null_space(increment.held_motions[b])
        dead, following = increment.force[dofs], (load - increment.force)[dofs]
        size = np.abs(load[dofs]).sum()
        resultant = dead @ motions[dofs] + following @ turned[dofs]
        least = 1e-6 * size * np.sqrt(dofs.stop - dofs.start)
        if np.abs(free.T @ resultant).max(initial=0.0) > least:
            force = f"resultant that no support or contact balances: ({resultant[0]:.3g}, {resultant[1]:.3g}) N/m"
            only_turns = np.abs(resultant[:2]).max() <= least
            raise StepRejected(
                f"body {b}",
                f"its loads have a {'moment that no support or contact balances' if only_turns else force}",
                "add a Support or a wall, or use inertia",
                retryable=False,
            )


def floating_bodies(increment: Increment, constraints: Constraints) -> FloatingBodies:
    """The floating bodies of a step, with rotations about their centres of mass at its start.

    `constraints` are the contacts after the prescribed motion alone.
    """
    assembly, bodies = increment.bulk.assembly, np.flatnonzero(increment.floating)
    grid, weight = increment.grid, assembly.lumped[::2]
    x = grid.position + increment.start.reshape(-1, 2).T
    arm = grid.arms(x, weight)
    radius = grid.radii_of_gyration(arm, weight)
    rotation = np.stack([-arm[1], arm[0]]) / np.maximum(radius, 1e-300)[grid.node_body]
    index = index_among(increment, bodies)
    node = np.flatnonzero(index[grid.node_body] >= 0)
    column, one = 3 * index[grid.node_body[node]], np.ones(node.size)
    row = np.concatenate([2 * node, 2 * node + 1, 2 * node, 2 * node + 1])
    columns = np.concatenate([column, column + 1, column + 2, column + 2])
    values = np.concatenate([one, one, rotation[0, node], rotation[1, node]])
    modes = sp.csr_array((values, (row, columns)), shape=(2 * grid.nodes, 3 * bodies.size))
    momentum = sp.csr_array(modes.T @ sp.diags_array(assembly.lumped))
    projection = sp.csr_array(sp.diags_array(1.0 / (momentum @ modes).diagonal()) @ momentum)
    speeds = _prescribed_range(increment, constraints, index)
    load, supports = increment.load(np.zeros_like(increment.start)), increment.support_violation(modes)
    resultant = np.asarray(modes.T @ load)
    resultant[np.abs(resultant) <= ROUND_OFF * (abs(modes).T @ np.abs(load))] = 0.0
    if increment.springs is not None:
        supports = sp.csr_array(sp.vstack([supports, increment.springs.opposing(modes)], format="csr"))
    return FloatingBodies(bodies, modes, projection, supports, _free(supports), increment.dt * speeds, resultant)


def index_among(increment: Increment, bodies: Ints) -> Ints:
    """The index among `bodies` of every body of the scene, -1 for others; the last entry is for walls."""
    index = np.full(increment.grid.bodies + 1, -1)
    index[bodies] = np.arange(bodies.size)
    return index


def _free(supports: sp.csr_array) -> sp.csr_array:
    """Projection of rigid motions (3 n,) on the null spaces of the bodies' supports (m, 3 n)."""
    gram = sp.csr_array(supports.T @ supports)
    blocks = [gram[i : i + 3, i : i + 3].toarray() for i in range(0, gram.shape[0], 3)]
    bases = [null_space(block) for block in blocks]
    return sp.csr_array(sp.block_diag([basis @ basis.T for basis in bases], format="csr"))


def _prescribed_range(increment: Increment, constraints: Constraints, index: Ints) -> Array:
    """Smallest and largest prescribed velocity of supports and of surfaces in contact, with zero, (2, 2) [m/s]."""
    fixed = index[np.maximum(constraints.bodies, -1)] < 0
    velocity = np.where(fixed[1], -constraints.prescribed, constraints.prescribed)[:, fixed.any(axis=0)]
    every = np.concatenate([np.zeros((2, 1)), velocity, increment.prescribed.reshape(-1, 2).T], axis=1)
    return np.stack([every.min(axis=1), every.max(axis=1)])


def rigid_contacts(increment: Increment, bodies: FloatingBodies, constraints: Constraints) -> RigidContacts:
    """The contacts and supports of the floating bodies as rigid bodies."""
    index = index_among(increment, bodies.bodies)
    # Rigid motions do not change contacts of a body with itself.
    between = constraints.bodies[0] != constraints.bodies[1]
    at_points = sp.csr_array(sp.kron(constraints.base, np.eye(2), format="csr") @ bodies.modes)
    normal, tangent = (
        sp.csr_array(sp.diags_array(between * 1.0) @ components(constraints.difference, d) @ at_points)
        for d in (constraints.normal, constraints.tangent)
    )
    owners = index[np.maximum(constraints.bodies, -1)]
    owners[:, ~between] = -1
    strength = constraints.tensile_strength if constraints.cohesive else None
    return RigidContacts(owners, normal, tangent, constraints.friction, bodies.supports, strength)


def excess_cells(increment: Increment, bodies: FloatingBodies, w: Array) -> Array:
    """Rigid motion of every floating body outside the prescribed range, (n,) [cells]."""
    return np.asarray(np.abs(bodies.excess_motion(increment.dt * w)).max(axis=0) / increment.grid.cell)


def check_step_motion(increment: Increment, bodies: FloatingBodies, w: Array) -> None:
    """Raise StepRejected if a body has moved by more than `MAX_STEP_MOTION` outside the prescribed range."""
    excess = excess_cells(increment, bodies, w)
    b = int(np.argmax(excess))
    if excess[b] > MAX_STEP_MOTION:
        smaller = "use a smaller dt, " if increment.depends_on_dt else ""
        raise StepRejected(
            f"body {bodies.bodies[b]}",
            f"no equilibrium was found within {excess[b]:.2g} cells of rigid motion",
            f"{smaller}add a Support or friction, apply loads in steps, or use inertia",
            retryable=increment.depends_on_dt,
        )


def limited(
    increment: Increment,
    bodies: FloatingBodies,
    w: Array,
    direction: Array,
    max_motion: float = MAX_ITERATION_MOTION,
) -> Array:
    """The direction with limited rigid motion of floating bodies.

    The motion outside the prescribed range grows by at most `max_motion` cells from that at w. Only modes that are
    free of supports are limited.
    """
    before, after = (bodies.excess_motion(increment.dt * v) for v in (w, w + direction))
    largest = np.abs(before) + max_motion * increment.grid.cell
    excess = after - np.clip(after, -largest, largest)
    if not excess.any():
        return direction
    return np.asarray(direction - bodies.modes @ (bodies.free @ excess.T.ravel()) / increment.dt)


def negligible(increment: Increment, contact: ContactIterate, bodies: FloatingBodies, resultants: Array) -> bool:
    """Whether resultants (3 n,) [kg m/s per m] are below `NEGLIGIBLE_RESULTANT` on every body."""
    size = np.repeat(force_scale(increment, contact)[bodies.bodies], 3)
    return bool((np.abs(resultants) <= NEGLIGIBLE_RESULTANT * size).all())
