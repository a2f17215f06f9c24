"""The example of the contact pressure of an O-ring's section."""

import pytest

from examples import contact_pressure


def test_contact_pressure(tmp_path):
    """Peak of Hertz's ellipse of the same force: 10 %, as d/R = 0.2 is beyond small strains."""
    peak, hertz = contact_pressure.main(tmp_path)
    assert peak == pytest.approx(hertz, rel=0.1)
    assert (tmp_path / "contact_pressure.png").stat().st_size > 1000
