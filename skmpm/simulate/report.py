"""What a step cost and how good it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.assembly import Assembly
from skmpm.implicit import Bulk, Increment, Solution, Timer
from skmpm.scene import Energy, Report, State

Array = NDArray[np.float64]


def kinetic_energy(assembly: Assembly, v: Array) -> float:
    """Kinetic energy of nodal velocities (2 nodes,) [J/m]."""
    return 0.5 * float(v @ (assembly.mass * v))


def report_of(
    before: State, after: State, increment: Increment, solution: Solution, overlap: float, timer: Timer
) -> Report:
    """The report of the step from `before` to `after`."""
    energy = _energy(before.report.energy, after, increment, solution)
    timer.lap("report")
    return Report(
        dt=increment.dt,
        newton=solution.newton,
        linear=solution.factorised,
        contact=0 if solution.touching is None else solution.touching.iterations,
        residual=solution.residual,
        imbalance=solution.imbalance,
        settled=solution.touching is not None and solution.touching.settled is not None,
        overlap=overlap,
        energy=energy,
        seconds=timer.seconds,
    )


def _energy(old: Energy, after: State, increment: Increment, solution: Solution) -> Energy:
    """The budget: what goes in from outside and by push-out, and kinetic and elastic energy do not show, is lost."""
    bulk, w = increment.bulk, solution.w
    kinetic = kinetic_energy(bulk.assembly, increment.after(w)) if increment.scheme.inertia else 0.0
    elastic = bulk.energy(bulk.at(after.displacement)) + _at_anchor(bulk)
    work = increment.force @ w * increment.dt - solution.reaction @ increment.told
    external, push_out = float(work), 0.0
    if solution.touching is not None:
        rows, r = solution.touching.rows, solution.touching.r
        given = rows.given_components
        external -= float(r @ given)  # the work of walls and rigid bodies
        push_out = float(rows.forces(r, increment.dt)[0] @ rows.pushed)
    gained = kinetic + elastic - old.kinetic - old.elastic
    return Energy(
        kinetic=kinetic,
        elastic=elastic,
        external=old.external + external,
        push_out=old.push_out + push_out,
        dissipated=old.dissipated + external + push_out - gained,
    )


def _at_anchor(bulk: Bulk) -> float:
    """Elastic energy that linear materials held when the sheets were laid, 1/2 stress : C^-1 : stress [J/m]."""
    total = 0.0
    for material, points in bulk.materials:
        if material.linear and bulk.stress_anchor is not None:
            (lam, mu), stress = material.lame, bulk.stress_anchor[..., points]
            trace = stress[0, 0] + stress[1, 1]
            square = np.einsum("ijp,ijp->p", stress, stress) - lam / (2.0 * (lam + mu)) * trace**2
            total += float(bulk.assembly.volume[points] @ square) / (4.0 * mu)
    return total
