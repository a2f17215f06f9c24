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
    """The velocity (2 nodes,) [m/s] after a step (2 nodes,) [m/s] from w, with the exact rotation of every body.

    A step is the sum of its mean, a rotation about the centre of mass, and the rest, which the rotation
    carries along. The mean, and with it the momentum, stays. Linear materials resist rotations, supports prescribe
    components of the velocity, and quasi-static iterations form affine combinations of iterates (Anderson): there it
    is the sum w + step.
    """
    if not increment.scheme.inertia or increment.material_response.linear or increment.supports is not None:
        return w + step
    grid, interval = increment.grid, increment.scheme.theta * increment.dt
    x = grid.position.T + (increment.start + interval * w).reshape(-1, 2)
    retraction = np.empty_like(step)
    _rotate_steps(grid.blocks // 2, increment.bulk.assembly.lumped[::2], x, step.reshape(-1, 2), interval,
                  retraction.reshape(-1, 2))  # fmt: skip
    return np.asarray(w + retraction)


@compiled
def _rotate_steps(first: Ints, weight: Array, x: Array, step: Array, interval: float, out: Array) -> None:
    """Steps `out` (nodes, 2) with exact rotations of the bodies, whose nodes begin at first (bodies + 1,)."""
    for b in range(first.size - 1):
        nodes = range(first[b], first[b + 1])
        mass = mx = my = sx = sy = 0.0
        for n in nodes:
            mass += weight[n]
            mx += weight[n] * x[n, 0]
            my += weight[n] * x[n, 1]
            sx += weight[n] * step[n, 0]
            sy += weight[n] * step[n, 1]
        mass = max(mass, 1e-300)
        mx, my, sx, sy = mx / mass, my / mass, sx / mass, sy / mass
        momentum = inertia = 0.0
        for n in nodes:
            ax, ay = x[n, 0] - mx, x[n, 1] - my
            momentum += weight[n] * (ax * (step[n, 1] - sy) - ay * (step[n, 0] - sx))
            inertia += weight[n] * (ax * ax + ay * ay)
        spin = momentum / max(inertia, 1e-300)
        sine, versine = np.sin(interval * spin), 2.0 * np.sin(0.5 * interval * spin) ** 2
        for n in nodes:
            ax, ay = x[n, 0] - mx, x[n, 1] - my
            u, v = step[n, 0] - sx + spin * ay, step[n, 1] - sy - spin * ax  # without the rotation
            tx, ty = ax / interval + u, ay / interval + v
            out[n, 0] = sx + u - sine * ty - versine * tx
            out[n, 1] = sy + v + sine * tx - versine * ty
