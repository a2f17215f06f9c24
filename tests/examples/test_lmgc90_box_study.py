"""The study of LMGC90's box of steel discs at small size: balance of momentum, bounds of the lid's force, page."""

import shutil

import numpy as np
import pytest

from examples.studies import sweeps
from examples.studies.lmgc90_box import study
from examples.studies.pages import DOCS
from skmpm import Sweep


def test_a_small_study_and_its_page(tmp_path):
    """Twenty discs, 30 steps: momentum is that of walls and weight; a lid on a solid block would bear rho c v width.

    The lid meets a disc in the second step; waves have not yet arrived at the floor.
    """
    sizes = ["--discs", "20", "--fraction", "0.72", "--seed", "1", "--cells", "4", "--until", "3e-4"]
    where = ["--out", str(tmp_path / "out"), "--docs", str(tmp_path)]
    shutil.copy(DOCS / "lmgc90_box.md", tmp_path)
    sweeps.command(study, words=[*sizes, *where])
    page = (tmp_path / "lmgc90_box.md").read_text()
    found = list(Sweep.read(tmp_path / "out").finished)
    assert sorted(member.parameters["theta"] for member in found) == [0.5, 1.0]
    for member in found:
        columns = member.columns
        assert len(columns["t"]) == 30
        box = study.build(**member.parameters).scene
        width, block = box.walls[3].point[0], study.block(box)
        assert block == pytest.approx(7850.0 * 5929.0 * 10.0 * width, rel=1e-3)
        assert columns["lid"][2:].min() > 0.01 * block and columns["lid"].max() < block
        assert study.unbalanced(columns) < 1e-9
        assert np.isnan(study.arrival(columns)) and abs(columns["floor"][-1]) < 1e-3 * columns["lid"][-1]
        squeezed = columns["solid_fraction"] * (width / study.RATIO - study.LID * columns["t"])
        assert squeezed == pytest.approx(0.72 * width / study.RATIO, rel=1e-3)
        assert columns["overlap"].max() < 1e-9
        assert columns["retries"].sum() == 0
    assert "| R/h | 4 | 4 |" in page and "| theta | 1 | 0.5 |" in page
    assert (tmp_path / "lmgc90_box" / "lmgc90_box.png").stat().st_size > 10_000
