"""Packings of rigid discs: no overlap, requested solid fraction, disordered, uniform, reproducible; errors."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from skmpm.packing import Packing, PackingError, packing
from skmpm.packing.discs import Box, contacts_of, rows


def radii(count, seed=1):
    """Radii of Nezamabadi et al. (2017) [m]."""
    return np.random.default_rng(seed).uniform(0.7e-3, 1.2e-3, count)


def side(R):
    """Width of a square box at a solid fraction of 0.75."""
    return np.sqrt(np.pi * (R**2).sum() / 0.75)


@cache
def packed(count, solid_fraction, friction=0.0, seed=0) -> Packing:
    R = radii(count)
    return packing(R, side(R), solid_fraction=solid_fraction, friction=friction, seed=seed)


def smallest_gap(p):
    """Smallest distance between discs and to the walls, relative to the smallest radius, by brute force."""
    i, j = np.triu_indices(p.radii.size, 1)
    pairs = pdist(p.centres.T) - p.radii[i] - p.radii[j]
    walls = np.concatenate([p.centres - p.radii, [[p.width], [p.height]] - p.centres - p.radii])
    return min(pairs.min(initial=np.inf), walls.min()) / p.radii.min()


@pytest.mark.parametrize(("solid_fraction", "friction"), [(0.3, 0.0), (0.7, 0.0), (0.8, 0.0), (0.6, 0.5)])
def test_no_overlap_at_the_fraction_asked(solid_fraction, friction):
    p = packed(300, solid_fraction, friction)
    assert smallest_gap(p) > -1e-6
    assert np.pi * (p.radii**2).sum() / (p.width * p.height) == pytest.approx(solid_fraction, rel=1e-12)
    assert p.width == side(radii(300))
    np.testing.assert_array_equal(p.radii, radii(300))


def test_even_and_disordered():
    """Ninths of the box hold the same area within 8 % (independent centres: 25 %), and six-fold order is short.

    psi_6 of the six nearest neighbours, averaged over the discs as a complex number, is 1 for a crystal.
    """
    p = packed(300, 0.7)
    ninth = np.floor(3 * p.centres / [[p.width], [p.height]]).astype(int)
    area = np.bincount(3 * ninth[0] + ninth[1], weights=p.radii**2)
    assert np.abs(area / area.mean() - 1.0).max() < 0.08
    apart = p.centres[:, :, None] - p.centres[:, None]
    nearest = np.argsort(np.hypot(*apart), axis=0)[1:7]
    x, y = np.take_along_axis(apart, nearest[None], axis=1)
    assert abs(np.exp(6j * np.arctan2(y, x)).mean()) < 0.2


def test_the_seed_decides():
    a, b = packed(40, 0.65, seed=3), packing(radii(40), side(radii(40)), solid_fraction=0.65, seed=3)
    np.testing.assert_array_equal(a.centres, b.centres)
    assert np.abs(a.centres - packed(40, 0.65, seed=4).centres).max() > 1e-4


def test_the_unit_of_length_does_not_matter():
    R = radii(40)
    metres, millimetres = packed(40, 0.65), packing(1e3 * R, 1e3 * side(R), solid_fraction=0.65)
    np.testing.assert_allclose(millimetres.centres, 1e3 * metres.centres, rtol=1e-15)
    assert millimetres.height == pytest.approx(1e3 * metres.height)


def test_one_disc():
    p = packing([1.0], 3.0, solid_fraction=0.3)
    assert smallest_gap(p) > 0.0


@pytest.mark.parametrize("seed", range(8))
def test_few_discs_that_jam_are_restarted(seed):
    """In a single attempt, 17 of 40 packings of twelve discs jammed below 0.7."""
    R = np.random.default_rng(seed).uniform(0.7e-3, 1.2e-3, 12)
    assert smallest_gap(packing(R, side(R), solid_fraction=0.7, seed=seed)) > -1e-6


def test_a_jam_says_at_which_fraction():
    with pytest.raises(PackingError, match=r"jam at a solid fraction of 0\.[78]\d{3}, below the requested 0\.88"):
        packed(30, 0.88)


def test_two_discs_that_turn_as_one_do_not_slide():
    """A rigid rotation of a touching pair about any point has no relative velocity in its contact."""
    x, R = np.array([[5.0, 6.2], [5.0, 6.6]]), np.array([0.8, 1.2])
    H = rows(contacts_of(x, R, Box(np.array([20.0, 20.0]), periodic=False)), R)
    turn = np.concatenate([-(x[1] - 3.0), x[0] + 7.0, np.ones(2)])
    np.testing.assert_allclose(H @ turn, 0.0, atol=1e-12)
    own_spin = H @ np.concatenate([np.zeros(4), np.ones(2)])
    np.testing.assert_allclose(own_spin, [0.0, -2.0], atol=1e-12)


def test_friction_jams_earlier():
    """Frictionless 0.80 is reached above; with friction 1 it is not."""
    with pytest.raises(PackingError, match=r"jam at a solid fraction of 0\.[67]\d{3}, below the requested 0\.82"):
        packed(30, 0.82, friction=1.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shapes": [1e-3, -2e-3]}, r"radius -0\.002 m"),
        ({"shapes": [1e-3, np.nan]}, "radius nan m"),
        ({"shapes": [1e-3, np.inf]}, "radius inf m"),
        ({"shapes": []}, r"shape \(0,\)"),
        ({"shapes": [[1e-3]]}, r"shape \(1, 1\)"),
        ({"solid_fraction": 0.95}, r"solid_fraction 0\.95 must lie"),
        ({"solid_fraction": np.nan}, "solid_fraction nan must lie"),
        ({"solid_fraction": 0.0}, "solid_fraction 0 must lie"),
        ({"width": 2e-3}, r"width 0\.002 m must exceed"),
        ({"width": 1.0}, "largest disc"),
        ({"friction": -0.1}, r"friction -0\.1"),
    ],
)
def test_says_what_is_wrong(change, message):
    arguments = {"shapes": np.full(10, 1e-3), "width": 8e-3} | change
    with pytest.raises(PackingError, match=message):
        packing(**arguments)
