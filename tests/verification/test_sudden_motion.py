"""A rigid disc that is pressed into a block, then turned on it under friction, without inertia.

Where the motion changes, Newton's method begins far from the equilibrium. Solutions with normals that were off by 0.1
to 0.2 rad were accepted once: the work of the first turn was 1.5 times what it should be, and what was stored after
the second one 12 % too small.
"""

import numpy as np
import pytest

from skmpm import Body, NeoHookean, Rigid, Scene, Scheme, Support, box, disc, simulate

ANGLE, PRESSED = 0.2, 1.0  # of each turn [rad]; the time when the disc turns [s]


def indented(friction, depth):
    def motion(t):
        return (0.0, -depth, 0.0) if t < PRESSED else (0.0, 0.0, 1.0)

    block = Body(box((0, 0), (2.0, 1.0), spacing=0.074), NeoHookean(1e6, 0.3, 1000.0))
    ball = Body(disc((1.0, 1.301), 0.3, spacing=0.074), Rigid(1000.0), motion=motion)
    held = Support(lambda x: x[1] < 0.05, velocity=(0.0, 0.0))
    return Scene([block, ball], cell=0.1, friction=friction, supports=[held])


def turned(friction, depth, dt):
    """The states when pressed, after one turn and after two."""
    until = PRESSED + 2.0 * ANGLE
    scene, static = indented(friction, depth), Scheme(inertia=False)
    states = list(simulate(scene, dt=dt, until=until, scheme=static, warn=False))
    t = np.array([state.t for state in states])
    at = [int(np.abs(t - when).argmin()) for when in (PRESSED, PRESSED + ANGLE, until)]
    return [states[i] for i in at]


@pytest.mark.parametrize(("friction", "depth"), [(0.5, 0.1), (0.3, 0.15), (1.0, 0.15)])
def test_long_steps_store_what_short_ones_do(friction, depth):
    """Steps of 0.2 rad and of 0.02, to 1 %; friction is of first order in the step, and work agrees to a tenth."""
    long, short = turned(friction, depth, 0.2), turned(friction, depth, 0.02)
    for i in (1, 2):
        assert long[i].report.energy.elastic == pytest.approx(short[i].report.energy.elastic, rel=0.01)
        work = [states[i].report.energy.external - states[i - 1].report.energy.external for states in (long, short)]
        assert work[0] == pytest.approx(work[1], rel=0.12 if friction > 0.3 else 0.2)
