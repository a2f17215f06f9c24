"""The example of a ring that touches itself."""

import numpy as np

from examples import c_ring


def test_c_ring(tmp_path):
    """Plates carry the same force; ring and load are symmetric, so neither arm passes the middle between the plates.

    Where the tips meet, two corners that a disc of 0.05 cells rounds, they do by up to 0.03 cells. The closed ring is
    several times stiffer than the open one.
    """
    states = c_ring.main(tmp_path)
    forces = np.array([state.wall_force[:, 1] for state in states])
    np.testing.assert_allclose(forces[:, 0], -forces[:, 1], rtol=5e-3)
    closed = np.array([(state.contacts.force[0, state.contacts.bodies[1] == 0] > 0.0).any() for state in states])
    first = int(np.argmax(closed))
    assert closed[first:].all()
    rate = np.diff(forces[:, 1])
    assert rate[first + 2] > 3.0 * rate[first - 2]
    above = c_ring.scene.initial_positions[1] > 0.0
    for state in states[first:]:
        height = (state.x[1] - state.walls[:, 1].mean()) / c_ring.CELL
        assert height[above].min() > -0.03
        assert height[~above].max() < 0.03
    assert (tmp_path / "c_ring.png").stat().st_size > 1000
