"""The example of two discs that collide."""

from examples import collision


def test_collision(tmp_path):
    """Momentum to round-off; the midpoint rule loses less than backward Euler, and nothing is won."""
    found = collision.main(tmp_path)
    assert max(momentum for _, momentum in found.values()) < 1e-12
    assert 0.75 < found[1.0][0] < found[0.5][0] - 0.05
    assert found[0.5][0] < 1.0
    assert (tmp_path / "collision.png").stat().st_size > 1000
