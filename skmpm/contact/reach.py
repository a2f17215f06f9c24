"""The largest gap of a detected contact."""

from __future__ import annotations

from skmpm.scene import Scene

# [cells]; a point that approaches further within a Newton iteration is detected in the next one.
DETECTION_DISTANCE = 0.25


def contact_reach(scene: Scene) -> float:
    """Largest gap of a detected contact [m]."""
    return max(DETECTION_DISTANCE * scene.cell, scene.cohesion_range if scene.cohesive else 0.0)
