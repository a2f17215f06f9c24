"""Energy budget and report of a step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit import Budget, ContactIterate, End, Increment, Path, Solution
from skmpm.scene import Energy, Report, Scene, State, centres
from skmpm.simulate.work import work_at_contacts, work_at_start

Array = NDArray[np.float64]

SAME_ENERGY = 1e-9  # relative difference of strain energies of one configuration, evaluated twice: round-off


def budget_of(scene: Scene, state: State, increment: Increment, solution: Solution, end: End, after: State) -> Budget:
    """The energy budget of a solved step, the sum of those of its terms.

    With inertia the work is that of the forces in the balance of momentum, so that the budget of the time scheme
    closes. A quasi-static step takes the mean of the forces at both its ends (trapezoidal rule, second order).
    """
    inertia, work = increment.scheme.inertia, -float(end.reaction @ increment.prescribed)
    contact = solution.contact
    if contact is not None:
        work += work_at_contacts(scene, state, increment, contact, end)
    if not inertia:
        work = 0.5 * (work + work_at_start(scene, state, increment, end.motions))
    total = Budget(external=work)
    if inertia:
        total += _of_motion(state, increment, end, after)
    if contact is not None:
        total += _of_contacts(increment, contact)
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


def _of_motion(state: State, increment: Increment, end: End, after: State) -> Budget:
    """Kinetic energies, relative to a periodic box, which works on bodies that move to where it moves otherwise."""
    mass, v0, v1 = _counted(increment), increment.v0, end.velocity
    gradient = end.motions.gradient
    if gradient is None or after.box_rate is None:
        kinetic, work = np.array([kinetic_energy(mass, v) for v in (v0, v1)]), 0.0
        swing = float(kinetic[1] - 0.5 * kinetic.sum())
    else:
        of_box, there = (
            increment.of_bodies(rate @ centres(each.x, each.mass, each.body))
            for rate, each in ((gradient, state), (after.box_rate, after))
        )
        kinetic = np.array([kinetic_energy(mass, v) for v in (v0 - of_box, v1 - there)])
        at_rate = kinetic_energy(mass, v1 - of_box)
        work = float(kinetic[1]) - at_rate - float((mass * (v1 - v0)) @ of_box)
        swing = 0.5 * (at_rate - kinetic[0])
    return Budget(kinetic=kinetic, external=work, swing=0.0 if increment.scheme.theta == 1.0 else swing)


def kinetic_energy(mass: Array, v: Array) -> float:
    """Kinetic energy of velocities (n,) with masses (n,) [J/m]."""
    return 0.5 * float(v @ (mass * v))


def _counted(increment: Increment) -> Array:
    """The masses (n,) [kg/m] but those of the edges of a periodic box, which are not of bodies."""
    mass, scalars = increment.mass, increment.scalars
    if scalars is None or scalars.carrier is None:
        return mass
    own = mass.copy()
    increment.of_scalars(own)[scalars.carrier.own] = 0.0
    return own


def _of_contacts(increment: Increment, contact: ContactIterate) -> Budget:
    """What contacts store, lose and tolerate."""
    constraints, r, dt = contact.constraints, contact.r, increment.dt
    rounding = float(increment.bulk.assembly.mass.sum()) * contact.problem.speed_round_off**2
    if constraints.size == 0:
        return Budget(rounding=rounding)
    k = int(np.argmax(constraints.pushed_out))
    works = (constraints.lifted(r, dt) * contact.u).reshape(constraints.size, -1).sum(axis=1)
    return Budget(
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
