"""Scenes (c) and (d) of the study: two discs that collide, 30 discs that a lid compacts; references are fine runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import skmpm
from skmpm.scene import fitted_motions

from .meter import Meter
from .parameters import Setting, scheme_of
from .statics import rotation

Array = NDArray[np.float64]
Measured = dict[str, Any]

# Two discs, off centre by one radius, that approach at 0.2 m/s, a sixth of the speed of sound.
R, E, NU, DENSITY, SPEED, FRICTION = 0.2, 1000.0, 0.3, 1000.0, 0.1, 0.3
LAWS = {"own": skmpm.NeoHookean(E, NU, DENSITY), "other": skmpm.LinearElastic(E, NU, DENSITY)}
COLLISION_DT = 0.02  # [s]
PARTED = 2.2  # [s]
POSITIONS = ((0.3, 0.4, 0.0), (0.62, 0.17, 0.9))  # offset on the grid [cells], angle

# The packing: the main job in small.
DISCS, START, END, LID, FRICTIONAL = 30, 0.70, 0.92, 2.0, 0.5
SOFT = {"E": 10e6, "nu": 0.45, "density": 990.0}
GELS = {"own": skmpm.NeoHookean(**SOFT), "other": skmpm.LinearElastic(**SOFT)}
MEAN = 0.95e-3  # radius [m]
RADII = np.random.default_rng(0).uniform(0.7e-3, 1.2e-3, DISCS)
SMALLEST = float(RADII.min())
PACKING_DT = 8e-6  # [s]
EDGES = np.linspace(0.84, 0.92, 9)  # nominal solid fractions between which pressures are averaged
WORK = 0.90  # up to here the work of the lid counts
MARKS = 0.0005  # of the solid fraction, whose multiples outlines are looked at at
THICKNESS = 3.0  # of walls made of points [cells]


def time_step(setting: Setting, own: float) -> float | None:
    """The scene's own step times the pace; None where steps are chosen."""
    return None if setting["chosen"] else float(own * setting["pace"])


def collision(setting: Setting, position: int, meter: Meter) -> Measured:
    """Velocity of the first disc along and across the line of approach over its speed, and R omega over it."""
    cell, (*offset, angle) = R / setting["cells"], POSITIONS[position]
    turn = rotation(angle)
    material, apart = LAWS[setting["material"]], 2.0 * R * np.sqrt(0.75) + 0.02 * R
    bodies = []
    for centre, v in (((0.0, 0.0), (SPEED, 0.0)), ((apart, R), (-SPEED, 0.0))):
        cloud = skmpm.disc(turn @ centre + cell * np.array(offset), R, spacing=setting["spacing"] * cell)
        bodies.append(skmpm.Body(cloud, material, velocity=turn @ v))
    scene = skmpm.Scene(bodies, cell=cell, friction=FRICTION)
    scheme = scheme_of(setting, inertia=True, solver=meter)
    dt = time_step(setting, COLLISION_DT)
    *_, state = meter.states(scene, dt=dt, until=PARTED, scheme=scheme)
    *mean, spin = fitted_motions(state.x, state.v, state.mass, state.body)[:, 0]
    along, across = turn.T @ mean / SPEED
    contact = float(state.contacts.force[0].max(initial=0.0))
    return {"along": float(along), "across": float(across), "spin": float(R * spin / SPEED), "touching": contact}


def collision_errors(measured: Measured, reference: Measured) -> dict[str, float]:
    """Of the change of velocity, along and across, and of the spin, over the reference's; infinite if not apart."""
    apart = 0.0 if measured["touching"] == 0.0 else float("inf")
    before = {"along": 1.0, "across": 0.0, "spin": 0.0}
    return {
        name: apart + abs(measured[name] - reference[name]) / abs(reference[name] - start)
        for name, start in before.items()
    }


def packing(setting: Setting, meter: Meter, kept: Path) -> skmpm.Run:
    """Rows against the nominal solid fraction: pressure, force of the lid, and from time to time aspect ratios."""
    scene, height, width = box_of_discs(setting, RADII, START)
    solid = float(scene.initial_volumes[: scene.offsets[DISCS]].sum())
    scheme = scheme_of(setting, inertia=True, solver=meter)
    dt = time_step(setting, PACKING_DT)
    until = (height - solid / (width * END)) / LID

    def look(scene: skmpm.Scene, state: skmpm.State) -> dict[str, float]:
        return watched(scene, state, solid / width, height)

    return skmpm.Run(scene, until, dt=dt, scheme=scheme, observe=look, simulate=meter.states)


def width_of(radii: Array) -> float:
    """Width of the box of some discs [m]."""
    return float(np.sqrt(np.pi * (radii**2).sum() / 0.72))


def stride(radii: Array, squeeze: float, steps: float) -> float:
    """Way of the lid in one of so many steps over the radius of the smallest disc.

    In all it moves by `squeeze` times the height of the material spread over the width.
    """
    height = np.pi * (radii**2).sum() / width_of(radii)
    return float(squeeze * height / steps / radii.min())


