"""A small packing compressed further by lids of four speeds.

The packing is at rest at a nominal solid fraction of 0.82 and is compressed by 5 % of its height. Errors are those of
time integration: the reference of each speed is the same grid with many implicit steps, so spatial errors cancel.
A setting's `pace` is 64 over the number of steps.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import skmpm

from . import discs
from .meter import Meter
from .parameters import BALANCED, DEFAULT, Setting, scheme_of

SPEEDS = (20.0, 2.0, 0.2, 0.02)  # of the lid [m/s]
DISCS, START, REST, STRAIN = 12, 0.65, 0.82, 0.05
STEPS = 64  # at pace 1
STILL = 60  # steps of 8 us in which the packing comes to rest
BINS = 5  # of the stroke, in which pressures are averaged
PACES = (16.0, 8.0, 4.0, 2.0, 1.0, 0.5, 0.25)
FINEST = {20.0: 0.4}  # pace of the reference, else 0.04: 160 steps, else 1600
FINE = DEFAULT | {"cells": 12.0, "spacing": 0.5, "pace": 0.25}  # the reference beside finite elements
Measured = dict[str, Any]

RADII = np.random.default_rng(3).uniform(0.7e-3, 1.2e-3, DISCS)


def packing(setting: Setting, speed: float) -> tuple[skmpm.Scene, float, float]:
    """Discs as loosely as they were packed, their height and the height of their material spread over the width."""
    scene, height, width = discs.box_of_discs(setting, RADII, START, seed=3, lid=speed)
    return scene, height, float(np.pi * (RADII**2).sum()) / width


def at_rest(setting: Setting, kept: Path) -> skmpm.State:
    """The packing squeezed to `REST` and left there; `kept` is the directory of the file that keeps it."""
    path = kept / f"rest_{setting['cells']:g}_{setting['spacing']:g}.checkpoint"
    if path.exists():
        return skmpm.load(path)
    scene, height, thick = packing(setting, 2.0)
    *_, state = skmpm.simulate(scene, dt=8e-6, until=(height - thick / REST) / 2.0)
    still, *_ = packing(setting, 0.0)
    *_, state = skmpm.simulate(still, dt=8e-6, until=state.t + STILL * 8e-6, start=state)
    state = replace(state, v=0.0 * state.v, C=0.0 * state.C, t=0.0)
    path.parent.mkdir(parents=True, exist_ok=True)
    skmpm.save(path, state)
    return state


def squeeze(setting: Setting, meter: Meter, kept: Path, *, speed: float, rested: bool = True) -> skmpm.Run:
    """Rows of pressure and force of the lid against its way from `REST` on over the height; 0 before.

    The run begins at rest, or from the loose packing.
    """
    scene, height, thick = packing(setting, speed)
    start = at_rest(setting, kept) if rested else None
    rest = thick / REST if start is None else float(start.walls[1, 1])
    way = STRAIN if rested else height / rest - 1.0 + STRAIN
    until, steps = way * rest / speed, max(1, round(STEPS / setting["pace"] * way / STRAIN))
    scheme = scheme_of(setting, inertia=True, solver=meter)

    def look(scene: skmpm.Scene, state: skmpm.State) -> dict[str, float]:
        top = float(state.walls[1, 1])
        return {"way": max(0.0, 1.0 - top / rest), **discs.pressures(scene, state, thick / top)}

    dt = None if setting["chosen"] else until / steps
    return skmpm.Run(scene, until, dt=dt, scheme=scheme, start=start, observe=look, simulate=meter.states)


def squeeze_errors(measured: Measured, reference: Measured) -> dict[str, float]:
    """Sum of differences of mean pressures over `BINS` parts of the stroke over their sum, and error of the work.

    A step's force acts all along its way.
    """
    edges = np.linspace(0.0, STRAIN, BINS + 1)
    found = {}
    for name in ("pressure", "lid"):
        mine, known = (_integral(m, name, edges) for m in (measured, reference))
        found[name] = float(np.abs(mine - known).sum() / np.abs(known).sum())
    return found


def _integral(measured: Measured, name: str, edges: Any) -> Any:
    way = np.append(0.0, measured["way"])
    total = np.append(0.0, np.cumsum(np.array(measured[name]) * np.diff(way)))
    return np.diff(np.interp(edges, way, total))


def settings(speed: float) -> list[Setting]:
    """Steps of all lengths down to four times the reference's, and chosen ones."""
    given = [DEFAULT | {"pace": step_control} for step_control in PACES if step_control >= 4.0 * finest(speed)]
    return [*given, DEFAULT | {"chosen": True}]


def resolutions() -> list[Setting]:
    """Grids and steps that are compared with finite elements, against `FINE`."""
    return [BALANCED | {"cells": cells, "pace": pace} for pace in (16.0, 4.0, 1.0) for cells in (3.2, 5.0, 8.0)]


def finest(speed: float) -> float:
    """Pace of the reference.

    At 20 m/s it is not smaller, for pressures do not settle: they rise by a per cent with every halving, down to
    steps of 0.02 h/c at least. Overlaps pushed out are not the reason, their work is 1e-7 of the lid's.
    """
    return FINEST.get(speed, 0.04)


RUNS = {f"lid {speed:g}": partial(squeeze, speed=speed) for speed in SPEEDS}
