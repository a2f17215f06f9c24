"""The four scenes of the study: their runs, measured quantities, and errors against a reference.

(a) `cantilever`: clamped, an end load; tip and stress against quadratic finite elements.
(b) `hertz`: a disc between frictionless plates; force at three depths and half-width of the contact.
(c) `collision`: two discs, oblique, with friction; velocities and spin after they part.
(d) `packing`: 30 discs squeezed by a lid, with friction; work of the lid, pressure and aspect ratio.

What is measured becomes the rows of a member of the sweep: one at a time, position by position, or step by step of a
long run. Errors are computed later, against the reference of the scene, so that a finer
reference requires no new runs. Scenes (a) to (c) are run at several positions on the grid: the error
of a setting is the root mean square over them, quantity by quantity, and then the largest of the quantities.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import skmpm

from . import beam, competitor, discs, hertz, speeds, statics
from .meter import Meter
from .parameters import DEFAULT, Setting, effective

Measured = dict[str, Any]
ALL = frozenset(DEFAULT)


@dataclass(frozen=True)
class Case:
    """A scene of the study: measured at positions on the grid, or by one long run."""

    measure: Callable[[Setting, int, Meter], Measured] | None  # at one position on the grid
    errors: Callable[[Measured, Measured], dict[str, float]]  # of a run, against the reference, at one of them
    parameters: frozenset[str]  # that make a difference
    inertia: bool  # of implicit steps
    positions: int
    limit: float  # processor time [s] after which a run is stopped
    reference: Setting | None = None  # the run that is the reference; None: it is known without
    second: Setting | None = None  # as fine or nearly, for the floor: what the reference itself is uncertain by
    settings: tuple[Setting, ...] = ()  # all that is run, if not what the parameters ask for
    run: Callable[[Setting, Meter, Path], skmpm.Run] | None = None  # what `measure` is too long for
    against: str = ""  # the scene whose reference counts, if it is another


CONTACT = frozenset({"contact", "contact_tol"})
CASES = {
    "cantilever": Case(
        beam.cantilever,
        statics.known_errors,
        ALL - CONTACT - {"walls", "perturbed", "chosen"},
        inertia=False,
        positions=4,
        limit=200.0,
    ),
    "hertz": Case(
        hertz.hertz,
        statics.known_errors,
        ALL - {"perturbed", "chosen"},
        inertia=False,
        positions=12,
        limit=200.0,
    ),
    "collision": Case(
        discs.collision,
        discs.collision_errors,
        ALL - {"walls", "perturbed"},
        inertia=True,
        positions=2,
        limit=100.0,
        reference=DEFAULT | {"cells": 20.0, "spacing": 0.5, "pace": 1 / 8, "theta": 0.5},
        second=DEFAULT | {"cells": 14.0, "spacing": 0.5, "pace": 1 / 4, "theta": 0.5},
    ),
    "packing": Case(
        None,
        discs.packing_errors,
        ALL,
        inertia=True,
        positions=1,
        limit=200.0,
        reference=DEFAULT | {"cells": 12.0, "spacing": 0.5, "pace": 1 / 8},
        second=DEFAULT | {"cells": 12.0, "spacing": 0.5, "pace": 1 / 8, "perturbed": 1e-9},
        run=discs.packing,
    ),
}
CASES |= {
    name: Case(
        None,
        speeds.squeeze_errors,
        ALL,
        inertia=True,
        positions=1,
        limit=400.0,
        reference=DEFAULT | {"pace": speeds.finest(speed)},
        second=DEFAULT | {"pace": 2.0 * speeds.finest(speed)},
        settings=tuple(speeds.settings(speed)),
        run=run,
    )
    for speed, (name, run) in zip(speeds.SPEEDS, speeds.RUNS.items(), strict=True)
}
CASES |= {
    f"squeeze {speed:g}": replace(
        CASES[name],
        run=partial(speeds.squeeze, speed=speed, rested=False),
        reference=speeds.FINE,
        second=None,
        settings=tuple(speeds.resolutions()),
    )
    for speed, name in zip(speeds.SPEEDS, speeds.RUNS, strict=True)
}
ELEMENTS = {"packing": competitor.packing} | {
    f"squeeze {speed:g}": partial(competitor.squeeze, speed=speed) for speed in speeds.SPEEDS
}
CASES |= {
    f"elements, {name}": replace(
        CASES[name],
        measure=measure,
        run=None,
        reference=None,
        second=None,
        settings=tuple(competitor.settings(name)),
        against=name,
    )
    for name, measure in ELEMENTS.items()
}


def setting_on(name: str, setting: Setting) -> Setting:
    """The setting as far as it makes a difference on a scene."""
    case = CASES[name]
    return setting if case.against else effective(setting, case.parameters, inertia=case.inertia)


def measured(name: str, setting: Setting, meter: Meter) -> list[Measured]:
    """What a setting measures on a scene, position by position, each with what it cost."""
    case = CASES[name]
    assert case.measure is not None
    return [{"found": case.measure(setting, k, meter), "cost": meter.taken()} for k in range(case.positions)]


def errors_of(name: str, measured: list[Measured], reference: list[Measured] | None) -> dict[str, float]:
    """Relative errors by quantity, root mean square over the positions, and the largest of them."""
    case = CASES[name]
    known = reference or [{}] * case.positions
    each = [case.errors(m, r) for m, r in zip(measured, known, strict=True)]
    found = {name: float(np.sqrt(np.mean([one[name] ** 2 for one in each]))) for name in each[0]}
    return found | {"largest": max(found.values())}
