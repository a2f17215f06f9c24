"""The example of a packing that comes to rest."""

import numpy as np
import pytest

from examples import rest


@pytest.mark.slow
def test_rest(tmp_path):
    """A frictionless packing whose lid stops comes to rest: nothing feeds the motion or the turning of its discs.

    With contact normals of another configuration than the stress, kinetic energy grew after the lid stopped.
    """
    table = rest.main(tmp_path, 12, 0.9, 160)
    kinetic, elastic, turning = np.transpose(table)
    assert kinetic[-1] <= 0.05 * kinetic[0]
    assert turning[-1] <= 0.01
    assert elastic[-1] > 0.9 * elastic[0]
    assert (tmp_path / "rest.png").stat().st_size > 1000
