"""What a member observes: the row of its table for every step."""

from __future__ import annotations

import numpy as np

import skmpm

Row = dict[str, float]
REPORTED = ("retries", "newton", "residual", "unbalanced")
SEEN = ("solid_fraction", "solid_fraction_nominal", "pressure", "contact_surface", "anisotropy", "aspect_ratio",
        "coordination", "coordination_without_rattlers", "overlap")  # fmt: skip
WALLS = ("floor", "roof", "left", "right")
INTERIOR = {
    "interior_fraction": "solid_fraction",
    "interior_pressure": "pressure",
    "interior_coordination": "coordination",
    "interior_coordination_without_rattlers": "coordination_without_rattlers",
}  # what they are in a periodic box, which has no walls


def row(scene: skmpm.Scene, state: skmpm.State) -> Row:
    """One line of the table; the sweep adds the time."""
    report, seen = state.report, skmpm.observe(scene, state)
    line = {name: getattr(report, name) for name in REPORTED} | {name: getattr(seen, name) for name in SEEN}
    line |= {
        "pressure_points": of_points(scene, state, seen),
        "kinetic": report.energy.kinetic,
        "elastic": report.energy.elastic,
        "contact_iterations": report.contact,
        "seconds": sum(report.seconds.values()),
    }
    return line | (between_walls(scene, state, seen) if scene.walls else {})


def between_walls(scene: skmpm.Scene, state: skmpm.State, seen: skmpm.Observables) -> Row:
    """What only a box of walls has: their pressures, an interior, and the motion of the discs in it."""
    inner = skmpm.observe(scene, state, interior=True)
    kinetic_discs, swing = motion(scene, state, seen.bodies.centre)
    line = {f"pressure_{wall}": p for wall, p in zip(WALLS, seen.wall_pressure, strict=True)}
    line |= {name: getattr(inner, of) for name, of in INTERIOR.items()}
    return line | {"kinetic_discs": kinetic_discs, "swing": swing}


def of_points(scene: skmpm.Scene, state: skmpm.State, seen: skmpm.Observables) -> float:
    """Pressure of the points over the box [Pa]: their stress, and their motion relative to the centre of their disc.

    That is what contact forces carry; `Observables.pressure_points` has the motion of the discs in it as well.
    """
    volume = np.add.reduceat(state.volume, scene.offsets[:-1])
    box = np.ptp(state.walls, axis=0).prod() if state.box is None else np.linalg.det(state.box)
    return float(seen.bodies.pressure_points @ volume / box)


def motion(scene: skmpm.Scene, state: skmpm.State, centre: np.ndarray) -> tuple[float, float]:
    """Sums over the discs of M V.(V - c')/2 [J/m] and of M V.(X - c) [J s/m], c the middle of the box.

    By the virial theorem walls feel what contacts carry, plus the first over the area of the box, less half the rate
    of the second over it (R. Clausius, Philosophical Magazine 40 (1870) 122-127). `centre` (2, bodies), X.
    """
    start = scene.offsets[:-1]
    momentum, mass = (np.add.reduceat(a, start, axis=-1) for a in (state.mass * state.v, state.mass))
    middle, drift = 0.5 * state.walls.sum(axis=0), 0.5 * scene.wall_velocities(state.t).sum(axis=0)
    kinetic = 0.5 * np.sum(momentum * (momentum / mass - drift[:, None]))
    return float(kinetic), float(np.sum(momentum * (centre - middle[:, None])))
