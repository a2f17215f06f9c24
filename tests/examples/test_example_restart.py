"""The example of a run that is killed and resumed."""

from examples import restart


def test_restart(tmp_path):
    """Bit for bit, and the first process did not come to its end."""
    same = restart.main(tmp_path)
    assert same == dict.fromkeys(("x", "v", "F", "C"), True)
    begun = restart.skmpm.load(tmp_path / "squeeze.checkpoint")
    assert 0.0 < begun.t < 0.9 * restart.UNTIL
    assert (tmp_path / "restart.png").stat().st_size > 1000
