"""The line search of Newton's method, along paths on which bodies rotate exactly."""

from __future__ import annotations

import numpy as np

from skmpm.arrays import ROUND_OFF, Array
from skmpm.contact import acts_at_grid_nodes
from skmpm.step.equations import Increment
from skmpm.step.errors import StepRejected, worst_body
from skmpm.step.rotation import retracted
from skmpm.step.terms import Configuration

SUFFICIENT_DECREASE = 1e-4  # Armijo's constant (Nocedal & Wright, Numerical Optimization, section 3.1)


def _round_off(increment: Increment, w: Array, configuration: Configuration, direction: Array, size: float) -> float:
    """Round-off of the potential, whose terms have this size [J/m]."""
    materials = 20.0 * float(np.finfo(float).eps) * increment.modulus * float(increment.bulk.assembly.volume.sum())
    return 1e-13 * size + materials + increment.round_off(w, configuration) * float(np.linalg.norm(direction))


def search(
    increment: Increment,
    w: Array,
    configuration: Configuration,
    direction: Array,
    gradient: Array,
    contact_impulse: Array,
) -> tuple[Array, Configuration]:
    """The next w with its configuration: Armijo backtracking on the potential minus the work of the contact impulse.

    The search is along the Newton direction, with exact rotations of bodies (`rotation`), and `gradient` (n,) is the
    out-of-balance impulse with contact. Contact at shared grid nodes is linear in the velocity: there the search is
    along a straight line.
    """
    at_nodes = bool(contact_impulse.any()) and acts_at_grid_nodes(increment.scheme.contact)
    decrease, terms = float(gradient @ direction), [term.frozen(configuration) for term in increment.terms]
    start = increment.energy(w, configuration, terms) - float(contact_impulse @ w)
    round_off = _round_off(increment, w, configuration, direction, abs(start) + abs(float(contact_impulse @ w)))
    length = 1.0
    while length > ROUND_OFF:
        step = length * direction
        trial = w + step if at_nodes else retracted(increment, w, step)
        trial_configuration = increment.at(trial)
        merit = increment.energy(trial, trial_configuration, terms) - float(contact_impulse @ trial)
        if merit <= start + SUFFICIENT_DECREASE * length * decrease + round_off:
            return trial, trial_configuration
        length *= 0.5
    raise StepRejected(
        worst_body(increment.grid, increment.on_nodes(gradient), increment.displacement_at_start)[0],
        "the line search found no step length that lowers the energy and keeps det F > 0 at all points",
    )
