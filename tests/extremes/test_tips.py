"""Rhombic grains with tips of 20 to 60 degrees in a shrinking box: what the check says of tips.

Six soft grains of R/h = 5 with friction 0.5 are pressed to 3 % of Young's modulus.
"""

import numpy as np
import pytest

import skmpm
from skmpm.points.convex import _filled
from skmpm.points.fill import rounded

R, CELL = 1e-3, 0.2e-3
GEL = skmpm.NeoHookean(E=1e6, nu=0.45, density=1000.0)


def rhombus(degrees, rounding, centre, angle):
    """A rhombus of the area of a disc of radius R, with two tips of this angle, rounded by so many cells."""
    half = np.deg2rad(degrees) / 2.0
    length, radius = np.sqrt(0.5 * np.pi * R**2 / np.tan(half)), rounding * CELL
    corners = length * np.array([[1.0, 0.0, -1.0, 0.0], [0.0, np.tan(half), 0.0, -np.tan(half)]])
    curve, _, area = rounded(corners, radius, np.zeros((2, 1)))
    return _filled(curve, area, centre, 0.66 * CELL, angle, alike=4)


def grains(degrees, rounding, seed):
    length = np.sqrt(0.5 * np.pi * R**2 / np.tan(np.deg2rad(degrees) / 2.0))
    loose = skmpm.packing([1.02 * length] * 6, 7.0 * length, solid_fraction=0.55, periodic=True, seed=seed)
    angles = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, 6)
    bodies = [
        skmpm.Body(rhombus(degrees, rounding, x, angle), GEL)
        for x, angle in zip(loose.centres.T, angles, strict=True)
    ]
    box = skmpm.Periodic(loose.width, loose.height, rate=[[-4.0, 0.0], [0.0, -4.0]])
    return skmpm.Scene(bodies, cell=CELL, friction=0.5, periodic=box)


def pressed(scene):
    """The largest pressure over Young's modulus that is reached."""
    largest = 0.0
    try:
        for state in skmpm.simulate(scene, until=0.35, warn=False):
            largest = max(largest, skmpm.observe(scene, state).pressure / GEL.E)
            if largest > 0.03:
                break
    except skmpm.StepFailed:
        pass
    return largest


# Of seeds 0 to 4 three bear it with tips of 20 degrees, rounded by half a cell or by one, all with 60 degrees.
@pytest.mark.parametrize(
    "degrees, rounding, seed",
    [(50.0, 1e-3, 3), *(pytest.param(20.0, rounding, 1, marks=pytest.mark.nightly) for rounding in (0.5, 1.0))],
)
def test_blunt_and_rounded_tips_are_pressed(degrees, rounding, seed):
    scene = grains(degrees, rounding, seed)
    assert "sharp-tips" not in {warning.section for warning in skmpm.preflight(scene).warnings}
    assert pressed(scene) > 0.03


def test_the_check_warns_of_sharp_tips_which_fail():
    scene = grains(20.0, 1e-3, seed=1)
    (warning,) = (w for w in skmpm.preflight(scene).warnings if w.section == "sharp-tips")
    assert warning.value == pytest.approx(20.0, abs=0.5)
    assert pressed(scene) < 0.01
