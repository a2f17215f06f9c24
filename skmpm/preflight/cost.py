"""How many steps a run takes, and how long, to an order of magnitude."""

from __future__ import annotations

from dataclasses import replace
from math import ceil

import numpy as np

from skmpm.arrays import Array
from skmpm.scene import Scene
from skmpm.scheme import Scheme
from skmpm.step.driven import check_driven
from skmpm.step.initial_state import initial
from skmpm.step.step_length import pace_of

# Of docs/studies/performance.md, on one thread [s]: a step, a point of it, one where things can touch, an unknown and
# squared half bandwidth of a banded matrix, an unknown of multigrid; quasi-static steps over those with inertia.
STEP, POINT, CONTACT, BAND, MULTIGRID, QUASISTATIC = 4e-3, 0.9e-6, 1.7e-6, 1e-10, 7e-6, 2.5
PARTS = 32  # of a run, in whose middles lengths of steps are looked at


def seconds_of_step(
    points: int, unknowns: int, width: int, solver: str, *, touches: bool = True, inertia: bool = True
) -> float:
    """The time of a step [s]; steps in which contacts rearrange take several times as long."""
    matrix = BAND * width**2 if solver == "banded" else MULTIGRID
    seconds = STEP + points * (POINT + (CONTACT if touches else 0.0)) + unknowns * matrix
    return seconds if inertia else QUASISTATIC * seconds


def first_step(scene: Scene, scheme: Scheme) -> float:
    """The length of the first step where steps are chosen [s]; 1 s if nothing limits it."""
    dt = _lengths(scene, scheme, np.zeros(1), 0.0)[0]
    return float(dt) if np.isfinite(dt) else 1.0


def chosen_steps(scene: Scene, scheme: Scheme, until: float) -> int:
    """The number of steps of a run without dt, if neither Newton's method nor losses shorten any."""
    parts = until * (np.arange(PARTS) + 0.5) / PARTS
    return ceil(float((until / PARTS / np.minimum(_lengths(scene, scheme, parts, until), until)).sum()) - 1e-9)


def _lengths(scene: Scene, scheme: Scheme, times: Array, until: float) -> Array:
    """The longest steps from some times of a run [s], with the motion of bodies at its beginning."""
    check_driven("preflight", scene, scheme)
    state, pace = initial(scene, scheme=scheme), pace_of(scene, scheme, 0.0, until)
    return np.array([pace.limit(scene, replace(state, t=float(t)), np.inf) for t in times])
