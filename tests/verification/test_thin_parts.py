"""Strips of 1, 2, 4 and 8 cells: limits of the preflight check for thin parts, by their deflection under an end load.

Ten times as long as thick, nu = 0.3, two points along the side of a cell, a dead load on the far end, one static
step, at eight positions on the grid. Reference: Timoshenko's beam in plane strain, P L^3 / 3 E* I + 6 P L / 5 G A.
"""

import re
from functools import cache

import numpy as np
import pytest
from ledger import Row, numbers, rate

from skmpm import Body, LinearElastic, Load, Points, Scene, Scheme, Support, box, initial, preflight, step
from skmpm.preflight.limits import LIMITS

CELLS = (1, 2, 4, 8)
LENGTH = 10.0  # over the thickness, which is 1 m
POSITIONS = ((0.0, 0.0), *np.random.default_rng(0).random((7, 2)))  # of a corner on the grid [cells]
WORST = {1: (0.0, 0.3), 2: (0.05, 0.3), 4: (0.0, 0.0), 8: (0.0, 0.0)}  # of 20 x 20 positions, for so many cells
FORCE = 0.1  # [N/m]: slopes of 1e-4
STEEL = LinearElastic(1e6, 0.3, 1000.0)


def strip(cells, position):
    h = 1.0 / cells
    points, shift = box((0.0, 0.0), (LENGTH, 1.0), spacing=h / 2), h * np.reshape(position, (2, 1))
    first, last = shift[0, 0] + 1e-9, shift[0, 0] + LENGTH - 1e-9
    return Scene(
        [Body(Points(points.x + shift, points.volume, points.outline), STEEL)],
        cell=h,
        supports=[Support(lambda x: x[0] < first)],
        loads=[Load(lambda x: x[0] > last, (0.0, FORCE))],
    )


@cache
def deflections(cells, positions=POSITIONS):
    """Of the far end over the beam's, less one, (positions,)."""
    modulus, shear = STEEL.E / (1.0 - STEEL.nu**2), STEEL.lame[1]
    exact = FORCE * (LENGTH**3 / (3.0 * modulus / 12.0) + 6.0 * LENGTH / (5.0 * shear))
    out = []
    for position in positions:
        scene, scheme = strip(cells, position), Scheme(inertia=False)
        state = step(scene, initial(scene, scheme=scheme), 1.0, scheme=scheme)
        end = scene.initial_positions[0] > scene.initial_positions[0].max() - 1e-9
        out.append((state.x - scene.initial_positions)[1, end].mean() / exact - 1.0)
    return np.array(out)


def test_what_the_check_says_of_strips_is_what_is_measured():
    """The worst of 400 positions, to 3 % of itself, no other exceeds it; at eight cells those are right to 1 %."""
    numbers = re.search(r"bend by up to ([\d., ]+) %", LIMITS["thin part"].text).group(1)
    said = [float(n) / 100 for n in numbers.split(", ")]
    worst = [-deflections(cells, (WORST[cells],))[0] for cells in CELLS]
    found = [-deflections(cells).min() for cells in CELLS]
    assert worst == pytest.approx(said, rel=0.03)
    assert (np.array(found) <= 1.03 * np.array(said)).all()
    assert found[0] > found[1] > found[2] > found[3]
    assert found[3] < 0.01


def inclined(cells, degrees, position, nu):
    """Deflection of the end of a strip that is turned, over the beam's, less one."""
    across = np.array([-np.sin(np.radians(degrees)), np.cos(np.radians(degrees))])
    along, material = np.array([across[1], -across[0]]), LinearElastic(1e6, nu, 1000.0)
    points = box((0.0, 0.0), (LENGTH, 1.0), spacing=0.5 / cells)
    points = points.placed(np.array([3.0, 5.0]) + np.array(position) / cells, np.radians(degrees))
    first, last = (along @ points.x).min() + 1e-9, (along @ points.x).max() - 1e-9
    scene = Scene(
        [Body(points, material)],
        cell=1.0 / cells,
        supports=[Support(lambda x: along @ x < first)],
        loads=[Load(lambda x: along @ x > last, tuple(FORCE * across))],
    )
    scheme = Scheme(inertia=False)
    moved = step(scene, initial(scene, scheme=scheme), 1.0, scheme=scheme).x - scene.initial_positions
    end = along @ scene.initial_positions > last
    exact = FORCE * (LENGTH**3 / (3.0 * 1e6 / (1.0 - nu**2) / 12.0) + 6.0 * LENGTH / (5.0 * material.lame[1]))
    return (across @ moved)[end].mean() / exact - 1.0


def test_what_the_check_says_of_inclined_strips_is_what_is_measured():
    """Of three positions the worst, to 3 % of itself; a lip of five cells at 35 degrees bends 7 % too little."""
    said = re.search(r"strips of ([\d, ]+) cells bend ([\d., ]+) %", LIMITS["inclined thin part"].text)
    cells, said = ([float(n) for n in numbers.split(", ")] for numbers in said.groups())
    places = ((0.1, 0.2), (0.6, 0.45), (0.3, 0.8))
    worst = [-100.0 * min(inclined(n, 45.0, place, 0.49) for place in places) for n in map(int, cells)]
    assert worst == pytest.approx(said, rel=0.03)
    assert inclined(5, 35.0, places[0], 0.49) < -0.05


@pytest.mark.parametrize("cells", CELLS)
def test_the_check_warns_of_strips_below_four_cells(cells):
    check = preflight(strip(cells, POSITIONS[1]), 1.0, scheme=Scheme(inertia=False))
    assert ("thin part" in [warning.kind for warning in check.warnings]) == (cells < 4)
    assert f"{cells} cells across the thinnest part" in str(check)


def rows():
    found = 100 * np.array([deflections(cells) for cells in CELLS])
    return [
        Row(
            problem="strip of 1, 2, 4, 8 cells bends: % of deflection, 8 positions on the grid",
            reference="Timoshenko's beam",
            h="1, 1/2, 1/4, 1/8 of the thickness",
            error=f"mean {numbers(found.mean(axis=1), 3)}; worst {numbers(found.min(axis=1), 3)}",
            rate=numbers([rate(1 / np.array(CELLS), -found.mean(axis=1))]),
            goal="none below 4 cells, which the check warns of; 2.5 % at 8: met",
            test="test_what_the_check_says_of_strips_is_what_is_measured",
        )
    ]