def box_of_discs(
    setting: Setting, radii: Array, fraction: float, *, seed: int = 0, lid: float = LID
) -> tuple[skmpm.Scene, float, float]:
    """Discs of the radii of Nezamabadi et al. (2017) in a box under a lid, its height and width."""
    width, cell = width_of(radii), MEAN / setting["cells"]
    packing = skmpm.packing(radii, width, solid_fraction=fraction, seed=seed)
    centres, height = packing.centres, float(packing.height)
    if setting["perturbed"]:
        centres = centres + setting["perturbed"] * MEAN * np.random.default_rng(1).normal(size=centres.shape)
    material, spacing = GELS[setting["material"]], setting["spacing"] * cell
    bodies = [
        skmpm.Body(skmpm.disc(centre, radius, spacing=spacing), material)
        for centre, radius in zip(centres.T, packing.radii, strict=True)
    ]
    if setting["walls"] == "planes":
        return skmpm.Scene(bodies, cell=cell, walls=planes(width, height, lid), friction=FRICTIONAL), height, width
    bodies += slabs(width, height, cell, spacing, lid)
    return skmpm.Scene(bodies, cell=cell, friction=FRICTIONAL), height, width


def planes(width: float, height: float, lid: float, friction: float = FRICTIONAL) -> list[skmpm.Wall]:
    """Floor, lid, left, right; as rough as the discs, for walls of points cannot be otherwise."""
    rough = {"friction": friction}
    return [
        skmpm.Wall((0.0, 0.0), (0.0, 1.0), **rough),
        skmpm.Wall((0.0, height), (0.0, -1.0), velocity=(0.0, -lid), **rough),
        skmpm.Wall((0.0, 0.0), (1.0, 0.0), **rough),
        skmpm.Wall((width, 0.0), (-1.0, 0.0), **rough),
    ]


def slabs(width: float, height: float, cell: float, spacing: float, lid: float) -> list[skmpm.Body]:
    """The same walls of material points."""
    thick = THICKNESS * cell
    boxes = (
        ((-thick, -thick), (width + 2.0 * thick, thick)),
        ((0.02 * cell, height), (width - 0.04 * cell, thick)),
        ((-thick, 0.02 * cell), (thick, 1.1 * height)),
        ((width, 0.02 * cell), (thick, 1.1 * height)),
    )
    rigid = skmpm.Rigid(SOFT["density"])
    clouds = [skmpm.box(corner, size, spacing=spacing) for corner, size in boxes]
    return [skmpm.Body(c, rigid, motion=(0.0, -lid * (k == 1), 0.0)) for k, c in enumerate(clouds)]


def watched(scene: skmpm.Scene, state: skmpm.State, thickness: float, height: float) -> dict[str, float]:
    """A row; `thickness` is the height of all material, spread over the width [m].

    The aspect ratio is that of steps in which the solid fraction passes a multiple of `MARKS`, nan in others.
    """
    before, fraction = (thickness / (height - LID * t) for t in (state.t - state.report.dt, state.t))
    looked = np.floor(fraction / MARKS) > np.floor(before / MARKS)
    alpha = float(skmpm.observe(scene, state).aspect_ratio) if looked else np.nan
    return {"fraction": fraction, **pressures(scene, state, fraction), "alpha": alpha}


def pressures(scene: skmpm.Scene, state: skmpm.State, fraction: float) -> dict[str, float]:
    """Of the contact forces (Love and Weber), for both kinds of walls [Pa], and the force on the lid [N/m]."""
    found, soft = state.contacts, scene.deformable
    force, centre = found.vectors, state.centres
    trace = 0.0
    for body, sign in zip(found.bodies, (1.0, -1.0), strict=True):
        mine = (body >= 0) & soft[body]
        trace += sign * float((force * (found.x - centre[:, body]))[:, mine].sum())
    area = float(scene.initial_volumes[soft[state.body]].sum()) / fraction
    lid = (found.bodies == -2) if scene.walls else (found.bodies == DISCS + 1)
    return {"pressure": -0.5 * trace / area, "lid": float(force[1] @ (1.0 * lid[0] - lid[1]))}


def packing_errors(measured: Measured, reference: Measured) -> dict[str, float]:
    """Relative errors of the lid's work up to `WORK`, and of pressure and alpha - 1 above.

    Of the last two, the sum of differences between means over intervals of 0.01, over the sum of the reference's.
    """
    work, expected = (
        _integral(m, "lid", lambda f: 1.0 / f**2, np.array([START, WORK])) for m in (measured, reference)
    )
    found = {"work": abs(float(work[0] / expected[0]) - 1.0)}
    for name in ("pressure", "alpha"):
        mean, expected = (_integral(m, name, np.ones_like, EDGES) / np.diff(EDGES) for m in (measured, reference))
        least = 1.0 if name == "alpha" else 0.0
        found[name] = float(np.abs(mean - expected).sum() / (expected - least).sum())
    return found


def _integral(measured: Measured, name: str, weight: Any, edges: Array) -> Array:
    """Integrals of a curve times a weight over the solid fraction, between edges."""
    seen = [(f, y) for f, y in zip(measured["fraction"], measured[name], strict=True) if not np.isnan(y)]
    seen.append((max(seen[-1][0], edges[-1]), seen[-1][1]))  # the last look is a little before the end
    fraction, values = np.array(seen).T
    values = values * weight(fraction)
    total = np.append(0.0, np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(fraction)))
    return np.diff(np.interp(edges, fraction, total))
