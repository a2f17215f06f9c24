"""The study at small size: all members, an interrupted run, and a repeated one."""

import csv
import json

import numpy as np
import pytest

from examples.studies.packing_ensemble import main_job, study


def table(folder, name="table.csv"):
    """Rows without the clock."""
    with (folder / name).open() as file:
        return [{k: v for k, v in line.items() if k != "seconds"} for line in csv.DictReader(file)]


SMALL = ["--discs", "12", "--seeds", "2", "--start", "0.6", "--until", "0.7"]


def test_members_are_what_the_study_needs():
    found = study.members(study.parser().parse_args(SMALL))
    assert sum(name.startswith(("mu0_", "mu0.5_")) for name in found) == 4
    assert {about["friction"] for about in found.values()} == {0.0, 0.5}
    assert found["fine_mu0"]["cell"] == pytest.approx(0.95e-3 / 8)
    assert found["shared_grid_mu0_r6"]["scheme"] == "nezamabadi2017"
    assert found["shared_grid_mu0_r6"]["dt"] == 0.5e-6
    assert found["slow_mu0.5"]["speed"] == 0.5
    for about in found.values():
        assert vars(study.compaction.parser().parse_args([])).keys() >= about.keys()


def test_a_member_is_the_compaction_of_its_options():
    """Its scene, steps and end, and the stages that its states are kept at."""
    chosen = study.members(study.parser().parse_args(SMALL))["regridded_mu0.5"]
    run = study.build(**chosen)
    options = study.compaction.parser().parse_args([])
    vars(options).update(chosen)
    scene, until = study.compaction.build(options)
    assert (run.until, run.dt, run.scheme) == (until, options.dt, study.compaction.SCHEMES["regridded"])
    assert np.array_equal(run.scene.initial_positions, scene.initial_positions)
    kept = [name for name, wanted in run.keep.items() if wanted({"solid_fraction_nominal": 0.85})]
    assert kept == ["stage_0.75", "stage_0.84"]


def test_the_pressure_of_the_points_leaves_out_how_discs_move():
    """By the parallel axis theorem: that of the library, which has all motion, less the motion of the centres."""
    chosen = study.members(study.parser().parse_args(SMALL))["mu0.5_seed1"]
    options = study.compaction.parser().parse_args([])
    vars(options).update(chosen)
    scene, _ = study.compaction.build(options)
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
    """Two seeds in two processes; the rest of the members is cut to what shows that they run."""
    options = study.parser().parse_args(
        [*SMALL, "--out", str(tmp_path), "--processes", "2", "--only", "mu", "regridded"]
    )
    study.main(options)
    for name in ("mu0_seed0", "mu0_seed1", "mu0.5_seed0", "mu0.5_seed1", "regridded_mu0.5"):
        about = json.loads((tmp_path / name / "manifest.json").read_text())
        assert about["status"] == "finished", name
        assert about["parameters"]["friction"] == float("0.5" in name) / 2.0
        assert float(table(tmp_path / name)[-1]["solid_fraction_nominal"]) == pytest.approx(0.7, abs=1e-6)
    assert "Sweep(5 members, rows" in capsys.readouterr().out


def test_the_main_job_keeps_its_promises(tmp_path):
    """A small one: the tables are complete, and the checks of the full one hold."""
    options = ["--discs", "12", "--start", "0.6", "--until", "0.75", "--out", str(tmp_path)]
    checks = main_job.main(main_job.parser().parse_args(options))
    with (tmp_path / "checks.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(checks)
    assert len(table(tmp_path, "observables.csv")) == len(checks)
    assert max(line["outside"] for line in checks) <= 0.1
    assert all(abs(line["area"] / line["volume"] - 1.0) <= 5e-3 for line in checks)
    for name in ("packing.vtkhdf", "curves.png", "last.checkpoint"):
        assert (tmp_path / name).stat().st_size > 1000
