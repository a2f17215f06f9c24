"""The equations of one time step without contact: incremental potential, out-of-balance impulse, matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from skmpm.arrays import Array, Ints
from skmpm.grid import BodyGrids
from skmpm.grid.supports import Elimination
from skmpm.linear import Solver
from skmpm.material import wave_speed
from skmpm.scheme import Scheme
from skmpm.step.bulk import Bulk
from skmpm.step.gauge import Gauge
from skmpm.step.scalar_unknowns import ScalarUnknowns
from skmpm.step.terms import Configuration, Term

# Unknowns of a matrix that takes longer to factorise than an iteration more, which an old one may cost: of 30 discs
# 2.5 ms against 4, of 100 discs 9 against 7.
LARGE = 10_000
# [cells] that pressure waves travel in a long step; bodies under pressure respond to forces by stiffness. From 7.5 to
# 30 tests of long steps pass.
LONG = 15.0


@dataclass(frozen=True)
class Increment:
    """The equations of a time step for w = theta v1 + (1 - theta) v0, the velocity that moves the unknowns in it."""

    at_start: Configuration  # with the displacement U
    v0: Array  # (n,) of all unknowns [m/s]: nodes, then scalars
    others: Sequence[Term]  # the forces on the nodes but those of the bulk
    dt: float
    scheme: Scheme
    supports: Elimination | None = None
    prescribed: Array = field(default_factory=lambda: np.zeros(0))  # of the supports, (q,) [m/s, 1/s]
    gauge: Gauge | None = None  # for bodies whose material can turn inside their shape
    metric: Array | None = None  # in place of the mass, (2 nodes,) [kg/m]: of a solve of a static step
    guess: Array | None = None  # where the iteration begins (n,) [m/s]; v0 if None
    scalars: ScalarUnknowns = field(default_factory=ScalarUnknowns)  # unknowns that are not on a grid
    depends_on_dt: bool = True  # whether the equations depend on dt; not in equilibria under constant conditions

    @property
    def bulk(self) -> Bulk:
        """The deformable bodies."""
        return self.at_start.bulk

    @property
    def terms(self) -> tuple[Term, ...]:
        """All forces without contact."""
        return (self.bulk, *self.others, *self.scalars.kinds)

    @property
    def grid(self) -> BodyGrids:
        """The body grids."""
        return self.bulk.assembly.grid

    @property
    def theta_dt(self) -> float:
        """Displacements of nodes in the forces are the velocity times this [s]."""
        return self.scheme.theta * self.dt

    @cached_property
    def theta(self) -> Array:
        """Moreau-Jean parameters, (n,)."""
        return self.with_scalars(
            np.full(self.displacement_at_start.size, self.scheme.theta), self.scalars.inertia.theta
        )

    @cached_property
    def interval(self) -> Array:
        """Displacements in the forces are the velocity times this, (n,) [s]."""
        return self.theta * self.dt

    def on_nodes(self, w: Array) -> Array:
        """The part (2 nodes,) of a vector of all unknowns (n,)."""
        return w[: self.displacement_at_start.size]

    def of_scalars(self, w: Array) -> Array:
        """The part (p,) of a vector of all unknowns (n,)."""
        return w[self.displacement_at_start.size :]

    def with_scalars(self, on_nodes: Array, of_scalars: Array) -> Array:
        """A vector of all unknowns (n,) from those of nodes (2 nodes,) and of scalars (p,)."""
        return np.concatenate([on_nodes, of_scalars]) if of_scalars.size else on_nodes

    @property
    def displacement_at_start(self) -> Array:
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
        """Diagonal inertia: lumped mass, of nodes in a static step its metric, (n,) [kg/m]."""
        nodes = self.bulk.assembly.mass if self.metric is None else self.metric
        return self.with_scalars(nodes, self.scalars.inertia.mass)

    @cached_property
    def linear(self) -> bool:
        """Whether one matrix serves all iterations."""
        return all(term.linear for term in self.terms)

    @property
    def keeps_factor(self) -> bool:
        """Whether a later step may use the factor: its matrix is the same, or large and of dt and a configuration."""
        if self.linear:
            return True
        of_configuration = self.bulk.internal is None and self.gauge is None and self.scheme.inertia
        large = self.displacement_at_start.size >= LARGE
        return large and of_configuration and not any(term.stiff for term in self.others)

    def initial_guess(self) -> Array:
        """The velocity v0 with the prescribed velocities of supports, on the gauge, (n,) [m/s]."""
        first = self.v0 if self.guess is None else self.guess
        w = self.on_nodes(first)
        w = w if self.gauge is None else self.gauge.initial_guess(w)
        w = w if self.supports is None else self.supports.admissible(w, self.prescribed)
        return self.with_scalars(w, self.of_scalars(first))

    def prescribed_only(self) -> Array:
        """The nodal velocity (2 nodes,) with the prescribed values at supports and zero elsewhere."""
        zero = np.zeros_like(self.displacement_at_start)
        return zero if self.supports is None else self.supports.admissible(zero, self.prescribed)

    def with_box_motion(self, v: Array, w: Array) -> Array:
        """A velocity v (n,) whose bodies move with a periodic box, too, that has the scalar unknowns of w (n,)."""
        translation = self.scalars.translation(self.of_scalars(w))
        return v if translation is None else v + self.of_bodies(translation)

    def of_bodies(self, translation: Array) -> Array:
        """The velocities (n,) of bodies that move at (2, bodies)."""
        return self.with_scalars(translation[:, self.grid.node_body].T.ravel(), self.scalars.carried(translation))

    def at(self, w: Array) -> Configuration:
        """The configuration in which forces are evaluated."""
        moved = self.interval * w
        return self.bulk.at(self.displacement_at_start + self.on_nodes(moved), self.of_scalars(moved))

    def energy(self, w: Array, configuration: Configuration, terms: Sequence[Term]) -> float:
        """The incremental potential E(w) with some terms, as all or as those frozen for a line search [J/m]."""
        change = w - self.v0
        stored = sum(term.energy(configuration) for term in terms)
        return stored + 0.5 * float(change @ (self.mass * change))

    def force(self, term: Term, configuration: Configuration) -> Array:
        """The force of a term on all unknowns, (n,) [N/m]."""
        force, of_scalars = term.force(configuration), np.zeros_like(self.scalars.inertia.v0)
        if term.own is None:
            return self.with_scalars(force, of_scalars)
        of_scalars[term.own] = force
        return self.with_scalars(np.zeros_like(self.displacement_at_start), of_scalars)

    def gradient(self, w: Array, configuration: Configuration) -> tuple[Array, float]:
        """Out-of-balance impulse without contact (n,) [kg m/s per m], and the norm of its largest term."""
        impulses = [self.mass * (w - self.v0)]
        impulses += [self.interval * self.force(term, configuration) for term in self.terms]
        noise = self.round_off(w, configuration) / self.scheme.newton_tol
        return sum(impulses[1:], impulses[0]), max(*(float(np.linalg.norm(each)) for each in impulses), noise)

    def external_forces(self, configuration: Configuration) -> list[Array]:
        """The forces that may move bodies on grids, of loads and springs, (2 nodes,) each [N/m]."""
        return [-term.force(configuration) for term in self.others if not term.balanced]

    def external_force(self, configuration: Configuration) -> Array:
        """The sum of `external_forces`, (2 nodes,) [N/m]."""
        return sum(self.external_forces(configuration), np.zeros_like(self.displacement_at_start))

    def couplings(self, configuration: Configuration) -> list[tuple[sp.csr_array, Array]]:
        """The stiffnesses of terms that couple bodies."""
        found = (term.coupling(configuration) for term in self.terms)
        return [coupling for coupling in found if coupling is not None]

    @property
    def constrained_dofs(self) -> Ints:
        """The degrees of freedom that supports eliminate, (m,)."""
        return np.zeros(0, dtype=np.int64) if self.supports is None else self.supports.fixed

    def without_gauge_torque(self, gradient: Array) -> Array:
        """An out-of-balance impulse without the part that the gauge bears, (2 nodes,)."""
        return gradient if self.gauge is None else self.gauge.without_torque(gradient)

    def on_free_dofs(self, gradient: Array) -> Array:
        """An out-of-balance impulse without the parts that supports and the gauge bear, (n,)."""
        return self.with_scalars(self.free_nodes(self.on_nodes(gradient)), self.of_scalars(gradient))

    def free_nodes(self, gradient: Array) -> Array:
        """Impulses at nodes without the parts that supports and the gauge bear, (2 nodes,)."""
        free = self.without_gauge_torque(gradient)
        return free if self.supports is None else np.asarray(self.supports.T.T @ free)

    def solved(self, solver: Solver, b: Array) -> Array:
        """A^-1 b for all unknowns (n,), from the solver for those of nodes."""
        return self.with_scalars(solver(self.on_nodes(b)), self.of_scalars(b) / self.scalars.inertia.response)

    def limited(self, direction: Array) -> Array:
        """A change of w (n,) in which scalars do not move too far."""
        farthest = self.scalars.inertia.farthest
        return self.with_scalars(self.on_nodes(direction), np.clip(self.of_scalars(direction), -farthest, farthest))

    def reaction(self, gradient: Array) -> Array:
        """Impulses (q,) on the supports, work conjugate to their velocities; q = 2 supports + 2 that turn."""
        if self.supports is None:
            return np.zeros(0)
        return np.asarray(self.supports.prescription.T @ -self.on_nodes(gradient) / self.scheme.theta)

    def round_off(self, w: Array, configuration: Configuration) -> float:
        """Out-of-balance impulse by round-off of displacements and velocities [kg m/s per m]."""
        length = self.grid.cell + float(np.abs(configuration.displacement).max(initial=0.0))
        inertia = float(np.linalg.norm(self.mass * w))
        elastic = self.theta_dt * self.modulus * length * np.sqrt(w.size)
        return float(20.0 * np.finfo(float).eps * (elastic + inertia))

    def matrix(self, configuration: Configuration) -> sp.bsr_array:
        """A = M + theta^2 dt^2 K of the nodes, with M the metric in a static step."""
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
