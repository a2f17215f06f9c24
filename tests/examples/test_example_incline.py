"""The example of a block on a slope."""

import pytest

from examples import incline


def test_incline(tmp_path):
    """Speeds by g (sin - mu cos) t; they differ by how the block's weight sets in, less than 1 % of g sin t."""
    found = incline.main(tmp_path)
    full = found[0.0][1]
    for friction, (speed, exact) in found.items():
        assert speed == pytest.approx(exact, abs=0.01 * full), friction
    assert found[0.0][0] == pytest.approx(full, rel=1e-6)
    assert abs(found[0.5][0]) < 1e-3 * full, "it sticks"
    assert (tmp_path / "incline.png").stat().st_size > 1000
