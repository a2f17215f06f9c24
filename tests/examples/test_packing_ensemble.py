"""The study at small size: all members, an interrupted run, and a repeated one."""

import csv
import json
import shutil

import numpy as np
import pytest

from examples.studies import pages
from examples.studies.packing_ensemble import main_job, members, scenes, study


def table(folder, name="table.csv"):
    """Rows without the clock."""
    with (folder / name).open() as file:
        return [{k: v for k, v in line.items() if k != "seconds"} for line in csv.DictReader(file)]


SMALL = ["--discs", "12", "--seeds", "2", "--start", "0.6", "--until", "0.7"]


def chosen(*options):
    """The members of a study with these options."""
    return members.members(study.parser().parse_args([*SMALL, *options]))


def test_members_are_what_the_study_needs():
    found = members.members(study.parser().parse_args([]))
    count = {group: [members.group_of(name) for name in found].count(group) for group in members.GROUPS}
    assert count == {"quasistatic": 12, "periodic": 12, "lid": 6, "fast": 12, "nu": 4, "regridded": 1,
                     "shared_grid": 4, "fine": 6}  # fmt: skip
    for kind, last in (("quasistatic", 3), ("periodic", 3), ("fast", 3), ("fine", 1)):
        for friction in (0.0, 0.1, 0.5):
            assert f"{kind}_mu{friction:g}_seed{last}" in found
    for name, about in found.items():
        quick = about["scheme"] == "nezamabadi2017" if "scheme" in about else False
        slow = members.group_of(name) in ("quasistatic", "periodic", "lid", "nu", "fine")
        assert about["dt"] == (None if slow else 0.5e-6 if quick else 8e-6), name
        assert vars(scenes.options_of({})).keys() >= about.keys()
    assert found["fine_mu0_seed0"]["cell"] == pytest.approx(0.95e-3 / 8)
    assert [found[f"lid{v:g}_mu0.1_seed0"]["speed"] for v in members.LIDS] == [0.02, 0.002]
    assert {found[f"nu{nu:g}_mu0_seed1"]["nu"] for nu in members.RATIOS} == {0.3, 0.495}
    assert {about["nu"] for about in found.values() if about["until"] == 0.97} == {0.495}


def test_what_most_figures_need_comes_first_and_fine_grids_last():
    names = list(members.members(study.parser().parse_args([])))
    groups = [members.group_of(name) for name in names]
    assert groups == sorted(groups, key=list(members.GROUPS).index)
    assert names[:3] == [f"quasistatic_mu{mu}_seed0" for mu in ("0", "0.5", "0.1")]
    assert all("cell" in about for about in list(chosen().values())[-6:])
    assert sum(name.startswith("fine") for name in chosen("--fine-seeds", "1")) == 3


def test_the_slow_lid_is_quasi_static():
    """I = rate d sqrt(rho / P) at P = 1e-3 E* and a solid fraction of 0.84, below 1e-4."""
    options = scenes.options_of(members.members(study.parser().parse_args([]))["quasistatic_mu0_seed0"])
    scene, _ = scenes.build(scenes.options_of(vars(options) | {"discs": 40}))
    height = float(scene.walls[1].point[1]) * np.sqrt(300 / 40) * 0.70 / 0.84
    pressure = 1e-3 * 10e6 / (1.0 - 0.45**2)
    assert options.speed / height * 1.9e-3 * np.sqrt(990.0 / pressure) <= 1e-4


def test_a_member_is_the_compaction_of_its_options():
    """Its scene, steps and end, and the stages that its states are kept at."""
    about = chosen()["regridded_mu0.5_seed0"]
    run, options = study.build(**about), scenes.options_of(about)
    scene, until = study.compaction.build(options)
    assert (run.until, run.dt, run.scheme) == (until, options.dt, study.compaction.SCHEMES["regridded"])
    assert np.array_equal(run.scene.initial_positions, scene.initial_positions)
    kept = [name for name, wanted in run.keep.items() if wanted({"solid_fraction_nominal": 0.85})]
    assert kept == ["stage_0.75", "stage_0.84"]


def test_another_poissons_ratio_changes_the_material_only():
    run, usual = (study.build(**chosen()[name]) for name in ("nu0.3_mu0_seed1", "quasistatic_mu0_seed1"))
    assert {body.material.nu for body in run.scene.bodies} == {0.3}
    assert {body.material.nu for body in usual.scene.bodies} == {0.45}
    assert np.array_equal(run.scene.initial_positions, usual.scene.initial_positions)
    assert (run.until, run.scene.cell, run.dt) == (usual.until, usual.scene.cell, None)


