"""Common parts of the quasi-static scenes (a) and (b): materials and positions on the grid."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import skmpm

Array = NDArray[np.float64]
Measured = dict[str, Any]

E, NU, DENSITY = 1e6, 0.3, 1000.0
LAWS = {"own": skmpm.LinearElastic(E, NU, DENSITY), "other": skmpm.NeoHookean(E, NU, DENSITY)}
LAMBDA, MU = LAWS["own"].lame


def turned(points: skmpm.Points, angle: float, shift: Array) -> skmpm.Points:
    """Points turned about the origin, then moved."""
    return skmpm.Points(rotation(angle) @ points.x + shift[:, None], points.volume, points.outline)


def rotation(angle: float) -> Array:
    """By an angle, (2, 2)."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def known_errors(measured: Measured, reference: Measured) -> dict[str, float]:
    """The run itself has compared with what is known."""
    return dict(measured["errors"])
