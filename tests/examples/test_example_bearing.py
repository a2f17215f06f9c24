"""The example of a laminated bearing."""

import pytest

from examples import bearing


def test_bearing(tmp_path):
    """Within 3 % of Gent and Lindley, whose strip is incompressible and parabolic: 1.5 % less at nu = 0.4995."""
    modulus, known = bearing.main(tmp_path)
    assert modulus == pytest.approx(known, rel=0.03)
    assert (tmp_path / "bearing.png").stat().st_size > 1000
