"""Every example runs, and one number of each is what it should be."""

import csv
import runpy
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name):
    return runpy.run_path(str(EXAMPLES / name))


def test_fall():
    """Backward Euler falls by g t (t + dt) / 2."""
    state = example("fall.py")["main"]()
    x, y = state.x @ state.mass / state.mass.sum()
    assert x == pytest.approx(0.1 + 0.4, abs=1e-9)
    assert y == pytest.approx(0.05 + 2.0 * 0.4 - 0.5 * 9.81 * 0.4 * 0.401, abs=1e-9)


def test_cantilever():
    """End deflection against quadratic elements: Q1 cells, eight over the depth, bend 1 % too little."""
    module = example("cantilever.py")
    assert module["material_points"]() == pytest.approx(module["finite_elements"](), rel=0.01)


def test_squeeze():
    """Two equal discs flattened by 0.1 R at each of three contacts: the force of Hertz's plane contact.

    Between plates the stack shortens by 4 d, d the displacement of one contact, F = 0.0766 E* R (1 - 1.7 %) at
    d = 0.1 R. Tolerance 10 %: five cells per radius, nu = 0.45, and what is left of inertia.
    """
    state = example("squeeze.py")["main"]()
    lid, floor = state.wall_force[1, 1], -state.wall_force[0, 1]
    expected = 0.07663 * 0.9835 * 10e6 / (1.0 - 0.45**2) * 1e-3
    assert lid == pytest.approx(expected, rel=0.10)
    assert lid == pytest.approx(floor, rel=0.03)


def test_large():
    """A small one of the large bodies: few iterations, and the support carries weight and inertia.

    It sinks as far as one of 1e6 points, 2.079 mm, to 1 %: the arc held is one of whole boundary segments.
    """
    for found in example("large.py")["main"](6000).values():
        assert 0 < found["iterations"] <= 20
        assert found["balance"] <= 1e-6
    found = example("large.py")["advance"](example("large.py")["hanging"](6000, 0.3, 1), inertia=False)
    assert found["sag"] == pytest.approx(2.079e-3, rel=0.01)


def test_compaction(tmp_path):
    """A small version of the main job: the table is complete, and the checks of the full one hold."""
    module = example("compaction.py")
    options = ["--discs", "12", "--start", "0.6", "--until", "0.75", "--out", str(tmp_path)]
    module["run"](module["parser"]().parse_args(options))
    with (tmp_path / "observables.csv").open() as file:
        table = list(csv.DictReader(file))
    assert list(table[0]) == module["COLUMNS"]
    assert all(np.isfinite(float(value)) for line in table for value in line.values())
    assert float(table[-1]["solid_fraction_nominal"]) == pytest.approx(0.75, abs=1e-6)
    assert max(float(line["residual"]) for line in table) <= 1e-4
    assert max(float(line["overlap"]) for line in table) <= 2e-3
    with (tmp_path / "checks.csv").open() as file:
        checks = list(csv.DictReader(file))
    assert max(float(line["outside"]) for line in checks) <= 0.1
    assert all(abs(float(line["area"]) / float(line["volume"]) - 1.0) <= 5e-3 for line in checks)
    for name in ("packing.vtkhdf", "stages.png", "curves.png", "last.checkpoint"):
        assert (tmp_path / name).stat().st_size > 1000


@pytest.mark.slow
def test_held(monkeypatch):
    """A frictionless packing whose lid stops comes to rest: nothing feeds the motion or the turning of its discs.

    With contact normals of another configuration than the stress, kinetic energy grew after the lid stopped.
    """
    monkeypatch.syspath_prepend(str(EXAMPLES))
    table = example("held.py")["main"](20, 0.9, 160)
    kinetic, elastic, turning = np.transpose(table)
    assert kinetic[-1] <= 0.05 * kinetic[0]
    assert turning[-1] <= 0.01
    assert elastic[-1] > 0.9 * elastic[0]
