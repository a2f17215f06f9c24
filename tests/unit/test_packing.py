"""Packings of rigid discs: no overlap, requested solid fraction, disordered, uniform, reproducible; errors."""

import os
import subprocess
import sys
from functools import cache, partial
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from skmpm.observe import observe
from skmpm.packing import Packing, PackingError, checks, generator, packing
from skmpm.packing.discs import Box, contacts_of, rows, scatter, separate


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


def test_a_jam_says_at_which_fraction(monkeypatch):
    monkeypatch.setattr(generator, "_ATTEMPTED_DISCS", 0)  # one attempt
    message = r"discs jam at a solid fraction of 0\.7\d{3}, below the requested 0\.8; .*periodic=True, .*moving walls"
    with pytest.raises(PackingError, match=message):
        packed(30, 0.8)


def jam(R, solid_fraction, periodic, seed):
    """The solid fraction at which one attempt to reach a higher one ends, and the estimate of it; in a square box."""
    R = R / R.mean()
    box = Box(np.full(2, np.sqrt(np.pi * (R**2).sum() / solid_fraction)), np.full(2, periodic))
    rng = np.random.default_rng(seed)
    _, size = generator._grow(scatter(R, box, rng), partial(grown, R=R, box=box), 1.0, rng)
    return solid_fraction * size**2, checks.jams_at(R, box)


def grown(x, size, tolerance, R, box):
    return separate(x, size * R, box, 0.0, tolerance)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize(
    "radii", [radii(20), radii(100), np.ones(40), np.where(np.arange(40) % 8, 1.0, 3.0)], ids=lambda R: str(R.size)
)
def test_where_discs_jam_is_known_beforehand(radii, periodic):
    """Single attempts end within 0.035 of the estimate: few and many discs, equal or not, with walls and without."""
    reached, expected = jam(radii, 0.9, periodic, seed=0)
    assert reached == pytest.approx(expected, abs=0.035)


@pytest.mark.parametrize(
    ("count", "solid_fraction", "jammed"), [(20, 0.82, 0.73), (40, 0.82, 0.76), (100, 0.83, 0.79)]
)
def test_what_jams_before_is_refused_at_once(count, solid_fraction, jammed):
    """With the solid fraction where it jams, and what to do instead; a little below that it is packed."""
    R, taken = radii(count), []
    message = rf"{count} discs between walls jam at a solid fraction of about {jammed}, below the requested"
    for _ in range(3):
        began = process_time()
        with pytest.raises(PackingError, match=rf"{message} {solid_fraction}; .*periodic=True, .*moving walls"):
            packing(R, side(R), solid_fraction=solid_fraction)
        taken.append(process_time() - began)
    assert min(taken) < 0.1
    assert smallest_gap(packed(count, jammed - 0.02)) > -1e-6


@pytest.mark.parametrize("count", [1, 4, 9, 16, 25, 100])
def test_crystals_are_not_refused(count):
    """Equal discs fill a square box up to pi / 4 on a lattice, narrow ones in rows, periodic ones up to 0.9069."""
    size = 2.0 * np.sqrt(count) * np.ones(2)
    checks.check_reachable(np.ones(count), Box(size, np.full(2, False)), 0.785)
    rows = np.array([2.0 + np.sqrt(3.0), count + 1.0])  # two, staggered
    checks.check_reachable(np.ones(count), Box(rows, np.full(2, False)), 0.84)
    checks.check_reachable(np.ones(count), Box(size, np.full(2, True)), 0.9)


