"""Energy budget and report of a step."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from skmpm.assembly import Assembly
from skmpm.contact import acts_at_grid_nodes
from skmpm.implicit import Bulk, End, Increment, Solution
from skmpm.implicit.internal_variables import dissipated
from skmpm.scene import Energy, Report, Scene, State
from skmpm.simulate.box_motion import mean_gradient, velocity_of_box
from skmpm.simulate.rigid_energy import own_energies, work_of_turning
from skmpm.simulate.springs import energies
from skmpm.simulate.work import work_at_start, work_of_loads

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

SAME_ENERGY = 1e-9  # relative difference of strain energies of one configuration, evaluated twice: round-off
STRAIN_ROUND_OFF = 100.0 * float(np.finfo(float).eps)  # energies of such strains are round-off


def kinetic_energy(assembly: Assembly, v: Array) -> float:
    """Kinetic energy of nodal velocities (2 nodes,) [J/m]."""
    return 0.5 * float(v @ (assembly.mass * v))


@dataclass(frozen=True)
class Budget:
    """The energies of one step [J/m]."""

    before: float  # kinetic and elastic, at the start of the step
    kinetic: float
    elastic: float
    external: float  # work of loads, supports, walls, rigid bodies and moving ends of springs
    push_out: float  # penetration correction: work of contact forces on initial overlaps that the step removes
    viscous: float  # dissipated by the viscosity of materials
    noise: float  # round-off of energies
    exchanged: float  # sum of the magnitudes of the changes of kinetic and elastic energy, work and dissipation
    tolerated: float  # work of contact forces on open gaps, within `gap_tol`
    rounding: float  # round-off of strain energies, kinetic energy of gap velocities that are round-off
    springs: tuple[float, float] = (0.0, 0.0)  # stored in springs, at the start and at the end of the step
    swing: float = 0.0  # of the energy at the end about the one that is conserved, see `_swing`
    plastic: float = 0.0  # dissipated by changes of the internal variables of materials
    cohesion: float = 0.0  # work of cohesive contacts on open gaps, positive where these close
    overlap: float = 0.0  # largest part of an initial overlap that the step removes [m]
    overlapping: Ints = field(default_factory=lambda: np.zeros(2, dtype=np.int64))  # the two bodies that overlap so

    @property
    def largest(self) -> float:
        """The largest of the energies."""
        after = self.kinetic + self.elastic
        return max(
            *self.springs,
            abs(self.before),
            abs(after),
            abs(self.external),
            self.push_out,
            self.viscous,
            self.plastic,
            self.noise,
        )

    @property
    def surplus(self) -> float:
        """Energy gained beyond the work and the tolerances."""
        supplied = self.external + self.push_out + self.tolerated + self.rounding + self.cohesion
        spent = self.viscous + self.plastic
        into_springs = self.springs[1] - self.springs[0]
        return self.kinetic + self.elastic + spent - self.before + into_springs - supplied


def budget_of(scene: Scene, state: State, increment: Increment, solution: Solution, end: End, after: State) -> Budget:
    """The energy budget of a solved step.

    With inertia the work is that of the forces in the balance of momentum, so that the budget of the time scheme
    closes. Velocities are relative to a periodic box, which works on bodies that move to where it moves at another
    speed. A quasi-static step takes the mean of the forces at both its ends (trapezoidal rule, second order).
    """
    bulk, w, reference_energy = increment.bulk, solution.w, _energy_of_reference_stress(increment.bulk)
    inertia, motions = increment.scheme.inertia, end.motions
    elastic = [bulk.energy(at) + reference_energy for at in (increment.at_start, end.configuration)]
    reported = state.report.energy.elastic
    if increment.known_start is None and abs(elastic[0] - reported) <= SAME_ENERGY * abs(reported):
        elastic[0] = reported  # of a state from a file, whose configuration is evaluated again
    plastic = dissipated(bulk, end.configuration, end.internal)
    of_box = velocity_of_box(state, mean_gradient(state, motions, increment.dt))
    ends = (increment.v0, end.velocity) if inertia else ()
    kinetic = [kinetic_energy(bulk.assembly, v - of_box) for v in ends] or [0.0, 0.0]
    swing = _swing(increment, w, elastic, kinetic)
    external = work_of_loads(increment, w) - float(end.reaction @ increment.prescribed)
    if inertia and after.box is not None:
        external -= float((bulk.assembly.mass * (end.velocity - increment.v0)) @ of_box)
        there = kinetic_energy(bulk.assembly, end.velocity - velocity_of_box(after, after.box_rate))
        external, kinetic[1] = external + there - kinetic[1], there
    for own in own_energies(scene, state, increment, solution, end, after):
        external += own.work
        kinetic = [kinetic[i] + own.kinetic[i] for i in (0, 1)] if inertia else kinetic
    viscous = increment.dissipated(w)
    push_out = cohesion = tolerated = overlap = 0.0
    overlapping = np.zeros(2, dtype=np.int64)
    modulus = bulk.modulus * float(bulk.assembly.volume.sum())
    rounding = float(np.finfo(float).eps) * modulus  # a strain energy is a small difference of terms as large as this
    if solution.contact is not None:
        constraints, r, u = solution.contact.constraints, solution.contact.r, solution.contact.u
        external -= float(end.impulses @ constraints.components(constraints.prescribed))  # of walls and rigid bodies
        if not acts_at_grid_nodes(increment.scheme.contact):
            external += work_of_turning(scene, state, solution, end, increment.dt)
        push_out = float(constraints.forces(r, increment.dt)[0] @ constraints.pushed_out)
        if constraints.size:
            k = int(np.argmax(constraints.pushed_out))
            overlap, overlapping = float(constraints.pushed_out[k]), constraints.bodies[:, k]
        cohesion = -float(constraints.tensile_strength @ constraints.opening)
        rounding += float(bulk.assembly.mass.sum()) * solution.contact.problem.speed_round_off**2
        lifted = constraints.lifted(r, increment.dt)
        tolerated = (
            float(np.maximum((lifted * u).reshape(constraints.size, -1).sum(axis=1), 0.0).sum())
            if constraints.size
            else 0.0
        )
    if not inertia:
        external = 0.5 * (external + work_at_start(scene, state, increment, w, motions))
    springs = (0.0, 0.0)
    if increment.springs is not None:
        x, moved = state.x.copy(), increment.grid.at_points(end.configuration.displacement)
        x[:, scene.deformable_points] = state.x_anchor[:, scene.deformable_points] + moved
        springs, work = energies(scene, state.x, x, state.t, increment)
        external += work
    return Budget(
        before=elastic[0] + kinetic[0],
        kinetic=kinetic[1],
        elastic=elastic[1] - plastic,
        external=external,
        push_out=push_out,
        cohesion=cohesion,
        overlap=overlap,
        overlapping=overlapping,
        viscous=viscous,
        plastic=plastic,
        noise=max(STRAIN_ROUND_OFF**2 * modulus, 1e-300),
        springs=springs,
        swing=swing,
        exchanged=abs(springs[1] - springs[0])
        + abs(kinetic[1] - kinetic[0])
        + abs(elastic[1] - elastic[0])
        + abs(external)
        + viscous
        + plastic,
        tolerated=tolerated,
        rounding=rounding,
    )


def _swing(increment: Increment, w: Array, elastic: list[float], kinetic: list[float]) -> float:
    """How far kinetic and elastic energy at the end of the step exceed one that small motions conserve [J/m].

    The midpoint rule balances forces in the middle of the step, where bodies that rotate have not the strain of the
    ends of chords. The elastic energy there and the mean of the kinetic ones at the ends are never above the energy
    of a vibration.
    """
    bulk = increment.bulk
    if increment.scheme.theta == 1.0:
        return 0.0
    strained = bulk.energy(bulk.at(increment.start + increment.theta_dt * w)) + _energy_of_reference_stress(bulk)
    return elastic[1] + kinetic[1] - strained - 0.5 * (kinetic[0] + kinetic[1])


def report_of(
    old: Energy,
    increment: Increment,
    solution: Solution,
    budget: Budget,
    overlap: float,
    *,
    unbalanced: float,
    regridded: bool,
) -> Report:
    """The report of a step without wall times; the dissipation closes the energy budget.

    `regridded` says whether the step began with new body grids.
    """
    before = old.kinetic + old.elastic
    by_regrid = budget.before - before if regridded else 0.0
    gained = budget.kinetic + budget.elastic - before
    return Report(
        dt=increment.dt,
        inertia=increment.scheme.inertia,
        newton=solution.newton,
        factorisations=solution.factorisations,
        contact=0 if solution.contact is None else solution.contact.iterations,
        residual=solution.residual,
        imbalance=solution.imbalance,
        solves=solution.solves,
        unbalanced=unbalanced,
        overlap=overlap,
        energy=Energy(
            kinetic=budget.kinetic,
            elastic=budget.elastic,
            external=old.external + budget.external,
            push_out=old.push_out + budget.push_out,
            cohesion=old.cohesion + budget.cohesion,
            regridding=old.regridding + by_regrid,
            viscous=old.viscous + budget.viscous,
            plastic=old.plastic + budget.plastic,
            springs=budget.springs[1],
            dissipated=old.dissipated
            + budget.external
            + budget.push_out
            + by_regrid
            - gained
            - (budget.springs[1] - old.springs)  # not from `budget.springs[0]`: a stage may have others
            - budget.viscous
            - budget.plastic
            + budget.cohesion,
            gained=old.gained + budget.surplus,
            largest=max(old.largest, budget.largest),
        ),
    )


def _energy_of_reference_stress(bulk: Bulk) -> float:
    """Elastic energy of linear materials in the reference configuration, 1/2 stress : C^-1 : stress [J/m]."""
    total = 0.0
    for law, points, _ in bulk.groups:
        if law.linear and law.stress_anchor is not None:
            stress = law.stress_anchor.reshape(4, -1)
            C = law.tangent(np.eye(2)[:, :, None]).reshape(4, 4)
            square = np.einsum("ap,ab,bp->p", stress, np.linalg.pinv(C), stress)
            total += 0.5 * float(bulk.assembly.volume[points] @ square)
    return total
