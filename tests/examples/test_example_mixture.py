"""The example of rigid and soft grains in a periodic box."""

import pytest

from examples import mixture


@pytest.mark.slow
def test_mixture(tmp_path):
    """The pressure is the given one; forces between rigid grains are about those between all."""
    pressure, hard = mixture.main(tmp_path)
    assert pressure == pytest.approx(1.0, abs=2e-3)
    assert hard == pytest.approx(1.0, abs=0.2)
    assert (tmp_path / "mixture.png").stat().st_size > 1000
