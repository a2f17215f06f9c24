"""The example of an ensemble."""

import numpy as np
import pytest

from examples import sweep


@pytest.mark.slow
def test_sweep(monkeypatch, tmp_path):
    """Pyramids stand above tan 15 deg: their force rises to the end; below, the lid touches nothing at last."""
    monkeypatch.setattr(sweep, "SEEDS", range(1))  # of three pyramids
    found = sweep.main(tmp_path)
    assert not found.failed
    assert len(found) == 4
    for member in found:
        force, stands = member.columns["force"], member.parameters["friction"] > np.tan(np.radians(15.0))
        assert (force[-1] == force.max() > 200.0) == stands, member.name
        assert (force[-1] < 0.1 * force.max()) != stands, member.name
    assert (tmp_path / "sweep.png").stat().st_size > 1000
    times = [(member.folder / "table.csv").stat().st_mtime_ns for member in found]
    again = sweep.main(tmp_path)
    assert [(member.folder / "table.csv").stat().st_mtime_ns for member in again] == times
