"""The distance of packings from their first and from their own jamming point."""

import numpy as np
import pytest

import skmpm
from examples.studies.packing_ensemble import own_jamming
from examples.studies.packing_ensemble.own_jamming import PRESSURES, Point
from examples.studies.packing_ensemble.scenes import DENSITY, NU, YOUNG


def test_what_does_not_rearrange_has_one_jamming_point():
    """A disc that meets its images in a square box."""
    radius = 1e-3
    side = 2.01 * radius
    gel = skmpm.NeoHookean(YOUNG, NU, DENSITY)
    body = skmpm.Body(skmpm.disc((0.3 * radius, 0.1 * radius), radius, spacing=0.14e-3), gel)
    scene = skmpm.Scene([body], cell=0.19e-3, periodic=skmpm.Periodic(side, side))
    (point,) = own_jamming.measured(scene, (1e-3,))
    assert 1e-4 < point.own == pytest.approx(point.first, abs=3e-5)
    assert point.excess == 4.0 - (4.0 - 2.0)  # four neighbours; one disc needs two


def test_a_packing_of_the_main_job_is_compressed_and_released():
    point, denser = own_jamming.measured(own_jamming.loose(8, 0), (1e-3, 3e-3))
    assert 0.0 < point.own < denser.own
    assert point.excess > -1e-9


def test_the_table_has_the_exponents_of_its_points():
    """Z - Z_J = 3.6 times the root of the own distance, from the first one a line."""
    x = np.array(PRESSURES)
    packings = [[Point(d * (1.0 + noise), d**2, 3.6 * d) for d in x] for noise in (0.0, 0.1)]
    lines = list(own_jamming.table(packings))
    assert lines[-1].startswith("exponent from own: 0.5 ±")
    assert lines[-2].startswith("exponent from first: 1 ±")
    assert all(line.endswith("| 3.6 ± 0 |") or "3.6 ±" in line.split(" | ")[-1] for line in lines[2:-2])
