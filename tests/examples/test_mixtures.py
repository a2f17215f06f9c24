"""The study of mixtures at small size: its pressure by two ways, its law, and the page it writes."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

import skmpm
from examples.studies import sweeps
from examples.studies.mixtures import checks, figures, study
from examples.studies.packing_ensemble.fits import Compaction
from examples.studies.pages import DOCS

SMALL = ["--discs", "10", "--share", "0", "0.5", "--friction", "0.5", "--seeds", "1", "--slower"]


def test_a_small_study_and_its_page(tmp_path):
    """Ten discs follow the ramp, rigid ones fill less; stresses inside discs are the given pressure."""
    where = ["--processes", "1", "--out", str(tmp_path / "out"), "--docs", str(tmp_path)]
    shutil.copy(DOCS / "mixtures.md", tmp_path)
    sweeps.command(study, figures, [*SMALL, "--until", "0.02", "--ramp", "0.02", *where])
    soft, mixed = figures.skmpm.Sweep.read(tmp_path / "out").finished
    assert (soft.parameters["share"], mixed.parameters["share"]) == (0.0, 0.5)
    for member in (soft, mixed):
        before, columns = member.columns["given"] == 0.0, figures.pressed(member)
        assert member.columns["pressure"][before][-1] > study.FIRST > member.columns["pressure"][before][-2]
        assert columns["given"][-1] == pytest.approx(0.02, rel=1e-12)
        assert columns["pressure"][-1] == pytest.approx(0.02, rel=5e-3)
        assert columns["pressure_inside"] == pytest.approx(columns["pressure"], rel=5e-3, abs=2e-5)
        assert columns["solid_fraction_points"] == pytest.approx(columns["solid_fraction"], rel=1e-3)
        assert columns["overlap"].max() < 1e-3 and columns["overlap_rigid"].max() < 1e-2
        assert columns["solid_fraction"][-1] > columns["solid_fraction"][0] + 0.02
    ends = [figures.at(figures.pressed(member), "solid_fraction", 0.02) for member in (soft, mixed)]
    assert ends[0] > ends[1] + 0.005

    page = (tmp_path / "mixtures.md").read_text()
    assert "| 0 | 0.5 | 0.02 | " in page and "| 0.5 | 0.5 | 0.02 | " in page
    assert "Made by `python -m examples.studies.mixtures" in page and "2 members took" in page
    checks = (tmp_path / "mixtures" / "checks.csv").read_text().splitlines()
    assert len(checks) == 3 and checks[0] == ",".join(f'"{name}"' if "," in name else name for name in figures.CHECKS)
    assert len((tmp_path / "mixtures" / "members.csv").read_text().splitlines()) == 3
    sweeps.command(study, figures, ["figures", "--study", str(tmp_path / "out"), "--docs", str(tmp_path)])
    assert (tmp_path / "mixtures.md").read_text() == page
    assert (tmp_path / "mixtures" / "mixtures.png").stat().st_size > 10_000


def test_shares_are_nested_in_one_packing():
    """A seed has the same places at all shares; what is rigid at a smaller share is rigid at a larger one."""
    centres, rigid = [], []
    for share in (0.0, 0.25, 0.75):
        bodies, _ = study.packing(12, share, seed=1)
        centres.append([body.points.x.mean(axis=1) for body in bodies])
        rigid.append({i for i, body in enumerate(bodies) if isinstance(body.material, skmpm.Rigid)})
    assert [len(each) for each in rigid] == [0, 3, 9] and rigid[1] < rigid[2]
    assert np.array(centres[1:]) == pytest.approx(np.array([centres[0]] * 2), abs=1e-12)


def test_members_and_the_slower_one():
    """Sixteen members, and the first packing with the middle share and the last friction again, twice as slowly."""
    members = study.members(sweeps.parser(study).parse_args([]))
    slower = members[-1]
    assert len(members) == 17 and [member["ramp"] for member in members] == [0.1] * 16 + [0.2]
    assert (slower["share"], slower["friction"], slower["seed"]) == (0.5, 0.5, 0)
    assert slower | {"ramp": 0.1} in members


def test_overlap_of_rigid_discs_across_an_edge_of_the_box():
    """Two circles of radius 1 mm, 2.1 and then 1.9 mm apart through the edge; a soft one between does not count."""
    soft, hard = skmpm.NeoHookean(E=1e6, nu=0.3, density=1000.0), skmpm.Rigid(1000.0)
    places = ((1e-3, 2e-3), hard), ((8.9e-3, 2e-3), hard), ((3.5e-3, 2e-3), soft)
    bodies = [skmpm.Body(skmpm.disc(x, 1e-3, spacing=0.2e-3), material) for x, material in places]
    scene = skmpm.Scene(bodies, cell=0.3e-3, periodic=skmpm.Periodic(10e-3, 8e-3))
    apart = skmpm.initial(scene)
    assert checks.overlap_of_rigid_discs(scene, apart) == 0.0
    moved = (apart.body == 1) * 0.2e-3 - (apart.body == 2) * 1e-3
    closer = replace(apart, x=apart.x + np.stack([moved, 0.0 * moved]))
    assert checks.overlap_of_rigid_discs(scene, closer) == pytest.approx(0.1e-3, rel=1e-9)


def test_the_law_of_a_member_is_found_again():
    """Columns that follow the law of compaction, with a coordination that grows with the solid fraction."""
    phi = np.linspace(0.83, 0.93, 400)
    Z = 4.0 + 5.0 * np.sqrt(phi - 0.829)
    known = Compaction(b=0.06, phi_max=0.96, phi_0=0.829)
    limit, b, misfit = figures.law({"given": known(phi, Z), "solid_fraction": phi, "coordination": Z})
    assert (limit, b) == pytest.approx((0.96, 0.06), abs=1e-3) and misfit < 1e-3


def test_soft_discs_beside_those_of_the_packing_ensemble():
    """The curves of the ensemble: denser at higher pressures, and looser with friction at each."""
    smooth, rough = figures.ensemble(0.0), figures.ensemble(0.5)
    assert 0.84 < smooth[0] < smooth[1] < smooth[2] < 1.0
    assert all(a > b for a, b in zip(smooth, rough, strict=True))
    assert np.isnan(figures.ensemble(0.3)).all()
