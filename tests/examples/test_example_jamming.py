"""Jamming of few discs: the count of contacts, and a pressure that grows with the solid fraction."""

import numpy as np

from examples import jamming


def test_jamming(monkeypatch, tmp_path, capsys):
    """Isostatic at jamming; pressures are met, and K is between a thirtieth and a third of E."""
    monkeypatch.setattr(jamming, "PRESSURES", (2e2, 2e3))
    above, coordination, pressure, bulk = np.array(jamming.main(tmp_path, discs=14)).T
    printed = capsys.readouterr().out.split("\n")[0]
    contacts, isostatic = printed.split(": ")[1].split(" contacts, isostatic are ")
    assert contacts == isostatic
    assert 0.0 < above[0] < above[1]
    assert coordination[0] <= coordination[1]
    np.testing.assert_allclose(pressure, (2e2, 2e3), rtol=1e-3)
    assert ((bulk > jamming.YOUNG / 30) & (bulk < jamming.YOUNG / 3)).all()
    assert (tmp_path / "jamming.png").exists()
