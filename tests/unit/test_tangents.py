"""Shares of the segment behind a point in the tangent there."""

import numpy as np
import pytest

from skmpm.outline.cubics import backward_shares


def shares(x, corner=()):
    number = np.arange(x.shape[1])
    return backward_shares(x, np.roll(number, 1), np.roll(number, -1), np.isin(number, corner))


def on_circle(angle):
    return np.stack([np.cos(angle), np.sin(angle)])


def stadium(noise=0.0):
    """Two straight sides of ten segments between half circles of eight, 0.3 long."""
    radius = 0.15 / np.sin(np.pi / 16)
    arc = radius * on_circle(np.pi / 8 * np.arange(8) - np.pi / 2) + np.array([[3.0], [0.0]])
    side = np.stack([0.3 * np.arange(10), np.full(10, -radius)])
    x = np.concatenate([side, arc], axis=1)
    x = np.concatenate([x, np.array([[3.0], [0.0]]) - x], axis=1)
    return x + noise * np.random.default_rng(0).normal(size=x.shape)


def test_on_circles_they_are_those_of_parabolas():
    """Whatever the spacing: l ahead / (l behind + l ahead), up to the curvature that chords tell."""
    angle = 2 * np.pi / 40 * np.arange(40)
    assert shares(on_circle(angle)) == pytest.approx(0.5, abs=1e-11)
    angle += 0.05 * np.sin(3.0 * angle)
    length = np.diff(np.append(angle, angle[0] + 2 * np.pi))
    assert shares(on_circle(angle)) == pytest.approx(length / (length + np.roll(length, 1)), abs=2e-3)


def test_a_straight_side_stays_straight_beside_an_arc():
    """At its ends only the straight segment counts, behind at the one, ahead at the other."""
    share = shares(stadium())
    assert share[[10, 28]] == pytest.approx(1.0, abs=1e-6) and share[[0, 18]] == pytest.approx(0.0, abs=1e-6)


def test_round_off_on_a_straight_side_means_nothing():
    """Inside of it both segments count alike."""
    assert shares(stadium(noise=1e-6))[2:9] == pytest.approx(0.5, abs=0.02)


def test_a_corner_next_to_a_point_counts_for_nothing():
    """Two arcs that meet in corners: all points between have the shares that they have on a whole circle."""
    arc = on_circle(np.linspace(-np.pi / 4, np.pi / 4, 11)[:-1]) - np.array([[np.sqrt(0.5)], [0.0]])
    share = shares(np.concatenate([arc, -arc], axis=1), [0, 10])
    assert np.delete(share, [0, 10]) == pytest.approx(0.5, abs=1e-11)
