"""How far contact looks: the largest gap of a detected contact, and the largest motion in a step."""

from __future__ import annotations

import numpy as np

from skmpm.scene import Scene

MAX_MOTION = 1.0  # [cells] of a point in one step; contact detection finds penetrations of less than a cell
MAX_THICKNESS_SHARE = 0.25  # the same, over the thickness of the thinnest part of all bodies


# [cells]; a point that approaches further within a Newton iteration is detected in the next one.
DETECTION_DISTANCE = 0.25


def contact_reach(scene: Scene) -> float:
    """Largest gap of a detected contact [m]."""
    return max(DETECTION_DISTANCE * scene.cell, scene.cohesion_range if scene.cohesive else 0.0)


def max_motion(scene: Scene) -> float:
    """Largest motion of a point in a step, relative to the mean, between bodies with outlines [m]."""
    thinnest = float(np.min(scene.thickness[~np.isnan(scene.thickness)], initial=np.inf))
    return max(MAX_MOTION * scene.cell, MAX_THICKNESS_SHARE * thinnest if np.isfinite(thinnest) else 0.0)
