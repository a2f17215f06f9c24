"""How far bodies are from equilibrium: the unbalanced force ratio."""

from __future__ import annotations

import numpy as np

from skmpm.implicit import Increment, Solution


def unbalanced_ratio(increment: Increment, solution: Solution) -> float:
    """Largest resultant force on a body over the mean force between two bodies, or body and wall, in contact.

    The resultant is that of contact forces, gravity, loads and springs, which accelerates the body. Bodies with
    supports are left out. It is zero if no force acts, and infinite if forces act but none between bodies.
    """
    grid, force, mean = increment.grid, increment.load(solution.w) - increment.spring_force(solution.w), 0.0
    contact = solution.contact
    if contact is not None and contact.constraints.size:
        constraints = contact.constraints
        force = force + contact.impulse / (increment.scheme.theta * increment.dt)
        normal, tangential = constraints.forces(contact.r, increment.dt)
        each = normal * constraints.normal + tangential * constraints.tangent
        first, second = constraints.bodies
        least = int(second.min())  # of the numbers of walls, which are negative
        _, pair = np.unique(first * (int(second.max()) - least + 1) + second - least, return_inverse=True)
        sums = np.stack([np.bincount(pair.ravel(), component) for component in each])
        sizes = np.hypot(*sums)
        mean = float(sizes.sum()) / max(int((sizes > 0.0).sum()), 1)
    resultant = np.hypot(*grid.sums(force.reshape(-1, 2).T))
    resultant[grid.node_body[increment.constrained_dofs // 2]] = 0.0
    largest = float(resultant.max(initial=0.0))
    return largest / mean if mean > 0.0 else (float("inf") if largest > 0.0 else 0.0)
