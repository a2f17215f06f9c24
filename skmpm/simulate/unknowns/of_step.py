"""The unknowns of a step that are not on a grid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skmpm.implicit import ScalarUnknowns
from skmpm.implicit.scalar_unknowns import RESPONSE, Unknowns
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
    interval, box = Interval(state.t + scheme.theta * dt, dt, scheme.theta, soft, farthest), None
    kinds, moved = list[Unknowns](), motions
    if scene.periodic is not None and scene.periodic.components.size:
        box = StressedBox.of(scene, scene.periodic, state, interval)
        kinds, moved = [box], box.motions(box.inertia.v0, box.inertia.v0, motions)
    if scene.driven_walls.size:
        kinds.append(DrivenWalls.of(scene, state, interval, _size(kinds)))
    if scene.free_rigid.size:
        kinds.append(FreeBodies.of(scene, state, moved, interval, _size(kinds)))
    return ScalarUnknowns(kinds, motions, box if scheme.inertia else None)


def _size(kinds: Sequence[Unknowns]) -> int:
    """Number of unknowns of some kinds."""
    return sum(kind.inertia.v0.size for kind in kinds)
