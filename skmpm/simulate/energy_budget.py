"""Energy budget and report of a step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skmpm.assembly import Assembly
from skmpm.contact import acts_at_grid_nodes
from skmpm.implicit import Bulk, ContactIterate, End, Increment, Solution
from skmpm.implicit.internal_variables import dissipated
from skmpm.scene import Energy, Report, Scene, State
from skmpm.simulate.box_motion import mean_gradient, velocity_of_box
from skmpm.simulate.budget import Budget
from skmpm.simulate.rigid_energy import own_energies, work_of_turning
from skmpm.simulate.springs import energies
from skmpm.simulate.work import work_at_start, work_of_loads

Array = NDArray[np.float64]

SAME_ENERGY = 1e-9  # relative difference of strain energies of one configuration, evaluated twice: round-off
STRAIN_ROUND_OFF = 100.0 * float(np.finfo(float).eps)  # energies of such strains are round-off


def kinetic_energy(assembly: Assembly, v: Array) -> float:
    """Kinetic energy of nodal velocities (2 nodes,) [J/m]."""
    return 0.5 * float(v @ (assembly.mass * v))


def budget_of(scene: Scene, state: State, increment: Increment, solution: Solution, end: End, after: State) -> Budget:
    """The energy budget of a solved step, the sum of those of its terms.

    With inertia the work is that of the forces in the balance of momentum, so that the budget of the time scheme
    closes. Velocities are relative to a periodic box, which works on bodies that move to where it moves at another
    speed. A quasi-static step takes the mean of the forces at both its ends (trapezoidal rule, second order).
    """
    inertia = increment.scheme.inertia
    total = _of_bodies(state, increment, solution, end)
    if inertia and after.box is not None:
        total += _of_box(state, increment, end, after)
    for own in own_energies(scene, state, increment, solution, end, after):
        total += own if inertia else replace(own, kinetic=np.zeros(2))
    if solution.contact is not None:
        total += _of_contacts(scene, state, increment, solution.contact, solution, end)
    if not inertia:
        at_start = work_at_start(scene, state, increment, solution.w, end.motions)
        total = replace(total, external=0.5 * (total.external + at_start))
    return total if increment.springs is None else total + _of_springs(scene, state, increment, end)


def _of_bodies(state: State, increment: Increment, solution: Solution, end: End) -> Budget:
    """That of the bodies on grids, their loads and supports."""
    bulk, w, reference_energy = increment.bulk, solution.w, _energy_of_reference_stress(increment.bulk)
    elastic = np.array([bulk.energy(at) + reference_energy for at in (increment.at_start, end.configuration)])
    reported = state.report.energy.elastic
    if increment.known_start is None and abs(elastic[0] - reported) <= SAME_ENERGY * abs(reported):
        elastic[0] = reported  # of a state from a file, whose configuration is evaluated again
    plastic = dissipated(bulk, end.configuration, end.internal)
    of_box = velocity_of_box(state, mean_gradient(state, end.motions, increment.dt))
    ends = (increment.v0, end.velocity) if increment.scheme.inertia else ()
    kinetic = np.array([kinetic_energy(bulk.assembly, v - of_box) for v in ends] or [0.0, 0.0])
    modulus = bulk.modulus * float(bulk.assembly.volume.sum())
    return Budget(
        kinetic=kinetic,
        elastic=elastic - [0.0, plastic],
        external=work_of_loads(increment, w) - float(end.reaction @ increment.prescribed),
        viscous=increment.dissipated(w),
        plastic=plastic,
        rounding=float(np.finfo(float).eps) * modulus,  # a strain energy is a small difference of terms as large
        noise=STRAIN_ROUND_OFF**2 * modulus,
        swing=_swing(increment, w, elastic, kinetic),
    )


def _of_box(state: State, increment: Increment, end: End, after: State) -> Budget:
    """What a periodic box does to bodies that move to where it moves at another speed."""
    assembly = increment.bulk.assembly
    of_box = velocity_of_box(state, mean_gradient(state, end.motions, increment.dt))
    there = kinetic_energy(assembly, end.velocity - velocity_of_box(after, after.box_rate))
    gained = there - kinetic_energy(assembly, end.velocity - of_box)
    carried = float((assembly.mass * (end.velocity - increment.v0)) @ of_box)
    return Budget(kinetic=np.array([0.0, gained]), external=gained - carried)


def _of_contacts(
    scene: Scene, state: State, increment: Increment, contact: ContactIterate, solution: Solution, end: End
) -> Budget:
    """That of contacts, which work on walls and on bodies of prescribed motion."""
    constraints, r, dt = contact.constraints, contact.r, increment.dt
    external = -float(end.impulses @ constraints.components(constraints.prescribed))
    if not acts_at_grid_nodes(increment.scheme.contact):
        external += work_of_turning(scene, state, solution, end, dt)
    rounding = float(increment.bulk.assembly.mass.sum()) * contact.problem.speed_round_off**2
    if constraints.size == 0:
        return Budget(external=external, rounding=rounding)
    k = int(np.argmax(constraints.pushed_out))
    works = (constraints.lifted(r, dt) * contact.u).reshape(constraints.size, -1).sum(axis=1)
    return Budget(
        external=external,
        push_out=float(constraints.forces(r, dt)[0] @ constraints.pushed_out),
        cohesion=-float(constraints.tensile_strength @ constraints.opening),
        tolerated=float(np.maximum(works, 0.0).sum()),
        rounding=rounding,
        overlap=float(constraints.pushed_out[k]),
        overlapping=constraints.bodies[:, k],
    )


def _of_springs(scene: Scene, state: State, increment: Increment, end: End) -> Budget:
    """That of beds and bars."""
    x, moved = state.x.copy(), increment.grid.at_points(end.configuration.displacement)
    x[:, scene.deformable_points] = state.x_anchor[:, scene.deformable_points] + moved
    stored, work = energies(scene, state.x, x, state.t, increment)
    return Budget(springs=np.array(stored), external=work)


def _swing(increment: Increment, w: Array, elastic: Array, kinetic: Array) -> float:
    """How far kinetic and elastic energy at the end of the step exceed one that small motions conserve [J/m].

    The midpoint rule balances forces in the middle of the step, where bodies that rotate have not the strain of the
    ends of chords. The elastic energy there and the mean of the kinetic ones at the ends are never above the energy
    of a vibration.
    """
    bulk = increment.bulk
    if increment.scheme.theta == 1.0:
        return 0.0
    strained = bulk.energy(bulk.at(increment.start + increment.theta_dt * w)) + _energy_of_reference_stress(bulk)
    return float(elastic[1] + kinetic[1] - strained - 0.5 * kinetic.sum())


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
    gained = budget.after - before
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
            kinetic=float(budget.kinetic[1]),
            elastic=float(budget.elastic[1]),
            external=old.external + budget.external,
            push_out=old.push_out + budget.push_out,
            cohesion=old.cohesion + budget.cohesion,
            regridding=old.regridding + by_regrid,
            viscous=old.viscous + budget.viscous,
            plastic=old.plastic + budget.plastic,
            springs=float(budget.springs[1]),
            dissipated=old.dissipated
            + budget.external
            + budget.push_out
            + by_regrid
            - gained
            - (float(budget.springs[1]) - old.springs)  # not from `budget.springs[0]`: a stage may have others
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
