"""The report of a step, and how far bodies are from equilibrium in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skmpm.observe.contact_network import between, pairs_of
from skmpm.scene import Energy, Report, Scene, State
from skmpm.step.equations import Increment
from skmpm.step.newton import Solution
from skmpm.step.rigid_bodies import rigid_state
from skmpm.step.terms import Budget


def unbalanced_ratio(scene: Scene, increment: Increment, solution: Solution, after: State) -> float:
    """Largest resultant force on a body over the mean force between two bodies, or body and wall, in contact.

    The resultant is that of contact forces, gravity, loads and springs, which accelerates the body. Bodies with
    supports are left out. It is zero if no force acts, and infinite if forces act but none between bodies.
    """
    grid, force, mean = increment.grid, increment.external_force(increment.at(solution.w)), 0.0
    contact = solution.contact
    if contact is not None and contact.constraints.size:
        force = force + increment.on_nodes(contact.impulse) / increment.theta_dt
        without_impacts = replace(after.contacts, force=contact.constraints.forces(contact.r, increment.dt))
        contacts = without_impacts.among(between(after.contacts))
        pairs = pairs_of(contacts, after.box)
        each = np.where(pairs.same, 1.0, -1.0) * contacts.vectors
        sizes = np.hypot(*(np.bincount(pairs.of, component, pairs.bodies.shape[1]) for component in each))
        mean = float(sizes.sum()) / max(int((sizes > 0.0).sum()), 1)
    resultant = np.hypot(*grid.sums(force.reshape(-1, 2).T))
    resultant[grid.node_body[increment.constrained_dofs // 2]] = 0.0
    largest = max(float(resultant.max(initial=0.0)), _of_free_rigid_bodies(scene, increment, after))
    return largest / mean if mean > 0.0 else (float("inf") if largest > 0.0 else 0.0)


def _of_free_rigid_bodies(scene: Scene, increment: Increment, after: State) -> float:
    """The largest resultant force on a free rigid body [N/m]."""
    if scene.free_rigid.size == 0:
        return 0.0
    at = after.t - (1.0 - increment.scheme.theta) * increment.dt
    bodies = rigid_state(scene, after)
    resultant = bodies.loads(scene, after, at).resultant + after.body_force[:, scene.free_rigid]
    return float(np.hypot(*(resultant * bodies.free[:2])).max())


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
