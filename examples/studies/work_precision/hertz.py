"""Scene (b) of the study: a disc between frictionless plates against Hertz."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

import skmpm

from .meter import Meter
from .parameters import Setting, scheme_of
from .statics import DENSITY, LAWS, NU, E, rotation, turned

Array = NDArray[np.float64]
Measured = dict[str, Any]

DEPTHS = (0.01, 0.02, 0.05)  # of each plate, d/R
TABLE = {0.01: (0.9993, 0.998), 0.02: (0.9985, 0.996), 0.05: (0.9946, 0.989)}  # FEM over formula: force, half-width
SEED = 5  # of the positions: offset on the grid, direction of the plates, angle of the disc's points
REACH, THICKNESS = 0.6, 3.0  # of plates made of points: half their length [R], their thickness [cells]


def hertz(setting: Setting, position: int, meter: Meter) -> Measured:
    """Force at each depth, and half-width of the contact at the largest, by its second moment."""
    cell, rng = 1.0 / setting["cells"], np.random.default_rng([SEED, position])
    offset, (angle, phase) = rng.random(2), 2.0 * np.pi * rng.random(2)
    middle, normal = cell * offset, rotation(angle)[:, 1]

    def speed(t: float) -> float:
        eps = 1e-4
        before, after = np.interp([t - eps, t + eps], range(4), [0.0, *DEPTHS])
        return float((after - before) / (2.0 * eps))

    scene = between_plates(setting, middle, angle, phase, speed)
    scheme, step = scheme_of(setting, inertia=False, solver=meter), 1.0 / max(1, round(1.0 / setting["pace"]))
    force, width, state = [], [], None
    for end in (1.0, 2.0, 3.0):  # a depth each
        *_, state = meter.states(scene, dt=step, until=end, scheme=scheme, start=state)
        push, moment = pressed(scene, state, middle, normal)
        force.append(push)
        width.append(float(np.sqrt(moment)))
    known = [reference(d) for d in DEPTHS]
    modulus = E / (1.0 - NU**2)
    off = {f"force {d:g}": abs(f / modulus / k[0] - 1.0) for d, f, k in zip(DEPTHS, force, known, strict=True)}
    return {
        "force": force,
        "width": width,
        "errors": off | {"width": abs(width[-1] / known[-1][1] - 1.0)},
    }


def between_plates(
    setting: Setting, middle: Array, angle: float, phase: float, speed: Callable[[float], float]
) -> skmpm.Scene:
    """A disc of radius 1 m, and plates of either kind that move towards it; `phase` turns its points."""
    cell, normal = 1.0 / setting["cells"], rotation(angle)[:, 1]
    spacing = setting["spacing"] * cell
    cloud = turned(skmpm.disc((0, 0), 1.0, spacing=spacing), phase, middle)
    bodies, walls = [skmpm.Body(cloud, LAWS[setting["material"]])], []
    for s in (1.0, -1.0):

        def velocity(t: float, s: float = s) -> Array:
            return -s * speed(t) * normal

        def motion(t: float, s: float = s) -> Array:
            return np.append(-s * speed(t) * normal, 0.0)

        if setting["walls"] == "planes":
            walls.append(skmpm.Wall(middle + s * normal, -s * normal, velocity=velocity))
        else:
            low = 1.0 if s > 0.0 else -1.0 - THICKNESS * cell
            plate = skmpm.box((-REACH, low), (2.0 * REACH, THICKNESS * cell), spacing=spacing)
            bodies.append(skmpm.Body(turned(plate, angle, middle), skmpm.Rigid(DENSITY), motion=motion))
    return skmpm.Scene(bodies, cell=cell, walls=walls)


def pressed(scene: skmpm.Scene, state: skmpm.State, middle: Array, normal: Array) -> tuple[float, float]:
    """Force along the normal, mean of both plates [N/m], and four times the second moment along the contact [m2]."""
    found, across = state.contacts, np.array([-normal[1], normal[0]])
    push = np.abs(normal @ found.vectors)
    own = (found.point >= 0) & (found.bodies[0] == 0)
    x = np.where(own, scene.initial_positions[:, np.where(own, found.point, 0)], found.x) - middle[:, None]
    force, moment = 0.0, 0.0
    for side in (normal @ x > 0.0, normal @ x < 0.0):
        share, at = push[side], across @ x[:, side]
        total = max(float(share.sum()), 1e-300)
        force += 0.5 * total
        moment += 0.5 * 4.0 * float(share @ (at - share @ at / total) ** 2) / total
    return force, moment


def formula(depth: float) -> tuple[float, float]:
    """Force over E* R and half-width over R of plane Hertz contact."""

    def off(force: float) -> float:
        return float(force / np.pi * (2.0 * np.log(4.0 / np.sqrt(4.0 * force / np.pi)) - 1.0) - depth)

    force = float(brentq(off, 1e-9, 0.3))
    return force, float(np.sqrt(4.0 * force / np.pi))


def reference(depth: float) -> tuple[float, float]:
    """The same as finite elements correct it."""
    (force, width), (more, wider) = formula(depth), TABLE[depth]
    return more * force, wider * width
