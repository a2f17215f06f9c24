"""The unknowns of a step that are not on a grid."""

from __future__ import annotations

import numpy as np

from skmpm.implicit import ScalarUnknowns
from skmpm.implicit.scalar_unknowns import RESPONSE
from skmpm.scene import PrescribedVelocities, Scene, State
from skmpm.scheme import Scheme
from skmpm.simulate.unknowns.interval import Interval
from skmpm.simulate.unknowns.periodic_box import StressedBox
from skmpm.simulate.unknowns.rigid_bodies import FreeBodies
from skmpm.simulate.unknowns.walls import DrivenWalls

FARTHEST = 0.5  # [cells] motion of an unknown in one iteration without inertia


def scalar_unknowns(
    scene: Scene, state: State, dt: float, scheme: Scheme, motions: PrescribedVelocities
) -> ScalarUnknowns | None:
    """The unknowns of a step of dt [s] that are not on a grid; None if there are none."""
    if not scene.has_scalar_unknowns:
        return None
    soft, farthest = None, np.inf
    if not scheme.inertia:
        shear = max(material.lame[1] for material in scene.materials)
        soft, farthest = RESPONSE * (scheme.theta * dt) ** 2 * shear, FARTHEST * scene.cell / dt
    interval = Interval(state.t + scheme.theta * dt, dt, scheme.theta, soft, farthest)
    box = StressedBox.of(scene, state, interval)
    v0 = box.inertia.v0
    moved = box.motions(v0, v0, motions) if v0.size else motions
    walls, bodies = DrivenWalls.of(scene, state, interval), FreeBodies.of(scene, state, moved, interval)
    kinds = [kind for kind in (box, walls, bodies) if kind.inertia.v0.size]
    return ScalarUnknowns(kinds, motions, dt, box if v0.size and scheme.inertia else None)
