"""Newton steps that rotate bodies exactly.

Along a straight line in the space of velocities a body that rotates by phi is stretched by phi^2 / 2, in slow motion
more than contact forces compress it. So the rotation in a step of the iteration is applied as a rotation, a
retraction as in optimisation on manifolds (Absil, Mahony & Sepulchre, Optimization Algorithms on Matrix Manifolds,
2008, chapter 4). To first order it is the straight line, so that Newton's method converges as before.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.implicit.residual import Increment

Array = NDArray[np.float64]


def retracted(increment: Increment, w: Array, step: Array) -> Array:
    """The velocity (2 nodes,) [m/s] after a step (2 nodes,) [m/s] from w, with the exact rotation of every body.

    A step is the sum of its mean, a rotation about the centre of mass, and the rest, which the rotation
    carries along. The mean, and with it the momentum, stays. Linear materials resist rotations, supports prescribe
    components of the velocity, and quasi-static iterations form affine combinations of iterates (Anderson): there it
    is the sum w + step.
    """
    if not increment.scheme.inertia or increment.material_response.linear or increment.supports is not None:
        return w + step
    grid, interval = increment.grid, increment.scheme.theta * increment.dt
    weight = increment.bulk.assembly.lumped[::2]
    arm = grid.arms(grid.position + (increment.start + interval * w).reshape(-1, 2).T, weight)
    relative = grid.arms(step.reshape(-1, 2).T, weight)
    moments = np.stack([weight * (arm[0] * relative[1] - arm[1] * relative[0]), weight * (arm**2).sum(axis=0)])
    momentum, inertia = grid.sums(moments)
    spin = (momentum / np.maximum(inertia, 1e-300))[grid.node_body]
    rest = relative - spin * np.stack([-arm[1], arm[0]])
    sine, versine = np.sin(interval * spin), 2.0 * np.sin(0.5 * interval * spin) ** 2
    turned = arm / interval + rest
    change = sine * np.stack([-turned[1], turned[0]]) - versine * turned + rest - relative
    return np.asarray(w + step + change.T.ravel())
