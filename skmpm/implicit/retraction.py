"""Newton steps that rotate bodies exactly.

Along a straight line in the space of velocities a body that rotates by phi is stretched by phi^2 / 2, in slow motion
more than contact forces compress it. So the rotation in a step of the iteration is applied as a rotation, a
retraction as in optimisation on manifolds (Absil, Mahony & Sepulchre, Optimization Algorithms on Matrix Manifolds,
2008, chapter 4). To first order it is the straight line, so that Newton's method converges as before.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.compiled import compiled
from skmpm.implicit.residual import Increment

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def retracted(increment: Increment, w: Array, step: Array) -> Array:
    """The velocity (n,) [m/s] after a step (n,) [m/s] from w, with the exact rotation of every body on a grid.

    A step is the sum of its mean, a rotation about the centre of mass, and the rest, which the rotation
    carries along. The mean, and with it the momentum, stays. Linear materials resist rotations and supports prescribe
    components of the velocity: there it is the sum w + step.
    """
    if increment.bulk.linear or increment.supports is not None:
        return w + step
    grid, mass = increment.grid, increment.bulk.assembly.lumped
    x, out = (grid.position.T + increment.start.reshape(-1, 2)).ravel(), w + step
    _retract(grid.blocks, x, mass, increment.theta_dt, w, step, out)
    return out


@compiled
def _retract(blocks: Ints, x: Array, mass: Array, interval: float, w: Array, step: Array, out: Array) -> None:
    """The same for nodes that are at x (2 nodes,) [m] at the start of the interval."""
    for b in range(blocks.size - 1):
        total, x_mean, y_mean, u_mean, v_mean = 1e-300, 0.0, 0.0, 0.0, 0.0
        for i in range(blocks[b], blocks[b + 1], 2):
            total += mass[i]
            x_mean += mass[i] * (x[i] + interval * w[i])
            y_mean += mass[i] * (x[i + 1] + interval * w[i + 1])
            u_mean += mass[i] * step[i]
            v_mean += mass[i] * step[i + 1]
        x_mean, y_mean, u_mean, v_mean = x_mean / total, y_mean / total, u_mean / total, v_mean / total
        momentum, inertia = 0.0, 1e-300
        for i in range(blocks[b], blocks[b + 1], 2):
            x_arm, y_arm = x[i] + interval * w[i] - x_mean, x[i + 1] + interval * w[i + 1] - y_mean
            momentum += mass[i] * (x_arm * (step[i + 1] - v_mean) - y_arm * (step[i] - u_mean))
            inertia += mass[i] * (x_arm**2 + y_arm**2)
        spin = momentum / inertia
        sine, versine = np.sin(interval * spin), 2.0 * np.sin(0.5 * interval * spin) ** 2
        for i in range(blocks[b], blocks[b + 1], 2):
            x_arm, y_arm = x[i] + interval * w[i] - x_mean, x[i + 1] + interval * w[i + 1] - y_mean
            u, v = step[i] - u_mean + spin * y_arm, step[i + 1] - v_mean - spin * x_arm  # the rest
            x_turned, y_turned = x_arm / interval + u, y_arm / interval + v
            out[i] = w[i] + u_mean + u - sine * y_turned - versine * x_turned
            out[i + 1] = w[i + 1] + v_mean + v + sine * x_turned - versine * y_turned
