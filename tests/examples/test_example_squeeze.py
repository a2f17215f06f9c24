"""The example of two compressed discs."""

import pytest

from examples import squeeze


def test_squeeze(tmp_path):
    """Two equal discs flattened by 0.1 R at each of three contacts: the force of Hertz's plane contact.

    Between plates the stack shortens by 4 d, d the displacement of one contact, F = 0.0766 E* R (1 - 1.7 %) at
    d = 0.1 R. Tolerance 10 %: five cells per radius, nu = 0.45, and what is left of inertia.
    """
    state = squeeze.main(tmp_path)
    lid, floor = state.wall_force[1, 1], -state.wall_force[0, 1]
    expected = 0.07663 * 0.9835 * 10e6 / (1.0 - 0.45**2) * 1e-3
    assert lid == pytest.approx(expected, rel=0.10)
    assert lid == pytest.approx(floor, rel=0.03)
    assert (tmp_path / "squeeze.png").stat().st_size > 1000
