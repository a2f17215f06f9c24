"""The example of a packing of all shapes."""

import pytest

from examples import shapes


def test_shapes(tmp_path):
    """The solid fraction is the wanted one; squeezed from 0.7 to 0.85 the packing presses on its lid."""
    measured, pressure = shapes.main(tmp_path)
    assert measured == pytest.approx(shapes.START, rel=1e-12)
    assert 1e3 < pressure < 1e6
    assert (tmp_path / "shapes.png").stat().st_size > 1000
