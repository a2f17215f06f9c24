"""The shear study at small size: its three stages, its smoothing, and the page it writes."""

import shutil

import numpy as np
import pytest

from examples.studies import sweeps
from examples.studies.pages import DOCS
from examples.studies.periodic_shear import study

UNTIL, P = 0.03, 1e5


def test_a_small_study_and_its_page(tmp_path):
    """Twelve discs bear P after the first stage and in the third, whose shear stress rises; the page has it."""
    options = [
        "--discs",
        "12",
        "--seeds",
        "1",
        "--until",
        f"{UNTIL}",
        "--processes",
        "1",
        "--out",
        str(tmp_path / "out"),
        "--docs",
        str(tmp_path),
    ]
    shutil.copy(DOCS / "periodic_shear.md", tmp_path)
    sweeps.command(study, words=options)
    (member,) = study.skmpm.Sweep.read(tmp_path / "out").finished
    columns, sheared = member.columns, study.sheared(member)
    stage = columns["stage"]
    assert set(stage) == {0, 1, 2} and (np.diff(stage) >= 0).all()
    assert columns["pressure"][stage == 0][-1] > P > columns["pressure"][stage == 0][-2]
    assert sheared["strain"][-1] == pytest.approx(UNTIL, rel=1e-9)
    assert sheared["vertical"] == pytest.approx(P, rel=0.02)
    assert 0.1 < sheared["shear"][-1] / P < 0.5
    assert columns["overlap"].max() < 1e-3

    page = (tmp_path / "periodic_shear.md").read_text()
    assert "| 12 discs, friction 0.5, seed 0 |" in page
    assert "Made by `python -m examples.studies.periodic_shear" in page
    assert "1 member took" in page
    sweeps.command(study, words=["figures", "--study", str(tmp_path / "out"), "--docs", str(tmp_path)])
    assert (tmp_path / "periodic_shear.md").read_text() == page
    assert (tmp_path / "periodic_shear" / "shear.png").stat().st_size > 10_000


def test_means_over_a_window_of_strain():
    """A line stays one where the window is inside, and short steps weigh little: a spike of 1e-5 is gone."""
    strain = np.sort(np.concatenate([np.arange(1, 501) * 1e-3, [0.25 + 1e-5]]))
    line = 2.0 * strain
    line[np.searchsorted(strain, 0.25 + 1e-5)] += 1.0
    inner = (strain > 0.02) & (strain < 0.48)
    assert study.smooth(strain, line)[inner] == pytest.approx(2.0 * strain[inner], abs=4e-3)  # two steps
