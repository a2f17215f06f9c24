"""The scenes of the study: `compaction.py` with any Poisson's ratio, or in a periodic box that shrinks."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

import numpy as np

import skmpm
from examples import compaction
from skmpm.material import wave_speed

Array = np.ndarray

YOUNG, NU, DENSITY = 10e6, 0.45, 990.0  # of `compaction.py` [Pa], [-], [kg/m3]
WAVE = wave_speed(skmpm.NeoHookean(YOUNG, NU, DENSITY))  # of pressure waves [m/s]
PLANE = YOUNG / (1.0 - NU**2)  # E* [Pa]


def options_of(parameters: dict[str, Any]) -> argparse.Namespace:
    """All options of a member: its parameters over the defaults of `compaction.py`."""
    options = compaction.parser().parse_args([])
    vars(options).update({"nu": NU, "periodic": False} | parameters)
    return options


def build(options: argparse.Namespace) -> tuple[skmpm.Scene, float]:
    """The scene of a member, and the time [s] at which the final nominal solid fraction is reached."""
    if options.periodic:
        return shrinking(options)
    scene, until = compaction.build(options)
    if options.nu == NU:
        return scene, until
    other = skmpm.NeoHookean(E=YOUNG, nu=options.nu, density=DENSITY)
    return replace(scene, bodies=[replace(body, material=other) for body in scene.bodies]), until


def shrinking(options: argparse.Namespace) -> tuple[skmpm.Scene, float]:
    """Discs of the same radii in a square periodic box, both edges of which shorten at `options.speed`."""
    radii = np.random.default_rng(options.seed).uniform(0.7e-3, 1.2e-3, options.discs)
    solid = float(np.pi * (radii**2).sum())
    side = float(np.sqrt(solid / options.start))
    loose = skmpm.packing(radii, side, solid_fraction=options.start, periodic=True, seed=options.seed)
    gel = skmpm.NeoHookean(E=YOUNG, nu=options.nu, density=DENSITY)
    places = zip(loose.centres.T, loose.radii, strict=True)
    bodies = [skmpm.Body(skmpm.disc(x, r, spacing=options.spacing), gel) for x, r in places]
    width, height = float(loose.width), float(loose.height)

    def rate(t: float) -> list[list[float]]:
        way = options.speed * t
        return [[-options.speed / (width - way), 0.0], [0.0, -options.speed / (height - way)]]

    box = skmpm.Periodic(width, height, rate=rate)
    scene = skmpm.Scene(bodies, cell=options.cell, friction=options.friction, periodic=box)
    return scene, (side - float(np.sqrt(solid / options.until))) / options.speed
