"""The example of a series for ParaView."""

import numpy as np

from examples import paraview


def test_paraview(tmp_path, monkeypatch):
    """What is read back is what was written: positions as doubles, pressures as singles."""
    monkeypatch.setattr(paraview, "UNTIL", 0.03)
    monkeypatch.setattr(paraview, "EVERY", 3)
    last, frames = paraview.main(tmp_path)
    assert len(frames) == 25
    frame = frames[-1]
    assert frame.t == last.t
    np.testing.assert_array_equal(frame.x, last.x)
    expected = -0.5 * (last.stress[0, 0] + last.stress[1, 1])
    np.testing.assert_allclose(frame.points["pressure"], expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())
    assert (tmp_path / "paraview.png").stat().st_size > 1000
