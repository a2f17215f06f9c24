"""The example of grains from a picture."""

import pytest

from examples import contours


def test_contours(tmp_path):
    """The area is that of the pixels, to a tenth of a per cent; the squeezed grains press on the lid."""
    area, pressure = contours.main(tmp_path)
    assert area == pytest.approx(1.0, abs=1e-3)
    assert 1e4 < pressure < 1e6
    assert (tmp_path / "contours.png").stat().st_size > 1000
