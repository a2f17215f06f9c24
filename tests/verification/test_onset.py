"""Onset of contact: how far apart the true outlines are when the first contact force appears.

Bodies fly freely, without stress, towards each other, so the true distance of their circles, corners and sides is
known at any time. The time of the first force is found to 0.004 cells of travel, so smaller distances are not
resolved; at shared nodes it is found to 0.04 cells. Grid offset, direction of approach, obliqueness and the angle of
each cloud of points are random. Distances are in cells, positive where the force comes too early, negative where
outlines already overlap. Contact between outlines is the default. Contact at shared nodes, that of Nezamabadi et al.
(2017), does not depend on a gap, and is shown for comparison.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from ledger import Row, numbers

from skmpm import Body, LinearElastic, Points, Scene, Scheme, Wall, box, disc, initial, linear, step

R, SPEED = 1.0, 0.01  # [m], [m/s]
SOFT = LinearElastic(1e6, 0.3, 1000.0)
PER = 2  # points along the side of a cell
SIZES = (5, 10, 20)  # R/h; boxes have sides 2 R
OFFSETS = 20
SCHEMES = {"outlines": Scheme(), "seed": Scheme.nezamabadi2017()}
APART = {"outlines": 0.35, "seed": 3.2}  # at the start [cells]
TRAVELS = {"outlines": (0.1, 0.02, 0.004), "seed": (0.2, 0.04)}  # of a step [cells]: coarse, then finer
GOALS = {  # of the mean and of the worst [cells]
    "two discs": (0.1, 0.3),
    "disc and wall": (0.1, 0.3),
    "corner and wall": (0.5, 0.5),
    "corner and side": (0.5, 0.5),
}
SHORT = [  # solver, R/h, how many offsets
    pytest.param(linear.banded, 5, 6, id="banded-5"),
    pytest.param(linear.banded, 10, 3, id="banded-10"),
    pytest.param(linear.banded, 20, 1, id="banded-20"),
    pytest.param(linear.amg, 5, 2, id="amg-5"),
]


@dataclass(frozen=True)
class Approach:
    """Bodies and walls that close in on each other."""

    scene: Scene
    distance: Callable[[float], float]  # of the true outlines at time t [m]


def turned(points, angle, centre):
    """Points about the origin, turned and moved."""
    return Points(rotation(angle) @ points.x + np.reshape(centre, (2, 1)), points.volume, points.outline)


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def directions(rng):
    """Normal of the contact to be, and a velocity up to 45 degrees off it, from the first body to the second."""
    normal, oblique = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-np.pi / 4, np.pi / 4)
    return (np.array([np.cos(a), np.sin(a)]) for a in (normal, normal + oblique))


def round_body(centre, h, rng, **motion):
    cloud = disc((0, 0), R, spacing=h / PER)
    return Body(turned(cloud, rng.uniform(0.0, 2.0 * np.pi), centre), SOFT, **motion)


def square(h):
    return box((-R, -R), (2 * R, 2 * R), spacing=h / PER)


def two_discs(h, apart, rng):
    """Both move; they meet at a random position on the grid."""
    normal, way = directions(rng)
    first, apart = h * rng.random(2), apart * h / (normal @ way)
    second = first + 2 * R * normal + apart * way
    bodies = [round_body(c, h, rng, velocity=s * SPEED / 2 * way) for c, s in ((first, 1), (second, -1))]
    return Approach(Scene(bodies, cell=h), lambda t: np.hypot(*(second - first - SPEED * t * way)) - 2 * R)


def disc_and_wall(h, apart, rng):
    """Both move."""
    normal, way = directions(rng)
    centre, position = h * rng.random(2), (R + apart * h) * normal
    bodies = [round_body(centre, h, rng, velocity=SPEED / 2 * way)]
    walls = [Wall(centre + position, -normal, velocity=-SPEED / 2 * way)]
    return Approach(Scene(bodies, cell=h, walls=walls), lambda t: apart * h - SPEED * t * (way @ normal))


def tilted_box(h, normal, rng, **motion):
    """A box with a corner that points along `normal`, its sides 10 degrees or more off the flat; and that corner."""
    centre, tilt = h * rng.random(2), rng.uniform(-np.pi / 4, np.pi / 4) * 35 / 45
    points = turned(square(h), np.arctan2(normal[1], normal[0]) - np.pi / 4 + tilt, centre)
    corner = points.x[:, np.argmax(normal @ points.x)]
    return Body(points, SOFT, **motion), corner


def corner_and_wall(h, apart, rng):
    normal, way = directions(rng)
    body, corner = tilted_box(h, normal, rng, velocity=SPEED / 2 * way)
    walls = [Wall(corner + apart * h * normal, -normal, velocity=-SPEED / 2 * way)]
    return Approach(Scene([body], cell=h, walls=walls), lambda t: apart * h - SPEED * t * (way @ normal))


def corner_and_side(h, apart, rng):
    """The side of another box, hit anywhere in its middle half."""
    normal, way = directions(rng)
    body, corner = tilted_box(h, normal, rng, velocity=SPEED / 2 * way)
    target = corner + apart * h / (normal @ way) * way
    side = rng.uniform(-R / 2, R / 2) * np.array([-normal[1], normal[0]])
    other = turned(square(h), np.arctan2(normal[1], normal[0]), target + R * normal + side)
    bodies = [body, Body(other, SOFT, velocity=-SPEED / 2 * way)]
    return Approach(Scene(bodies, cell=h), lambda t: apart * h - SPEED * t * (way @ normal))


PROBLEMS = dict(zip(GOALS, (two_discs, disc_and_wall, corner_and_wall, corner_and_side), strict=True))


def onset(approach, scheme, travels):
    """The true distance [cells] at which the first contact force appears; nan if there is none."""
    h, state = approach.scene.cell, initial(approach.scene, scheme=scheme)
    before = found = state
    for travel in travels:
        while approach.distance(state.t) > -h:
            new = step(approach.scene, state, travel * h / SPEED, scheme=scheme)
            if new.contacts.force[0].any():
                break
            before, state = state, new
        else:
            return np.nan
        # Outlines look at the end of a step, shared nodes at its start, so that one step more is in doubt.
        found, state = state, before
    return approach.distance(found.t) / h


@cache
def measured(problem, size, *, law="outlines", count=OFFSETS, solver=linear.default):
    """Onset distances (count,) [cells] at random offsets and directions."""
    rng, h, scheme = np.random.default_rng(size), R / size, replace(SCHEMES[law], linear=solver)
    return np.array([onset(PROBLEMS[problem](h, APART[law], rng), scheme, TRAVELS[law]) for _ in range(count)])


# Tests.


@pytest.mark.parametrize(("solver", "size", "count"), SHORT)
@pytest.mark.parametrize("problem", ["two discs", "disc and wall"])
def test_discs_touch_where_their_circles_do(problem, solver, size, count):
    """Goal: true distance at the first force within 0.1 cells on average, 0.3 at worst; asserted: 0.02 at worst.

    What is left is the sagitta between two boundary points, (h/2)^2 / 8 R = 0.006 h at R/h = 5, and 0.004 h of
    travel.
    """
    assert np.abs(measured(problem, size, count=count, solver=solver)).max() < 0.02


@pytest.mark.parametrize(("solver", "size", "count"), SHORT)
def test_the_corner_of_a_box_touches_a_wall_where_it_is(solver, size, count):
    """Goal: within 0.5 cells; asserted: 0.006; a corner is a boundary point, 0.004 cells of travel are left."""
    assert np.abs(measured("corner and wall", size, count=count, solver=solver)).max() < 0.006


@pytest.mark.parametrize(("solver", "size", "count"), SHORT)
def test_the_corner_of_a_box_touches_the_side_of_another(solver, size, count):
    """Goal: within 0.5 cells; asserted: a quarter, never early.

    Where the side gives the points, which lie s = h/2 apart, the corner sinks in between two of them until its own
    sides, at b and 90 degrees - b, meet one: by s sin(b) cos(b) <= h/4 at most.
    """
    distance = measured("corner and side", size, count=count, solver=solver)
    assert distance.min() > -0.256 and distance.max() < 0.006


@pytest.mark.parametrize("problem", GOALS)
def test_shared_nodes_touch_cells_too_early(problem):
    """Shared-grid contact has no gap: a force as soon as two cells, 2 sqrt(2) h across together, share a node.

    Expected was about one cell; it is one and a half to two, and at no time less than a half.
    """
    distance = measured(problem, 5, law="seed", count=5)
    assert 1.2 < distance.mean() < 2.5
    assert distance.min() > 0.5 and distance.max() < 2.0 * np.sqrt(2.0)


# The table and the figure.


def rows():
    tests = {
        "two discs": "test_discs_touch_where_their_circles_do",
        "disc and wall": "test_discs_touch_where_their_circles_do",
        "corner and wall": "test_the_corner_of_a_box_touches_a_wall_where_it_is",
        "corner and side": "test_the_corner_of_a_box_touches_the_side_of_another",
    }
    return [row(problem, law, tests[problem]) for law in SCHEMES for problem in GOALS]


def row(problem, law, test):
    found = [measured(problem, size, law=law) for size in SIZES]
    mean, worst = ([measure(np.abs(d)) for d in found] for measure in (np.mean, np.max))
    bars = GOALS[problem]
    good = max(mean) <= bars[0] and max(worst) <= bars[1]
    goal = f"mean {bars[0]}, worst {bars[1]}: " + ("met" if good else "missed: see the test")
    if law == "seed":
        goal = "about one cell: between one and two and a half, because cells that only adjoin share nodes"
    return Row(
        f"Onset of contact, {problem}, {OFFSETS} offsets and directions"
        + (", shared nodes" if law == "seed" else ""),
        "true distance of circles, corners and sides",
        "R/h = 5, 10, 20",
        f"|distance| at the first force [cells]: mean {numbers(mean)}; worst {numbers(worst)}",
        "-",
        goal,
        "test_shared_nodes_touch_cells_too_early" if law == "seed" else test,
    )


def figures(folder):
    """Distances at the first force, of every offset and direction, for both laws."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(7.5, 3.6), layout="constrained")
    for ax, law in zip(axes, SCHEMES, strict=True):
        for k, (problem, marker) in enumerate(zip(GOALS, "osv^", strict=True)):
            for i, size in enumerate(SIZES):
                found = measured(problem, size, law=law)
                position = i + (k - 1.5) * 0.2 + np.linspace(-0.06, 0.06, found.size)
                ax.plot(position, found, marker, ms=2.5, color=f"C{k}", label=problem if i == 0 else None)
        ax.axhline(0.0, color="black", lw=0.6)
        ax.set_xticks(range(len(SIZES)), SIZES)
        ax.set_xlabel("R/h")
        ax.set_title({"outlines": "outlines", "seed": "shared nodes"}[law], fontsize=10)
    axes[0].set_ylabel("true distance at the first force / h")
    axes[0].set_ylim(-0.35, 0.35)
    axes[0].hlines([-0.1, 0.1, -0.3, 0.3], -0.5, 2.5, colors="grey", linestyles=["--", "--", ":", ":"], lw=0.8)
    axes[1].set_ylim(-0.2, 3.0)
    axes[0].legend(fontsize=7, loc="upper right", ncols=2)
    figure.savefig(folder / "onset.png", dpi=120)
    plt.close(figure)
    return {
        "onset.png": "True distance of two outlines when the first contact force appears, in cells: every point one"
        " grid offset, direction and obliqueness. Left: contact by outlines; dashed and dotted the goals of mean and"
        " worst for discs. Right, on another scale: contact at shared grid nodes."
    }