def test_a_periodic_box_shrinks_at_the_speed_of_its_edges_to_its_end():
    """Edges are linear in time, and the box is as full as asked at the end."""
    about = chosen()["periodic_mu0.5_seed0"]
    run = study.build(**about)
    box, speed = run.scene.periodic, about["speed"]
    for t in (0.0, 0.5 * run.until):
        rate = box.rate_at(t)
        assert rate[0, 0] * (box.width - speed * t) == pytest.approx(-speed)
        assert rate[1, 1] * (box.height - speed * t) == pytest.approx(-speed)
    left = (box.width - speed * run.until) * (box.height - speed * run.until)
    assert run.scene.initial_volumes.sum() / left == pytest.approx(about["until"], rel=2e-3)


def test_the_pressure_of_the_points_leaves_out_how_discs_move():
    """By the parallel axis theorem: that of the library, which has all motion, less the motion of the centres."""
    options = scenes.options_of(chosen()["fast_mu0.5_seed1"])
    scene, _ = scenes.build(options)
    *_, state = study.skmpm.simulate(scene, dt=options.dt, until=20 * options.dt)
    seen = study.skmpm.observe(scene, state)
    mass = np.bincount(state.body, state.mass)
    velocity = np.array([np.bincount(state.body, state.mass * v) for v in state.v]) / mass
    drift = velocity @ mass / mass.sum()
    moving = np.sum(mass * (velocity - drift[:, None]) ** 2) / 2.0
    box = scene.initial_volumes.sum() / seen.solid_fraction_nominal
    found = study.row(scene, state)["pressure_points"]
    assert found == pytest.approx(seen.pressure_points - moving / box, rel=1e-6)
    assert found < 0.9 * seen.pressure_points, "and it makes a difference here"


@pytest.mark.slow
def test_the_whole_study_in_small(tmp_path, capsys):
    """A member of each group at least, in two processes, cut to what shows that they run; then the page."""
    docs = tmp_path / "docs"
    docs.mkdir()
    shutil.copy(pages.DOCS / "packing_ensemble.md", docs)
    only = ["quasistatic_mu0.5", "periodic_mu0.1_seed0", "fast_mu0.5_seed0", "nu0.3_mu0_seed0", "regridded"]
    options = [*SMALL, "--start", "0.66", "--slow", "0.05", "--processes", "2"]
    options += ["--out", str(tmp_path / "out"), "--docs", str(docs)]
    study.main(study.parser().parse_args([*options, "--only", *only]))
    for name in ("quasistatic_mu0.5_seed0", "quasistatic_mu0.5_seed1", "periodic_mu0.1_seed0", "fast_mu0.5_seed0",
                 "nu0.3_mu0_seed0", "regridded_mu0.5_seed0"):  # fmt: skip
        about = json.loads((tmp_path / "out" / name / "manifest.json").read_text())
        assert about["status"] == "finished", name
        nominal = float(table(tmp_path / "out" / name)[-1]["solid_fraction_nominal"])
        assert nominal == pytest.approx(0.7, abs=2e-3 if "periodic" in name else 1e-6)
    assert "Sweep(6 members, rows" in capsys.readouterr().out
    page = (docs / "packing_ensemble.md").read_text()
    assert "Made by `python -m examples.studies.packing_ensemble" in page
    assert "6 members" in page
    assert "All with one version of the library, skmpm" in page
    assert "| quasi-static, uniaxial | 2 of 12 | quasistatic_mu0_seed0," in page
    assert "| other quasi-static lids | 0 of 6 | all |" in page


def test_the_main_job_keeps_its_promises(tmp_path):
    """A small one: the table is complete, and the checks of the full one hold."""
    options = ["--discs", "12", "--start", "0.68", "--until", "0.75", "--out", str(tmp_path)]
    checks = main_job.main(main_job.parser().parse_args(options))
    written = table(tmp_path, "observables.csv")
    assert len(written) == len(checks) and written[0].keys() >= main_job.CHECKS.keys()
    assert max(line["outside"] for line in checks) <= 0.1
    assert all(abs(line["area"] / line["volume"] - 1.0) <= 5e-3 for line in checks)
    for name in ("packing.vtkhdf", "curves.png", "last.checkpoint"):
        assert (tmp_path / name).stat().st_size > 1000
    with pytest.raises(SystemExit, match="has a run: give another --out"):
        main_job.main(main_job.parser().parse_args(options))
