"""Common parts of the quasi-static scenes (a) and (b): materials, positions on the grid, load histories.

Explicit steps have inertia: there the load rises, or the plates move, as s - sin(2 pi s) / 2 pi over times that are
long compared with those of waves, and results are means over one period of the oscillation that follows.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

import skmpm

from .parameters import Setting

Array = NDArray[np.float64]
Measured = dict[str, Any]

E, NU, DENSITY = 1e6, 0.3, 1000.0
LAWS = {"linear": skmpm.LinearElastic(E, NU, DENSITY), "finite": skmpm.NeoHookean(E, NU, DENSITY)}
LAMBDA, MU = LAWS["linear"].lame
WAVE = float(np.sqrt((LAMBDA + 2.0 * MU) / DENSITY))  # [m/s]


def law(setting: Setting, own: str) -> Any:
    """The scene's own material, or the other one."""
    other = {"linear": "finite", "finite": "linear"}[own]
    return LAWS[own if setting["material"] == "own" else other]


def turned(points: skmpm.Points, angle: float, shift: Array) -> skmpm.Points:
    """Points turned about the origin, then moved."""
    return skmpm.Points(rotation(angle) @ points.x + shift[:, None], points.volume, points.outline)


def rotation(angle: float) -> Array:
    """By an angle, (2, 2)."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def known_errors(measured: Measured, reference: Measured, position: int) -> dict[str, float]:
    """The run itself has compared with what is known."""
    return dict(measured["errors"])


def rising(s: float, *, smooth: bool) -> float:
    """From 0 to 1 while s does: straight, or with no jump of velocity and acceleration."""
    s = min(max(s, 0.0), 1.0)
    return float(s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi)) if smooth else s


def means(seen: Iterable[tuple[Array, ...]]) -> list[Array]:
    """Means over states."""
    count, total = 0, []
    for one in seen:
        total, count = [a + b for a, b in zip(total, one, strict=True)] if count else list(one), count + 1
    return [a / count for a in total]
