"""The example of the clamped beam."""

import pytest

from examples import cantilever


def test_cantilever(tmp_path):
    """End deflection against quadratic elements: Q1 cells, eight over the depth, bend 1 % too little."""
    assert cantilever.material_points(tmp_path) == pytest.approx(cantilever.finite_elements(), rel=0.01)
    assert (tmp_path / "cantilever.png").stat().st_size > 1000
