"""The study of a hopper at small size: an outlet that empties it, one that clogs, and the page it writes."""

import shutil

import pytest

from examples.studies import sweeps
from examples.studies.hopper import study
from examples.studies.pages import DOCS


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Three discs and two outlets, 2.5 and 1.05 mean diameters wide."""
    path = tmp_path_factory.mktemp("hopper")
    sizes = ["--discs", "3", "--seeds", "1", "--outlet", "2.5", "1.05", "--softness", "0.001"]
    shutil.copy(DOCS / "hopper.md", path)
    where = ["--processes", "1", "--out", str(path / "out"), "--docs", str(path)]
    sweeps.command(study, words=[*sizes, *where])
    return path


def members(ran):
    found = study.skmpm.Sweep.read(ran / "out").finished
    return (found.where(outlet=width).members[0] for width in (2.5, 1.05))


def test_all_discs_leave_a_wide_outlet_and_none_comes_back(ran):
    wide, _ = members(ran)
    inside = wide.columns["inside"]
    assert inside[0] == 3 and inside[-1] == 0 and not study.clogged(wide)
    assert (inside[1:] <= inside[:-1]).all()
    assert wide.columns["overlap"].max() < 1e-3


def test_the_hopper_and_its_walls_bear_what_rests_on_an_arch(ran):
    _, narrow = members(ran)
    assert study.clogged(narrow)
    assert narrow.columns["borne"][-1] == pytest.approx(1.0, abs=1e-4)
    assert abs(narrow.columns["borne"][narrow.columns["lasted"] < 1.0] - 1.0).max() > 0.1  # not while they fall
    state = narrow.state()
    scene = study.scene_of(narrow, state)
    lowest = min(study.skmpm.observe(scene, state).bodies.centre[1][:-1])
    assert study.arch(scene, state) in (2, 3) and lowest > 0.0


def test_the_page_has_a_line_for_each_point_and_is_drawn_again(ran):
    page = (ran / "hopper.md").read_text()
    assert "| 1.05 | 1 | 1 | 0 | 3.0 |" in page and "| 2.5 | 1 | 0 | 3 |  |  |" in page
    sweeps.command(study, words=["figures", "--study", str(ran / "out"), "--docs", str(ran)])
    assert (ran / "hopper.md").read_text() == page
    assert (ran / "hopper" / "hopper.png").stat().st_size > 10_000


def test_a_disc_is_flattened_in_proportion_to_its_softness_where_that_is_small():
    """Contacts of discs in a plane are linear but for a logarithm, and cells hide that."""
    assert study.flattening(1e-3) == pytest.approx(10.0 * study.flattening(1e-4), rel=0.1)
    assert 0.5e-3 < study.flattening(1e-3) < 2e-3
