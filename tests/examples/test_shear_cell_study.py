"""The study of plane shear at small size: balance of its walls, its profile, and the page it writes."""

import shutil
from types import SimpleNamespace

import numpy as np
import pytest

from examples.studies import sweeps
from examples.studies.pages import DOCS
from examples.studies.shear_cell import study


def test_a_small_study_and_its_page(tmp_path):
    """Twenty-four discs: the load reaches the lid, the page has a line for each point, figures draw the same page."""
    sizes = ["--discs", "24", "--seeds", "1", "--until", "0.3", "--pressure", "0.01", "--inertial", "0.1", "0.05"]
    where = ["--processes", "1", "--out", str(tmp_path / "out"), "--docs", str(tmp_path)]
    shutil.copy(DOCS / "shear_cell.md", tmp_path)
    sweeps.command(study, words=[*sizes, *where])
    members = list(study.skmpm.Sweep.read(tmp_path / "out").finished)
    assert len(members) == 2
    for member in members:
        columns = member.columns
        assert columns["strain"][-1] == pytest.approx(0.3, rel=1e-9)
        assert columns["overlap"].max() < 1e-3
        assert columns["pressure_lid"].max() > 0.0
        profile = np.array([columns[f"layer_{k}"][-1] for k in range(study.LAYERS)])
        assert profile[-1] > profile[0]
    page = (tmp_path / "shear_cell.md").read_text()
    assert "| 0.01 | 0.05 | 1 |" in page and "| 0.01 | 0.1 | 1 |" in page
    sweeps.command(study, words=["figures", "--study", str(tmp_path / "out"), "--docs", str(tmp_path)])
    assert (tmp_path / "shear_cell.md").read_text() == page
    assert (tmp_path / "shear_cell" / "shear_cell.png").stat().st_size > 10_000


def test_walls_that_bear_nothing_have_no_friction():
    """Until the load comes down: the page has a line with nan, and the study goes on."""
    names = ["t", "strain", "dt", "shear_floor", "pressure_floor", "shear_lid", "pressure_lid", "solid_fraction",
             "height", "overlap", "retries", "seconds"]  # fmt: skip
    columns = {name: np.zeros(3) for name in names} | {"dt": np.ones(3), "strain": np.array([0.1, 0.2, 0.3])}
    found = dict(zip(study.HEAD, study.line((0.01, 0.1), [SimpleNamespace(columns=columns)]), strict=True))
    assert found["μ"] == found["lid over floor, pressure"] == found["lid over floor, shear"] == "nan"
