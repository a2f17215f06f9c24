"""The packing and the lids by the competitor, finite elements in explicit steps with penalty contact (`penalty.py`).

A setting has `mesh`, `penalty`, `courant` and `damping` as `penalty.Discs` has them, and `mass`, by which densities
are multiplied so that steps are longer (mass scaling).
"""

from __future__ import annotations

from typing import Any

import numpy as np

import skmpm

from . import discs, speeds
from .meter import Meter
from .parameters import Setting
from .penalty import Discs

DEFAULT: Setting = {"mesh": 6, "penalty": 2.0, "courant": 0.9, "damping": 0.1, "mass": 1.0}
MESHES = 4, 6, 8, 12
HEAVIER = {"squeeze 0.2": (1e2, 1.0), "squeeze 0.02": (1e4, 1e2, 1.0)}  # masses: lids as if at 2 m/s
LOOKS = 1000  # at a run
Measured = dict[str, Any]


def loose(setting: Setting, radii: Any, fraction: float, seed: int) -> Discs:
    """Discs as the study packs them, and their box."""
    width = discs.width_of(radii)
    packed = skmpm.packing(radii, width, solid_fraction=fraction, seed=seed)
    soft = discs.SOFT | {"density": setting["mass"] * discs.SOFT["density"]}
    numerical = {name: setting[name] for name in ("mesh", "penalty", "courant", "damping")}
    box = width, float(packed.height)
    return Discs(packed.centres, packed.radii, skmpm.NeoHookean(**soft), box, discs.FRICTIONAL, **numerical)


def squeezed(found: Discs, speed: float, until: float, meter: Meter) -> Measured:
    """Rows until the lid is at a height [m]: solid fraction, pressure [Pa], lid force [N/m], aspect ratio."""
    solid, rows = float(np.pi * (found.radii**2).sum()), []
    found.seconds, found.steps = 0.0, 0
    total = int(np.ceil((found.top - until) / (speed * found.dt)))
    for steps in np.diff(np.linspace(0, total, min(total, LOOKS) + 1).round().astype(int)):
        lid = found.advance(int(steps), speed)
        area = found.width * found.top
        rows.append((found.top, solid / area, found.virial() / area, lid, found.aspect_ratio()))
    meter.seconds, meter.steps, meter.points = found.seconds, found.steps, found.radii.size * found.mesh.mass.size
    meter.unknowns = 2 * meter.points
    columns = [[float(f"{value:.7g}") for value in column] for column in zip(*rows, strict=True)]
    return dict(zip(("top", "fraction", "pressure", "lid", "alpha"), columns, strict=True))


def packing(setting: Setting, position: int, meter: Meter) -> Measured:
    """Scene (d)."""
    found = loose(setting, discs.RADII, discs.START, 0)
    solid = float(np.pi * (found.radii**2).sum())
    return squeezed(found, discs.LID, solid / (found.width * discs.END), meter)


def squeeze(setting: Setting, position: int, meter: Meter, *, speed: float) -> Measured:
    """A lid, from the loose packing on."""
    found = loose(setting, speeds.RADII, speeds.START, 3)
    rest = float(np.pi * (found.radii**2).sum()) / (found.width * speeds.REST)
    rows = squeezed(found, speed, (1.0 - speeds.STRAIN) * rest, meter)
    return rows | {"way": [max(0.0, 1.0 - top / rest) for top in rows["top"]]}


def settings(scene: str) -> list[Setting]:
    """Meshes and penalties; slow lids also with more mass."""
    each = [DEFAULT | {"mesh": mesh, "penalty": penalty} for mesh in MESHES for penalty in (1.0, 2.0, 4.0)]
    return [setting | {"mass": mass} for mass in HEAVIER.get(scene, (1.0,)) for setting in each]
