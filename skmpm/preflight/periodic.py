"""Warnings about periodic boxes in which nothing bears what acts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from skmpm.preflight.metrics import SceneMetrics
from skmpm.scene import Scene
from skmpm.scheme import Scheme
from skmpm.simulate.loading import gravity_of


def periodic_warnings(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Iterator[str]:
    """Gravity with nothing that holds the packing, and tension that no contact bears."""
    if scene.periodic is None:
        return
    gravity = gravity_of(scene)
    holds = scene.supports or scene.springs or not scene.movable.all()
    if gravity.any() and not holds:
        x, y = gravity
        yield (
            f"periodic: gravity = ({x:g}, {y:g}) m/s2 accelerates the whole packing for ever, as nothing holds it;"
            " use no gravity, or a Support, a Spring or a rigid body with motion"
        )
    pull = scene.periodic.stress_at(0.0)[np.equal(*scene.periodic.components)]
    if (pull > 0.0).any() and metrics.cohesion == 0.0:
        yield (
            f"periodic: stress = {pull.max():g} Pa is tension, which contacts without cohesion do not bear, and the"
            " box grows for ever; use a negative stress for a pressure, or cohesion"
        )
