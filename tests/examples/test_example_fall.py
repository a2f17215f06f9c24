"""The example of free fall."""

import pytest

from examples import fall


def test_fall(tmp_path):
    """Backward Euler falls by g t (t + dt) / 2."""
    state = fall.main(tmp_path)
    x, y = state.x @ state.mass / state.mass.sum()
    assert x == pytest.approx(0.1 + 0.4, abs=1e-9)
    assert y == pytest.approx(0.05 + 2.0 * 0.4 - 0.5 * 9.81 * 0.4 * 0.401, abs=1e-9)
    assert (tmp_path / "fall.png").stat().st_size > 1000
