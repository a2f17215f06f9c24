"""The equations of one time step without contact: incremental potential, out-of-balance impulse, matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.constraint_elimination import Elimination
from skmpm.grid import BodyGrids
from skmpm.implicit.bulk import Bulk, Configuration
from skmpm.implicit.gauge import Gauge
from skmpm.implicit.terms import Term
from skmpm.material import wave_speed
from skmpm.scheme import Scheme

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

LONG = 15.0  # [cells] that pressure waves travel in a long step; bodies under pressure respond to forces by stiffness


@dataclass(frozen=True)
class Increment:
    """The equations of one time step."""

    at_start: Configuration  # with the displacement U
    v0: Array  # (2 nodes,) [m/s]
    others: Sequence[Term]  # the forces but those of the bulk
    dt: float
    scheme: Scheme
    supports: Elimination | None = None
    prescribed: Array = field(default_factory=lambda: np.zeros(0))  # velocities of the supports, (2 supports,) [m/s]
    gauge: Gauge | None = None  # for bodies whose material can turn inside their shape
    metric: Array | None = None  # in place of the mass, (2 nodes,) [kg/m]: of a solve of a static step
    guess: Array | None = None  # where the iteration begins (2 nodes,) [m/s]; v0 if None
    depends_on_dt: bool = True  # whether the equations depend on dt; not in equilibria under constant conditions

    @property
    def bulk(self) -> Bulk:
        """The deformable bodies."""
        assert self.at_start.bulk is not None
        return self.at_start.bulk

    @property
    def terms(self) -> tuple[Term, ...]:
        """All forces without contact."""
        return (self.bulk, *self.others)

    @property
    def grid(self) -> BodyGrids:
        """The body grids."""
        return self.bulk.assembly.grid

    @property
    def theta_dt(self) -> float:
        """Displacements in the forces are the velocity times this [s]."""
        return self.scheme.theta * self.dt

    @property
    def start(self) -> Array:
        """The displacement at the start of the step, (2 nodes,) [m]."""
        return self.at_start.displacement

    @property
    def modulus(self) -> float:
        """Sum of the largest moduli of the terms, lambda + 2 mu + 2 eta / dt [Pa]."""
        return sum(term.modulus for term in self.terms)

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

    @cached_property
    def linear(self) -> bool:
        """Whether one matrix serves all iterations."""
        return all(term.linear for term in self.terms)

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
        """The configuration in which forces are evaluated."""
        return self.bulk.at(self.start + self.theta_dt * w)

    def frozen(self, configuration: Configuration) -> Increment:
        """The same with forces that have no energy as they are in a configuration."""
        return replace(self, others=[term.frozen(configuration) for term in self.others])

    def energy(self, w: Array, configuration: Configuration) -> float:
        """The incremental potential E(w) [J/m]."""
        change = w - self.v0
        stored = sum(term.energy(configuration) for term in self.terms)
        return stored + 0.5 * float(change @ (self.mass * change))

    def gradient(self, w: Array, configuration: Configuration) -> tuple[Array, float]:
        """Out-of-balance impulse without contact (2 nodes,) [kg m/s per m], and the norm of its largest term."""
        impulses = [self.mass * (w - self.v0)]
        impulses += [self.theta_dt * term.force(configuration) for term in self.terms]
        noise = self.round_off(w, configuration) / self.scheme.newton_tol
        return sum(impulses[1:], impulses[0]), max(*(float(np.linalg.norm(each)) for each in impulses), noise)

    def external_forces(self, configuration: Configuration) -> list[Array]:
        """The forces that may move bodies, of loads and springs, (2 nodes,) each [N/m]."""
        return [-term.force(configuration) for term in self.others if not term.balanced]

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

    def round_off(self, w: Array, configuration: Configuration) -> float:
        """Out-of-balance impulse by round-off of displacements and velocities [kg m/s per m]."""
        length = self.grid.cell + float(np.abs(configuration.displacement).max(initial=0.0))
        inertia = float(np.linalg.norm(self.mass * w))
        elastic = self.theta_dt * self.modulus * length * np.sqrt(w.size)
        return float(20.0 * np.finfo(float).eps * (elastic + inertia))

    def matrix(self, configuration: Configuration) -> sp.bsr_array:
        """A = M + theta^2 dt^2 K, with M the metric in a static step."""
        parts = [term.stiffness(configuration) for term in self.others]
        K = sum((part for part in parts if part is not None), self.bulk.stiffness(configuration))
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