def test_soft_discs_are_packed_more_densely_by_walls():
    """As the page says: twelve, whose areas at the start are 0.82 of the box; rigid ones jam at less, by far."""
    page = (Path(__file__).parents[2] / "docs" / "how_to" / "loading.md").read_text()
    found: dict[str, Any] = {}
    exec(page.split("## Dense packings")[1].split("```python")[1].split("```")[0], found)
    seen = observe(found["scene"], found["dense"])
    sides = found["dense"].walls[[3, 0], [0, 1]]
    assert found["solid"] / sides.prod() == pytest.approx(0.82)
    R = found["radii"]
    rigid = checks.jams_at(R / R.mean(), Box(sides / R.mean(), np.full(2, False)))
    assert seen.pressure_walls > 0.0 and seen.solid_fraction > 0.78 > rigid + 0.05


CENTRES = """
import numpy as np, skmpm
radii = np.random.default_rng(0).uniform(0.7e-3, 1.2e-3, 50)
width = float(np.sqrt(np.pi * (radii**2).sum() / 0.72))
print(skmpm.packing(radii, width, solid_fraction=0.70, seed=0).centres.tobytes().hex())
"""


def test_threads_of_blas_do_not_matter():
    """Fifty discs whose centres differed by 5e-18 m between one and two threads: the same to the bit."""
    printed = {
        subprocess.run(
            [sys.executable, "-c", CENTRES],
            env=os.environ | {"OPENBLAS_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "2")
    }
    assert len(printed) == 1


def test_two_discs_that_turn_as_one_do_not_slide():
    """A rigid rotation of a touching pair about any point has no relative velocity in its contact."""
    x, R = np.array([[5.0, 6.2], [5.0, 6.6]]), np.array([0.8, 1.2])
    contacts = contacts_of(x, R, Box(np.array([20.0, 20.0]), np.full(2, False)))
    normal, tangent = contacts.normal, contacts.normal[::-1] * [[-1.0], [1.0]]
    H = np.vstack([rows(contacts, d, 2).toarray() for d in (normal, tangent)])
    turn = np.concatenate([-(x[1] - 3.0), x[0] + 7.0, np.ones(2)])
    np.testing.assert_allclose(H @ turn, 0.0, atol=1e-12)
    own_spin = H @ np.concatenate([np.zeros(4), np.ones(2)])
    np.testing.assert_allclose(own_spin, [0.0, -2.0], atol=1e-12)


def test_friction_jams_earlier(monkeypatch):
    """In one attempt 0.74 is reached without friction; with friction 1 it is not."""
    monkeypatch.setattr(generator, "_ATTEMPTED_DISCS", 0)
    assert smallest_gap(packed(30, 0.74)) > -1e-6
    with pytest.raises(PackingError, match=r"jam at a solid fraction of 0\.[67]\d{3}, below the requested 0\.74"):
        packed(30, 0.74, friction=1.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shapes": [1e-3, -2e-3]}, r"radius -0\.002 m"),
        ({"shapes": [1e-3, np.nan]}, "radius nan m"),
        ({"shapes": [1e-3, np.inf]}, "radius inf m"),
        ({"shapes": []}, r"shape \(0,\)"),
        ({"shapes": [[1e-3]]}, r"shape \(1, 1\)"),
        ({"solid_fraction": 0.95}, r"solid_fraction 0\.95 must lie"),
        ({"solid_fraction": np.nan}, "solid_fraction = nan; give a finite number of zero or more"),
        ({"solid_fraction": 0.0}, "solid_fraction 0 must lie"),
        ({"width": 2e-3}, r"the box is 0\.002 x .* m, the largest disc is 0\.002 m thick"),
        ({"width": 0.0}, r"width = 0\.0; give a length in metres, greater than zero"),
        ({"width": 1.0}, "largest disc"),
        ({"friction": -0.1}, r"friction = -0\.1; give a finite number of zero or more"),
        ({"width": "8e-3"}, "width = '8e-3' is not a number"),
        ({"solid_fraction": None}, "solid_fraction = None; give"),
    ],
)
def test_says_what_is_wrong(change, message):
    arguments = {"shapes": np.full(10, 1e-3), "width": 8e-3} | change
    with pytest.raises(PackingError, match=message):
        packing(**arguments)
