"""The example of grains that yield."""

import pytest

from examples import powder


@pytest.mark.slow
def test_powder(tmp_path):
    """Most of the work is plastic; the grains keep the greater part of their flat faces."""
    share, pressed, released = powder.main(tmp_path)
    assert 0.5 < share < 0.9
    assert pressed == pytest.approx(1.055, abs=0.01)
    assert released - 1.0 > 0.6 * (pressed - 1.0)
    assert (tmp_path / "powder.png").stat().st_size > 1000
