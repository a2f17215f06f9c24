"""The example of a tube from a mesh."""

import pytest

from examples import from_mesh


def test_from_mesh(tmp_path):
    """Against the thin ring to 5 %: thickness over radius 0.1, five cells across the wall, strains of 0.3 %."""
    force, ring = from_mesh.main(tmp_path)
    assert force == pytest.approx(ring, rel=0.05)
    assert (tmp_path / "tube.msh").read_text().startswith("$MeshFormat\n2.2")
    assert (tmp_path / "from_mesh.png").stat().st_size > 1000
