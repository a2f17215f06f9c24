"""The angles in which outlines end: sharp, rounded and re-entrant corners."""

import numpy as np
import pytest
from test_outline import build, regular
from test_outline_widths import arc, sampled

from skmpm.outline.tips import tip_angles


def angles(x, reach):
    outlines, x, _ = build([x])
    return np.rad2deg(tip_angles(outlines, x, reach))


@pytest.mark.parametrize("sides", [3, 4, 5, 8])
@pytest.mark.parametrize("reach", [0.1, 0.31])
def test_corners_of_regular_polygons(sides, reach):
    x = sampled(regular(sides, 1.0).T, 0.04)
    assert angles(x, reach).min() == pytest.approx(180.0 - 360.0 / sides)
    assert angles(x, reach).max() == pytest.approx(180.0)


def test_a_notch_is_no_tip():
    x = sampled([(0, 0), (2, 0), (2, 2), (1, 1), (0, 2)], 0.05)
    found = angles(x, 0.2)
    assert found.max() == pytest.approx(270.0)
    assert found.min() == pytest.approx(45.0)


@pytest.mark.parametrize("degrees, radius", [(30.0, 0.5), (60.0, 0.25)])
def test_a_rounded_tip(degrees, radius):
    """Seen over a length of one from the middle of the arc: by the tangent points and what is left of the length."""
    half = np.deg2rad(degrees) / 2.0
    turn, end, centre = np.pi / 2.0 - half, 3.0 * np.array([np.cos(half), np.sin(half)]), radius / np.sin(half)
    tip = arc(radius, np.pi - turn, np.pi + turn, 0.005, (centre, 0.0))
    x = np.concatenate([end[:, None], tip, end[:, None] * [[1.0], [-1.0]]], axis=1)
    along = radius / np.tan(half) + 1.0 - radius * turn  # from the corner before rounding
    expected = 2.0 * np.arctan2(along * np.sin(half), along * np.cos(half) - (centre - radius))
    found = angles(x, 1.0)
    assert found[1 + tip.shape[1] // 2] == pytest.approx(np.rad2deg(expected), abs=0.5)
    assert expected > np.deg2rad(degrees) + 0.2
