"""The largest gap of a detected contact."""

from __future__ import annotations

from skmpm.scene import Scene

# [cells]; a point that approaches further within a Newton iteration is detected in the next one.
DETECTION_DISTANCE = 0.25
# The same over the range of cohesion: a gap that opens out of range within a step bears its tension to its end.
COHESION_DETECTION = 1.5


def contact_reach(scene: Scene) -> float:
    """Largest gap of a detected contact [m]."""
    cohesive = COHESION_DETECTION * scene.cohesion_range if scene.cohesive else 0.0
    return max(DETECTION_DISTANCE * scene.cell, cohesive)
