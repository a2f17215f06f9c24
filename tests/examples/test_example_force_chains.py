"""Force chains of a squeezed packing."""

import numpy as np
from PIL import Image

from examples import force_chains


def test_force_chains(monkeypatch, tmp_path):
    """The lid presses down, so normals point along y more often than along x; 40 of the 100 discs show it."""
    monkeypatch.setattr(force_chains, "END", 0.84)  # instead of 0.88: two thirds of the way
    fabric = force_chains.main(tmp_path, discs=40)
    assert abs(np.trace(fabric) - 1.0) < 1e-12
    assert 0.45 < fabric[1, 1] < 0.65
    assert (tmp_path / "force_chains.png").exists()
    with Image.open(tmp_path / "film.gif") as film:
        assert film.n_frames >= 15
