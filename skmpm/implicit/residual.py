"""The equations of one time step without contact."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.constraint_elimination import Elimination
from skmpm.grid import BodyGrids
from skmpm.implicit.bulk import Bulk, Configuration
from skmpm.implicit.explicit import StartForces
from skmpm.implicit.viscous import ViscousBulk
from skmpm.scheme import Scheme

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

DRIFT = 1e-4  # [cells] by which the balance of momentum may move a body in the end; then gaps are what they were
SPRING_SHARE = 1e-3  # of its shear modulus: the springs that keep a floating body in place in one Newton iteration


@dataclass(frozen=True)
class Proximal:
    """Proximal term that holds floating bodies in a quasi-static step: drag * (w - anchor) is part of the balance."""

    drag: Array  # (2 nodes,) by mass, so that it has no moment about their centres [kg/s]
    anchor: Array  # (2 nodes,) [m/s]


@dataclass(frozen=True)
class End:
    """The nodes at the end of a step."""

    at: Configuration
    velocity: Array  # (2 nodes,) [m/s]


@dataclass(frozen=True)
class Increment:
    """The equations of one time step."""

    bulk: Bulk
    start: Array  # U (2 nodes,) [m]
    v0: Array  # (2 nodes,) [m/s]
    force: Array  # of gravity and loads, (2 nodes,) [N/m]
    dt: float
    scheme: Scheme
    supports: Elimination | None = None
    prescribed: Array = field(default_factory=lambda: np.zeros(0))  # velocities of the supports, (2 supports,) [m/s]
    proximal: Proximal | None = None  # what holds floating bodies, once springs no longer do

    @property
    def grid(self) -> BodyGrids:
        """The body grids that the bodies move on."""
        return self.bulk.assembly.grid

    @property
    def _reach(self) -> float:
        return self.scheme.theta * self.dt

    @cached_property
    def at_start(self) -> Configuration:
        """The configuration at the start of the step."""
        return self.bulk.at(self.start)

    @cached_property
    def material_response(self) -> Bulk | ViscousBulk | StartForces:
        """What answers the motion: the bodies, or in an explicit step the forces that they start with."""
        if self.scheme.explicit:
            return StartForces.of(self.bulk, self.at_start, self.v0, self.dt, self.scheme.ghost)
        return ViscousBulk.of(self.bulk, self.at_start, self._reach) if self.bulk.viscosity > 0.0 else self.bulk

    @property
    def modulus(self) -> float:
        """Largest modulus that resists the motion in the step, lambda + 2 mu + 2 eta / dt [Pa]."""
        return self.bulk.modulus + 2.0 * self.bulk.viscosity / self._reach

    @cached_property
    def mass(self) -> Array:
        """What resists a change of w: the mass, in a quasi-static step nothing or a drag, (2 nodes,) [kg/m]."""
        if self.proximal is not None:
            return self.proximal.drag
        mass = self.bulk.assembly.mass
        return mass if self.scheme.inertia else np.zeros_like(mass)

    @cached_property
    def floats(self) -> NDArray[np.bool_]:
        """Which bodies neither inertia nor supports hold, (bodies,)."""
        bodies = self.grid.bodies
        if self.scheme.inertia:
            return np.zeros(bodies, dtype=bool)
        present = np.bincount(self.grid.node_body, minlength=bodies) > 0
        return present if self.supports is None else present & ~self.supports.holds

    @property
    def exact(self) -> bool:
        """Whether one solve is the solution, but for contact."""
        return self.material_response.linear and not self.floats.any()

    @property
    def rest(self) -> Array:
        """The velocity that inertia or drag keeps, (2 nodes,) [m/s]."""
        if self.proximal is not None:
            return self.proximal.anchor
        return self.v0 if self.scheme.inertia else np.zeros_like(self.v0)

    def first(self) -> Array:
        """The velocity to start from: v0, with the supports as prescribed."""
        return self.v0 if self.supports is None else self.supports.admissible(self.v0, self.prescribed)

    def prescribed_alone(self) -> Array:
        """What supports prescribe, and no motion elsewhere."""
        still = np.zeros_like(self.v0)
        return still if self.supports is None else self.supports.admissible(still, self.prescribed)

    def at(self, w: Array) -> Configuration:
        """The configuration whose stress drives the step."""
        return self.material_response.at(self.start + self._reach * w)

    def after(self, w: Array) -> Array:
        """The velocity v1 at the end of the step, (2 nodes,) [m/s]."""
        return self.v0 + (w - self.v0) / self.scheme.theta

    def end(self, w: Array) -> End:
        """The nodes at the end of the step."""
        return End(self.bulk.at(self.start + self.dt * w), self.after(w))

    def energy(self, w: Array, at: Configuration) -> float:
        """The incremental potential E(w) [J/m]."""
        slip = w - self.rest
        return (
            self.material_response.energy(at)
            + 0.5 * float(slip @ (self.mass * slip))
            - self._reach * float(self.force @ w)
        )

    def gradient(self, w: Array, at: Configuration) -> tuple[Array, float]:
        """The imbalance of momentum without contact (2 nodes,) [kg/s], and the size of its terms."""
        inertia = self.mass * (w - self.rest)
        elastic, external = self._reach * self.material_response.force(at), self._reach * self.force
        noise = self.round_off(w, at) / self.scheme.newton_tol
        return inertia + elastic - external, max(
            *(float(np.linalg.norm(f)) for f in (inertia, elastic, external)), noise
        )

    def balanced(self, w: Array, contact_impulse: Array, solved: Array) -> Array | None:
        """The velocity w with the momentum of every body right to round-off, None where gaps would not stay.

        Against the `push` of the contact forces as they are reported or, in long steps of pressed bodies, against
        that of the last contact solve, `solved`, whose normals are those of the iteration before: a full Newton step
        leaves only round-off of it, whatever the mass. After a shortened or accelerated step either correction may be
        longer than `DRIFT`.
        """
        for impulse in (contact_impulse, solved):
            left = self._left(w, impulse)
            if self._in_cells(left).max() <= DRIFT:
                return np.asarray(w - left.T[self.grid.node_body].ravel())
        return None

    def drift(self, w: Array, contact_impulse: Array, solved: Array) -> Array:
        """How far at the least the momentum that every body lacks would move it in the step, (bodies,) [cells]."""
        ways = [self._in_cells(self._left(w, impulse)) for impulse in (contact_impulse, solved)]
        return np.asarray(min(ways, key=np.max))

    def _in_cells(self, velocity: Array) -> Array:
        """Lengths of the ways in the step of velocities (2, bodies) [m/s], (bodies,) [cells]."""
        return np.asarray(np.hypot(*velocity) * self.dt / self.grid.cell)

    def _left(self, w: Array, contact_impulse: Array) -> Array:
        """The total imbalance of every body over its mass, (2, bodies) [m/s]; none where supports hold something."""
        assembly = self.bulk.assembly
        if not self.scheme.inertia or self.supports is not None:
            return np.zeros((2, self.grid.bodies))
        imbalance = assembly.lumped * (w - self.rest) - self._reach * self.force - contact_impulse
        left, mass = (self.grid.sums(a.reshape(-1, 2).T) for a in (imbalance, assembly.lumped))
        return np.asarray(left / np.maximum(mass, 1e-300))

    @property
    def fixed(self) -> Ints:
        """The unknowns that supports fix, (m,)."""
        return np.zeros(0, dtype=np.int64) if self.supports is None else self.supports.fixed

    def stopped(self, motions: sp.csr_array) -> sp.csr_array:
        """What motions (2 nodes, k) would change of the unknowns that supports fix, (m, k)."""
        if self.supports is None:
            return sp.csr_array((0, motions.shape[1]))
        return sp.csr_array(motions[self.fixed] - self.supports.T[self.fixed] @ motions)

    def unsupported(self, gradient: Array) -> Array:
        """The part of an imbalance that supports do not take, (2 nodes,)."""
        return gradient if self.supports is None else np.asarray(self.supports.T.T @ gradient)

    def reaction(self, gradient: Array) -> Array:
        """Impulses on the supports, conjugate to prescribed velocities, (2 supports,) [kg m/s per m]."""
        if self.supports is None:
            return np.zeros(0)
        return np.asarray(self.supports.prescription.T @ -gradient / self.scheme.theta)

    def dissipated(self, w: Array) -> float:
        """What the viscosity of the materials dissipates in the step [J/m]; never negative."""
        if not isinstance(self.material_response, ViscousBulk):
            return 0.0
        return 2.0 * self.material_response.potential(self.at(w)) / self.scheme.theta

    def round_off(self, w: Array, at: Configuration) -> float:
        """The imbalance that round-off of displacements and velocities leaves, whatever w [kg/s]."""
        reach = self.grid.cell + float(np.abs(at.displacement).max(initial=0.0))
        inertia = float(np.linalg.norm(self.mass * w))
        return float(20.0 * np.finfo(float).eps * (self._reach * self.modulus * reach * np.sqrt(w.size) + inertia))

    def matrix(self, at: Configuration, *, projected: bool = False) -> sp.bsr_array:
        """A = M + theta^2 dt^2 K; in a quasi-static step K and what keeps floating bodies from going anywhere.

        In an explicit step dt^2 K is the ghost penalty on accelerations.
        """
        assembly = self.bulk.assembly
        K = self.material_response.stiffness(at, projected=projected)
        if self.scheme.inertia:
            return assembly.matrix(K, self._reach**2)
        if self.proximal is not None:
            return assembly.matrix(K, self._reach**2, self.proximal.drag.reshape(-1, 2, 1) * np.eye(2))
        return assembly.matrix(K, self._reach**2, self.grid.pins(SPRING_SHARE * self.stiffnesses))

    @property
    def stiffnesses(self) -> Array:
        """Shear moduli of the floating bodies, times what makes them part of A, (bodies,) [kg/s]."""
        grid, modulus = self.grid, np.zeros(self.floats.size)
        for material, points in self.bulk.materials:
            modulus[grid.cell_body[grid.cell_of_point[points]]] = material.lame[1]
        return np.asarray(self._reach**2 * modulus * self.floats)

    def holding(self, w: Array, share: float) -> Increment:
        """The same step with a drag of a share of the shear modulus that holds floating bodies at w."""
        grid, mass = self.grid, self.bulk.assembly.lumped
        total = grid.sums(mass[None, ::2])[0]
        drag = np.repeat((share * self.stiffnesses / np.maximum(total, 1e-300))[grid.node_body], 2) * mass
        return replace(self, proximal=Proximal(drag, w))
