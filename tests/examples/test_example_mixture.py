"""The example of rigid and soft grains in a periodic box."""

import pytest

from examples import mixture


@pytest.mark.slow
def test_mixture(tmp_path):
    """The pressure is the given one; rigid grains bear more than their share."""
    pressure, hard = mixture.main(tmp_path)
    assert pressure == pytest.approx(1.0, abs=2e-3)
    assert 1.0 < hard < 2.0
    assert (tmp_path / "mixture.png").stat().st_size > 1000
