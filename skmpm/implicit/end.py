"""Nodes, contacts and material at the end of a step."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.configuration import Configuration
from skmpm.implicit.impact import after_impact, at_supports
from skmpm.implicit.iteration import Solution
from skmpm.implicit.residual import Increment
from skmpm.scene import PrescribedVelocities

Array = NDArray[np.float64]


@dataclass(frozen=True)
class End:
    """Their configuration, velocity, impulses and internal variables."""

    configuration: Configuration
    velocity: Array  # (n,) [m/s]
    reaction: Array  # impulses on the supports (2 supports,), with those at the end (`at_supports`) [kg m/s per m]
    impulses: Array  # of contacts, rows of H, with those of impacts at the end (`after_impact`) [N s/m]
    motions: PrescribedVelocities  # all prescribed velocities, with those that the step has found
    internal: Array | None = None  # (k, n) internal variables of the points, None if no material has memory


def carried(increment: Increment, solution: Solution) -> tuple[Increment, Solution]:
    """A solved step as if the motion that was found of a periodic box had been prescribed.

    Bodies begin, and end, with what it has added to their velocities (`scalar_unknowns`).
    """
    if increment.scalars is None or increment.scalars.carrier is None:
        return increment, solution
    v0, w = (increment.carried(v, solution.w) for v in (increment.v0, solution.w))
    return replace(increment, v0=v0), replace(solution, w=w)


def end_of_step(increment: Increment, solution: Solution, motions: PrescribedVelocities) -> End:
    """The end of a solved step with prescribed velocities `motions`."""
    configuration = _configuration(increment, solution)
    velocity, contact = _velocity(increment, solution), solution.contact
    impulses = np.zeros(0) if contact is None else contact.r
    reaction = solution.reaction
    if increment.scheme.theta < 1.0:
        velocity, at_end = at_supports(increment, velocity)
        reaction = reaction + at_end
        if contact is not None:
            velocity, impact = after_impact(increment, contact, velocity)
            impulses = impulses + impact
    if increment.scalars is not None:
        motions = increment.scalars.motions(increment.of_scalars(solution.w), increment.of_scalars(velocity))
    return End(configuration, velocity, reaction, impulses, motions, increment.bulk.updated(configuration))


def _configuration(increment: Increment, solution: Solution) -> Configuration:
    """The configuration at the end of the step: with theta = 1 that of the stresses.

    Viscous forces depend on its round-off, which a state that was loaded from a file does not know.
    """
    moved, known = increment.dt * solution.w, solution.configuration
    displacement, scalars = increment.start + increment.on_nodes(moved), increment.of_scalars(moved)
    usable = increment.scheme.theta == 1.0 and increment.bulk.viscosity == 0.0
    if usable and known is not None and known.bulk is increment.bulk:
        return known.translated(displacement, scalars)
    return increment.bulk.at(displacement, scalars)


def _velocity(increment: Increment, solution: Solution) -> Array:
    """The velocity v1 at the end of the step, with what w lacks of momentum, (n,) [m/s]."""
    v0 = increment.v0
    w = increment.with_scalars(increment.on_nodes(solution.w) + solution.spin, increment.of_scalars(solution.w))
    return np.asarray(v0 + (w - v0) / increment.theta)
