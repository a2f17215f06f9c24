"""Energy budget and report of a step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skmpm.assembly import Assembly
from skmpm.contact import acts_at_grid_nodes
from skmpm.implicit import Budget, ContactIterate, End, Increment, Path, Solution
from skmpm.scene import Energy, Report, Scene, State
from skmpm.simulate.box_motion import mean_gradient, velocity_of_box
from skmpm.simulate.rigid_energy import own_energies, work_of_turning
from skmpm.simulate.work import work_at_start

Array = NDArray[np.float64]

SAME_ENERGY = 1e-9  # relative difference of strain energies of one configuration, evaluated twice: round-off


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
    total = _of_motion(state, increment, solution, end)
    if inertia and after.box is not None:
        total += _of_box(state, increment, end, after)
    for own in own_energies(scene, state, increment, solution, end, after):
        total += own if inertia else replace(own, kinetic=np.zeros(2))
    if solution.contact is not None:
        total += _of_contacts(scene, state, increment, solution.contact, solution, end)
    if not inertia:
        at_start = work_at_start(scene, state, increment, end.motions)
        total = replace(total, external=0.5 * (total.external + at_start))
    stressed = end.configuration if increment.scheme.theta == 1.0 else increment.at(solution.w)
    path = Path(increment.at_start, stressed, end.configuration, inertia, end.internal)
    for term in increment.terms:
        total += term.budget(path)
    return _as_reported(total, state.report.energy.elastic)


def _as_reported(budget: Budget, elastic: float) -> Budget:
    """The budget with the elastic energy of the last report where a state from a file evaluates it again."""
    first = budget.elastic[0]
    if abs(first - elastic) > SAME_ENERGY * abs(elastic):
        return budget
    return replace(budget, elastic=np.array([elastic, budget.elastic[1]]))


def _of_motion(state: State, increment: Increment, solution: Solution, end: End) -> Budget:
    """Kinetic energies of the bodies on grids, and the work of supports."""
    of_box = velocity_of_box(state, mean_gradient(state, end.motions, increment.dt))
    external = -float(end.reaction @ increment.prescribed)
    if not increment.scheme.inertia:
        return Budget(external=external)
    assembly = increment.bulk.assembly
    kinetic = np.array([kinetic_energy(assembly, v - of_box) for v in (increment.v0, end.velocity)])
    swing = 0.0 if increment.scheme.theta == 1.0 else float(kinetic[1] - 0.5 * kinetic.sum())
    return Budget(kinetic=kinetic, external=external, swing=swing)


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
