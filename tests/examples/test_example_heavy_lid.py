"""The example of a lid driven by its weight."""

import pytest

from examples import heavy_lid


def test_heavy_lid(tmp_path):
    """At rest the closed form of the block; the period of a mass on a spring, longer by damping and its own mass."""
    shortening, period = heavy_lid.main(tmp_path)
    assert shortening == pytest.approx(1.0, abs=1e-3)
    assert period == pytest.approx(1.02, abs=0.02)
    assert (tmp_path / "heavy_lid.png").stat().st_size > 1000
