"""Collisions of discs: what they keep, what they lose, and a chain of five against one dimension.

All discs have R = 0.2 m, density 1000 kg/m3, nu = 0.3 and, but for the chain, E = 1 kPa: Sulsky's two discs, whose
speed of 0.1 m/s is a tenth of that of sound.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from ledger import Row, numbers
from scipy.integrate import solve_ivp

from skmpm import linear
from skmpm.material import LinearElastic, NeoHookean
from skmpm.points import Points, disc
from skmpm.scene import Body, Scene
from skmpm.scheme import Scheme
from skmpm.simulate import initial, simulate

R, E, NU, DENSITY, SPEED = 0.2, 1000.0, 0.3, 1000.0, 0.1
MASS = np.pi * R**2 * DENSITY
SOLVERS = {"banded": linear.banded, "amg": linear.amg}
CASES = 20  # of the table


@dataclass(frozen=True)
class Place:
    """How the line of centres lies on the grid."""

    turn: float  # against the x axis [rad]
    offset: tuple[float, float]  # [cells]


def places(count, seed=4):
    draw = np.random.default_rng(seed)
    return [Place(draw.uniform(0.0, 2.0 * np.pi), tuple(draw.uniform(0.0, 1.0, 2))) for _ in range(count)]


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def bodies(centres, velocities, material, place, cell):
    """Discs at centres (2, k) with velocities (2, k), both along and across the line of centres."""
    Q, points = rotation(place.turn), disc((0.0, 0.0), R, spacing=0.5 * cell)
    at = Q @ centres + cell * np.array(place.offset)[:, None]
    clouds = [Points(Q @ points.x + c[:, None], points.volume, points.outline) for c in at.T]
    return [Body(cloud, material, velocity=v) for cloud, v in zip(clouds, (Q @ velocities).T, strict=True)]


def pair(*, cells=5, impact=0.0, friction=0.0, place, speed=SPEED, gap=0.02):
    """Two NeoHookean discs that approach along x at twice the speed, off centre by `impact` radii."""
    cell, apart = R / cells, 2.0 * R * np.sqrt(1.0 - 0.25 * impact**2) + gap * R
    centres = np.array([[0.0, apart], [0.0, impact * R]])
    velocities = np.array([[speed, -speed], [0.0, 0.0]])
    return Scene(bodies(centres, velocities, NeoHookean(E, NU, DENSITY), place, cell), cell=cell, friction=friction)


def second_moments(state, cell):
    """Of the shape functions about each point, h^2 xi (1 - xi), (2, n) [m2]."""
    xi = state.x_anchor / cell - np.floor(state.x_anchor / cell)
    return cell**2 * xi * (1.0 - xi)


def angular_momentum(state, cell):
    """Of the points and of their affine fields, sum m (x x v + F D C')."""
    affine = np.einsum("ikn,kn,jkn->ijn", state.F, second_moments(state, cell), state.C)
    orbital = state.x[0] * state.v[1] - state.x[1] * state.v[0]
    return float(state.mass @ (orbital + affine[0, 1] - affine[1, 0]))


@dataclass(frozen=True)
class Collision:
    """What two discs kept and lost, as shares of what there was."""

    restitution: float  # of the centres of mass, along the line of centres at the start
    momentum: float  # largest change of linear momentum over sum |m v|
    turning: float  # largest change of angular momentum over sum |m x v| about the common centre
    budget: float  # largest hole in the energy budget over the energy at the start
    dissipated: float
    vibration: float  # elastic energy left
    pushed_out: float
    lowest: float  # smallest increase of what is dissipated in a step


@cache
def collide(place, *, cells=5, dt=0.01, impact=0.0, friction=0.0, theta=0.5, speed=SPEED, solver="banded"):
    """Two discs through their collision and a little beyond; APIC."""
    scene = pair(cells=cells, impact=impact, friction=friction, place=place, speed=speed)
    scheme, cell = Scheme(theta=theta, linear=SOLVERS[solver]), R / cells
    states = [initial(scene, scheme=scheme)]
    states += simulate(scene, dt=dt, until=0.01 * R / speed + 1.7, scheme=scheme, start=states[0])
    start, end = states[0], states[-1]
    assert end.contacts.force[0].max(initial=0.0) == 0.0
    mass, first = start.mass, start.body == 0
    centre = (start.x @ mass / mass.sum())[:, None]
    size = np.abs(mass * ((start.x - centre)[0] * start.v[1] - (start.x - centre)[1] * start.v[0])).sum()
    turned = [angular_momentum(s, cell) for s in states]
    energy = [s.report.energy for s in states]
    kinetic = energy[0].kinetic
    holes = [e.kinetic + e.elastic + e.dissipated - e.push_out - e.external - kinetic for e in energy]
    along = rotation(place.turn)[:, 0]
    relative = [along @ (s.v[:, first] @ mass[first] - s.v[:, ~first] @ mass[~first]) for s in (start, end)]
    lost = np.diff([e.dissipated for e in energy])
    return Collision(
        restitution=float(-relative[1] / relative[0]),
        momentum=max(float(np.abs(s.v @ mass - start.v @ mass).max()) for s in states) / np.abs(mass * start.v).sum(),
        turning=float(np.abs(np.array(turned) - turned[0]).max() / size),
        budget=float(np.abs(holes).max() / kinetic),
        dissipated=energy[-1].dissipated / kinetic,
        vibration=energy[-1].elastic / kinetic,
        pushed_out=energy[-1].push_out / kinetic,
        lowest=float(lost.min() / kinetic),
    )


KINDS = {"head-on": (0.0, 0.0), "oblique": (1.0, 0.0), "oblique, friction": (1.0, 0.3)}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("kind", KINDS)
def test_collision_keeps_momentum_and_closes_its_energy_budget(kind, solver):
    """R/h = 5, midpoint rule, any direction: momentum and energy budget to 1e-12 (amg: momentum to 1e-8).

    Contact impulses enter as r and -r; kinetic + elastic + dissipated = push-out + initial, and what is dissipated
    is a positive share.
    """
    impact, friction = KINDS[kind]
    hit = collide(places(1)[0], impact=impact, friction=friction, solver=solver)
    assert hit.momentum < (1e-12 if solver == "banded" else 1e-8)
    assert hit.budget < 1e-12
    assert 0.0 < hit.dissipated < 0.25
    assert hit.pushed_out < 1e-4


# The chain: five discs in a row, the first hits the others.

CHAIN, CHAIN_CELLS, CHAIN_SPEED = 5, 10, 0.004


def row(count, place, velocities, **options):
    """Discs that just touch."""
    centres = np.stack([2.0 * R * np.arange(count), np.zeros(count)])
    cell = R / CHAIN_CELLS
    v = np.stack([np.asarray(velocities), np.zeros(count)])
    return Scene(bodies(centres, v, LinearElastic(E, NU, DENSITY), place, cell), cell=cell, **options)


def centres_of(state, count, place):
    """Positions along the line, (count,) [m]."""
    along = rotation(place.turn)[:, 0] @ state.x
    return np.bincount(state.body, state.mass * along, count) / np.bincount(state.body, state.mass, count)


@cache
def force_law(place, largest=0.006, steps=24):
    """Approach of two discs' centres (k,) [m] and the force between them (k,) [N/m].

    Gravity presses them upon each other, uniformly as inertia does, and rises slowly in steps of backward Euler.
    """
    Q, middle, rise = rotation(place.turn), R, 15.0  # so short that they have no time to roll off each other
    shift = R / CHAIN_CELLS * np.array(place.offset)

    def gravity(X, t):
        side = np.sign(middle - Q[:, 0] @ (X - shift[:, None]))
        return largest * (t / rise) ** 2 * Q[:, :1] * side

    scene = row(2, place, [0.0, 0.0], gravity=gravity)
    start = initial(scene)
    apart, found = np.diff(centres_of(start, 2, place))[0], [(0.0, 0.0)]
    for state in simulate(scene, dt=rise / steps, until=rise, start=start):
        force = state.contacts.force[0] @ np.abs(Q[:, 0] @ state.contacts.normal)
        found.append((apart - np.diff(centres_of(state, 2, place))[0], force))
    return np.array(found).T


def one_dimensional(law, until):
    """Final velocities (CHAIN,) of point masses with the force law between neighbours."""

    def rate(t, y):
        x, v = np.split(y, 2)
        force = np.interp(-np.diff(x), *law, left=0.0)
        push = np.concatenate([[0.0], force]) - np.concatenate([force, [0.0]])
        return np.concatenate([v, push / MASS])

    start = np.zeros(2 * CHAIN)
    start[CHAIN] = CHAIN_SPEED
    return solve_ivp(rate, (0.0, until), start, rtol=1e-8, atol=1e-12, max_step=0.05).y[CHAIN:, -1]


@cache
def chain(place, dt=0.02, until=14.0):
    """Final velocities of the discs and of the one-dimensional chain, over that of the impact, (2, CHAIN)."""
    scene, scheme = row(CHAIN, place, [CHAIN_SPEED, 0.0, 0.0, 0.0, 0.0]), Scheme(theta=0.5)
    *_, state = simulate(scene, dt=dt, until=until, scheme=scheme)
    along = rotation(place.turn)[:, 0] @ state.v
    discs = np.bincount(state.body, state.mass * along) / np.bincount(state.body, state.mass)
    return np.stack([discs, one_dimensional(force_law(place), until)]) / CHAIN_SPEED
