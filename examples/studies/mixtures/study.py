"""Rigid and soft discs in a periodic box under a growing pressure: solid fraction, coordination, forces.

    python -m examples.studies.mixtures --out out/mixtures    # run what is missing, write the page
    python -m examples.studies.mixtures figures               # draw the figure, write the page

Every member runs in two stages by `skmpm.sweep`: both edges of the box shorten until the packing bears the first
pressure; then the pressure grows to the last one, as exp(t), and stays for a tenth of that time. Steps are chosen
(``dt=None``). Then the page is written, as by `figures`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

import skmpm

from . import checks

D, DENSITY, YOUNG, POISSON = 2e-3, 1000.0, 1e6, 0.45  # mean diameter [m]; [kg/m3]; [Pa]
CELL = D / 8.0  # four cells in the mean radius
RATE, LOOSE = 1.0, 0.77  # [1/s]; solid fraction of the packing that is compressed
FIRST = 1e-3  # pressure over E at which the ramp begins
HOLD = 1.1  # end of the run, over the time of the ramp
NAN = float("nan")
Row = dict[str, float]


def packing(discs: int, share: float, seed: int) -> tuple[list[skmpm.Body], Callable[..., skmpm.Periodic]]:
    """Discs of 0.8 to 1.2 D, a share of which is rigid by number, and the periodic box, which takes its motion.

    A seed has the same places at all shares, and what is rigid at a smaller share is rigid at a larger one.
    """
    rng = np.random.default_rng(seed)
    radii = rng.uniform(0.4 * D, 0.6 * D, discs)
    rigid = rng.permutation(discs) < round(share * discs)
    width = float(np.sqrt(np.pi * np.sum(radii**2) / LOOSE))
    loose = skmpm.packing(radii, width, solid_fraction=LOOSE, periodic=True, seed=seed)
    soft, hard = skmpm.NeoHookean(E=YOUNG, nu=POISSON, density=DENSITY), skmpm.Rigid(DENSITY)
    places = zip(loose.centres.T, loose.radii, rigid, strict=True)
    bodies = [skmpm.Body(skmpm.disc(x, r, spacing=0.74 * CELL), hard if h else soft) for x, r, h in places]
    return bodies, partial(skmpm.Periodic, loose.width, loose.height)


def given(t: float, ramp: float, until: float) -> float:
    """The pressure over E at a time [s] after the ramp has begun."""
    return float(FIRST * (until / FIRST) ** np.clip(t / ramp, 0.0, 1.0))


def stages(
    discs: int, share: float, friction: float, until: float, ramp: float, seed: int, begun: float = 0.0
) -> list[skmpm.Scene]:
    """The packing in a box that shrinks, and in one whose pressure grows from a time [s] on."""
    bodies, box = packing(discs, share, seed)

    def stress(t: float) -> list[list[float]]:
        p = YOUNG * given(t - begun, ramp, until)
        return [[-p, NAN], [NAN, -p]]

    boxes = box(rate=[[-RATE, 0.0], [0.0, -RATE]]), box(stress=stress)
    return [skmpm.Scene(bodies, cell=CELL, friction=friction, periodic=each) for each in boxes]


def build(discs: int, share: float, friction: float, until: float, ramp: float, seed: int) -> skmpm.Run:
    """A member: a share of rigid discs, compacted to a pressure over E in the time of a ramp [s]."""
    squeezed, _ = stages(discs, share, friction, until, ramp, seed)

    def press(state: skmpm.State) -> skmpm.Run:
        _, pressed = stages(discs, share, friction, until, ramp, seed, state.t)
        begin = skmpm.continued(squeezed, state, pressed)
        observe = partial(row, state.t, ramp, until)
        return skmpm.Run(pressed, begin.t + HOLD * ramp, start=begin, observe=observe)

    full = -np.log(LOOSE) / 2.0 / RATE  # [s] the area of the box is that of the discs: never reached
    observe = partial(row, np.inf, ramp, until)
    return skmpm.Run(squeezed, full, observe=observe, stop=lambda line: line["pressure"] > FIRST, then=press)


def row(begun: float, ramp: float, until: float, scene: skmpm.Scene, state: skmpm.State) -> Row:
    """One line of the table; pressures are over E, that given is zero before the ramp begins."""
    seen, report = skmpm.observe(scene, state), state.report
    return {
        "given": given(state.t - begun, ramp, until) if state.t > begun else 0.0,
        "pressure": seen.pressure / YOUNG,
        "pressure_inside": checks.pressure(scene, state) / YOUNG,
        "solid_fraction": seen.solid_fraction,
        "solid_fraction_points": checks.solid_fraction(state),
        "coordination": seen.coordination_without_rattlers,
        "rattlers": float(np.isnan(seen.bodies.coordination_without_rattlers).mean()),
        "overlap": seen.overlap,
        "overlap_rigid": checks.overlap_of_rigid_discs(scene, state) / D,
        "unbalanced": report.unbalanced,
        "kinetic": report.energy.kinetic,
        "elastic": report.energy.elastic,
        "dt": report.dt,
        "retries": report.retries,
        "newton": report.newton,
        "contact": report.contact,
        "seconds": sum(report.seconds.values()),
    }


def members(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Parameters of `build`: every share at every friction, for every seed; slower ramps repeat one of them."""
    common = {"discs": options.discs, "until": options.until}
    each = [
        common | {"share": share, "friction": mu, "ramp": options.ramp, "seed": seed}
        for seed in range(options.seeds)
        for share in options.share
        for mu in options.friction
    ]
    middle = {"share": options.share[len(options.share) // 2], "friction": options.friction[-1], "seed": 0}
    return each + [common | middle | {"ramp": slower * options.ramp} for slower in options.slower]


def add_options(options: argparse.ArgumentParser) -> None:
    """Options; the defaults are the study of `docs/studies/mixtures.md`."""
    options.add_argument("--discs", type=int, default=48, help="number of discs")
    options.add_argument("--share", type=float, nargs="+", default=[0.0, 0.2, 0.5, 0.8], help="rigid, by number")
    options.add_argument("--friction", type=float, nargs="+", default=[0.0, 0.5], help="friction coefficients")
    options.add_argument("--until", type=float, default=0.1, help="pressure at the end, over E")
    options.add_argument("--ramp", type=float, default=0.1, help="time in which the pressure grows [s]")
    options.add_argument("--slower", type=float, nargs="*", default=[2.0], help="times of ramps that repeat a member")
    options.add_argument("--seeds", type=int, default=2, help="packings at each point")
