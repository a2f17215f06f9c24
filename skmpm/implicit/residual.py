"""The equations of one time step without contact: incremental potential, out-of-balance impulse, matrix."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.constraint_elimination import Elimination
from skmpm.grid import BodyGrids
from skmpm.implicit.bulk import Bulk, Configuration
from skmpm.implicit.follower_pressure import FollowerPressure
from skmpm.implicit.gauge import Gauge
from skmpm.implicit.springs import Springs
from skmpm.implicit.viscous import ViscousBulk
from skmpm.material import wave_speed
from skmpm.scheme import Scheme

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

LONG = 15.0  # [cells] that pressure waves travel in a long step; bodies under pressure respond to forces by stiffness


@dataclass(frozen=True)
class Increment:
    """The equations of one time step."""

    bulk: Bulk
    start: Array  # U (2 nodes,) [m]
    v0: Array  # (2 nodes,) [m/s]
    force: Array  # of gravity and dead loads, (2 nodes,) [N/m]
    dt: float
    scheme: Scheme
    supports: Elimination | None = None
    prescribed: Array = field(default_factory=lambda: np.zeros(0))  # velocities of the supports, (2 supports,) [m/s]
    gauge: Gauge | None = None  # for bodies whose material can turn inside their shape
    pressure: FollowerPressure | None = None
    springs: Springs | None = None
    known_start: Configuration | None = None  # the configuration at the start, where an earlier step has computed it
    metric: Array | None = None  # in place of the mass, (2 nodes,) [kg/m]: of a solve of a static step
    guess: Array | None = None  # where the iteration begins (2 nodes,) [m/s]; v0 if None
    depends_on_dt: bool = True  # whether the equations depend on dt; not in equilibria under constant conditions

    @property
    def grid(self) -> BodyGrids:
        """The body grids."""
        return self.bulk.assembly.grid

    @property
    def theta_dt(self) -> float:
        """Displacements in the forces are the velocity times this [s]."""
        return self.scheme.theta * self.dt

    @cached_property
    def at_start(self) -> Configuration:
        """The configuration at the start of the step."""
        return self.bulk.at(self.start) if self.known_start is None else self.known_start

    @cached_property
    def material_response(self) -> Bulk | ViscousBulk:
        """The internal forces as a function of the motion."""
        return ViscousBulk.of(self.bulk, self.at_start, self.theta_dt) if self.bulk.viscosity > 0.0 else self.bulk

    @property
    def modulus(self) -> float:
        """Largest modulus in the step, lambda + 2 mu + 2 eta / dt [Pa]."""
        return self.bulk.modulus + 2.0 * self.bulk.viscosity / self.theta_dt

    @property
    def long(self) -> bool:
        """Whether pressure waves travel farther than `LONG` in the step."""
        if self.metric is not None:
            return True
        wave = max(wave_speed(material) for material, _ in self.bulk.materials)
        return self.theta_dt * wave > LONG * self.grid.cell

    @cached_property
    def mass(self) -> Array:
        """Diagonal inertia: lumped mass, in a static step its metric, (2 nodes,) [kg/m]."""
        return self.bulk.assembly.mass if self.metric is None else self.metric

    @property
    def linear(self) -> bool:
        """Whether forces without contact are linear in the velocity."""
        return self.material_response.linear and (self.springs is None or self.springs.linear)

    @property
    def one_solve(self) -> bool:
        """Whether one linear solve gives the solution without contact."""
        return self.linear and self.pressure is None

    def initial_guess(self) -> Array:
        """The velocity v0 with the prescribed velocities of supports, on the gauge, (2 nodes,) [m/s]."""
        w = self.v0 if self.guess is None else self.guess
        w = w if self.gauge is None else self.gauge.initial_guess(w)
        return w if self.supports is None else self.supports.admissible(w, self.prescribed)

    def prescribed_only(self) -> Array:
        """The velocity with the prescribed values at supports and zero elsewhere."""
        zero = np.zeros_like(self.v0)
        return zero if self.supports is None else self.supports.admissible(zero, self.prescribed)

    def at(self, w: Array) -> Configuration:
        """The configuration in which stresses are evaluated."""
        return self.material_response.at(self.start + self.theta_dt * w)

    def load(self, w: Array) -> Array:
        """The forces of gravity, loads and pressures at a velocity w, (2 nodes,) [N/m]."""
        if self.pressure is None:
            return self.force
        return self.force + self.pressure.force(self.start + self.theta_dt * w)

    def with_load_of(self, w: Array) -> Increment:
        """The same with the pressures' forces at w, whatever the configuration."""
        return self if self.pressure is None else replace(self, force=self.load(w), pressure=None)

    def energy(self, w: Array, configuration: Configuration) -> float:
        """The incremental potential E(w) without pressures, which have none, [J/m]."""
        change = w - self.v0
        springs = 0.0 if self.springs is None else self.springs.energy(configuration.displacement)
        return (
            self.material_response.energy(configuration)
            + springs
            + 0.5 * float(change @ (self.mass * change))
            - self.theta_dt * float(self.force @ w)
        )

    def gradient(self, w: Array, configuration: Configuration) -> tuple[Array, float]:
        """Out-of-balance impulse without contact (2 nodes,) [kg m/s per m], and the norm of its largest term."""
        inertia = self.mass * (w - self.v0)
        elastic, external = (
            self.theta_dt * self.material_response.force(configuration),
            self.theta_dt * self.load(w),
        )
        if self.springs is not None:
            elastic = elastic + self.theta_dt * self.springs.force(configuration.displacement)
        noise = self.round_off(w, configuration) / self.scheme.newton_tol
        return inertia + elastic - external, max(
            *(float(np.linalg.norm(f)) for f in (inertia, elastic, external)), noise
        )

    def spring_force(self, w: Array) -> Array | float:
        """Force of the nodes on the springs, (2 nodes,) [N/m]; zero without springs."""
        return 0.0 if self.springs is None else self.springs.force(self.start + self.theta_dt * w)

    @property
    def constrained_dofs(self) -> Ints:
        """The degrees of freedom that supports eliminate, (m,)."""
        return np.zeros(0, dtype=np.int64) if self.supports is None else self.supports.fixed

    def without_gauge_torque(self, gradient: Array) -> Array:
        """An out-of-balance impulse without the part that the gauge bears, (2 nodes,)."""
        return gradient if self.gauge is None else self.gauge.without_torque(gradient)

    def on_free_dofs(self, gradient: Array) -> Array:
        """An out-of-balance impulse without the parts that supports and the gauge bear, (2 nodes,)."""
        free = self.without_gauge_torque(gradient)
        return free if self.supports is None else np.asarray(self.supports.T.T @ free)

    def reaction(self, gradient: Array) -> Array:
        """Impulses on the supports, work conjugate to the prescribed velocities, (2 supports,) [kg m/s per m]."""
        if self.supports is None:
            return np.zeros(0)
        return np.asarray(self.supports.prescription.T @ -gradient / self.scheme.theta)

    def dissipated(self, w: Array) -> float:
        """Energy dissipated by the viscosity of the materials in the step [J/m]; never negative."""
        if not isinstance(self.material_response, ViscousBulk):
            return 0.0
        return 2.0 * self.material_response.potential(self.at(w)) / self.scheme.theta

    def round_off(self, w: Array, configuration: Configuration) -> float:
        """Out-of-balance impulse by round-off of displacements and velocities [kg m/s per m]."""
        length = self.grid.cell + float(np.abs(configuration.displacement).max(initial=0.0))
        inertia = float(np.linalg.norm(self.mass * w))
        elastic = self.theta_dt * self.modulus * length * np.sqrt(w.size)
        return float(20.0 * np.finfo(float).eps * (elastic + inertia))

    def matrix(self, configuration: Configuration) -> sp.bsr_array:
        """A = M + theta^2 dt^2 K, with M the metric in a static step."""
        K = self.material_response.stiffness(configuration)
        if self.springs is not None:
            K = K + self.springs.bed_stiffness()
        M = None if self.metric is None else self.metric.reshape(-1, 2, 1) * np.eye(2)
        return self.bulk.assembly.matrix(K, self.theta_dt**2, M)

    @property
    def shear_modulus(self) -> Array:
        """Smallest shear moduli of bodies times theta^2 dt^2, zero for those without points, (bodies,) [kg/m]."""
        grid, modulus = self.grid, np.full(self.grid.bodies, np.inf)
        for material, points in self.bulk.materials:
            own = grid.cell_body[grid.cell_of_point[points]]
            modulus[own] = np.minimum(modulus[own], material.lame[1])
        return np.asarray(self.theta_dt**2 * np.where(np.isfinite(modulus), modulus, 0.0))
