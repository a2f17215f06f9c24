"""Warnings about cohesive contacts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from skmpm import outline
from skmpm.contact.cohesion import CLOSED_GAP
from skmpm.material import youngs_modulus
from skmpm.preflight.limit import Limit, above, below, rounded_down, rounded_up
from skmpm.preflight.metrics import SceneMetrics
from skmpm.scene import Scene
from skmpm.scheme import Scheme

COHESION = Limit(0.1, "pull-off was verified up to a tenth of Young's modulus")  # test_adhesion
PEELING = Limit(0.5, "with less, flat blocks come off up to 10 % too early")  # test_adhesion
ZONE = Limit(2.5, "with less, a round body comes off at the force of a few boundary points")  # test_adhesion


def cohesion_warnings(scene: Scene, metrics: SceneMetrics, scheme: Scheme) -> Iterator[str]:
    """Cohesion that is large beside a modulus, and ranges that are short beside elastic opening or spacing.

    Where the stress at single boundary points scatters, those that bear c open by a share of c h / E.
    """
    if metrics.cohesion == 0.0:
        return
    c = metrics.cohesion
    E, b = min((youngs_modulus(m), b) for b, body in enumerate(scene.bodies) for m in body.materials)
    if above(c / E, COHESION):
        remedy = f"use {rounded_down(COHESION.value * E)} Pa or less"
        yield f"body {b}: cohesion = {c:g} Pa is {c / E:.3g} of E; {COHESION.where}; {remedy}"
    range_ = max(scene.cohesion_range / metrics.cell, CLOSED_GAP)  # [cells]
    if below(range_ * E / c, PEELING):
        remedy = f"use cohesion_range = {rounded_up(PEELING.value * c / E * metrics.cell)} m or more"
        yield f"body {b}: range is {range_ * E / c:.2g} of cohesion / E cells; {PEELING.where}; {remedy}"
    boundary, x = scene.outlines, scene.initial_positions[:, scene.outlines.point]
    bodies = len(scene.bodies)
    corners = np.bincount(boundary.body, outline.curve(boundary, x).corner, bodies)
    count = np.maximum(np.bincount(boundary.body, minlength=bodies), 1)
    radius = metrics.resolution * metrics.cell
    half_width = np.sqrt(2.0 * radius * scene.cohesion_range)
    points = half_width / (outline.perimeter(boundary, x, bodies) / count)[metrics.own]
    points = np.where(corners[metrics.own] > 0, np.inf, points)
    if below(float(points.min()), ZONE):
        i = int(np.argmin(points))
        remedy = "use a larger cohesion_range or a smaller spacing"
        yield f"body {metrics.own[i]}: range covers {points[i]:.2g} boundary points a side; {ZONE.where}; {remedy}"
