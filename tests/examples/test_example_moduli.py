"""Moduli of a packing that is compressed."""

import numpy as np

from examples import moduli


def test_moduli(monkeypatch, tmp_path):
    """A packing stiffens under pressure, and is stiffer against compression than against shear."""
    monkeypatch.setattr(moduli, "PRESSURES", (1e5, 4e5))
    pressure, bulk, *shear = np.array(moduli.main(tmp_path, discs=9)).T
    assert np.diff(pressure)[0] > 0.0
    assert bulk[1] > 1.1 * bulk[0]
    assert (np.array(shear) < bulk).all()
    assert (np.array(shear) > 0.0).all()
    assert (tmp_path / "moduli.png").exists()
