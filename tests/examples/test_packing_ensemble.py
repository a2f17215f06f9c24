"""The study at small size: all members, an interrupted run, and a repeated one."""

import csv
import json

import numpy as np
import pytest

from examples.studies.packing_ensemble import main_job, study


def table(folder):
    """Rows without the clock."""
    with (folder / "observables.csv").open() as file:
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


def test_an_interrupted_member_goes_on_from_its_checkpoint(monkeypatch, tmp_path):
    """Cut after twenty steps: the table and the last state are those of a run that was not cut."""
    chosen = study.members(study.parser().parse_args(SMALL))["mu0.5_seed1"]
    study.run("whole", chosen, tmp_path, {})
    simulate = study.skmpm.simulate

    def cut(*args, **options):
        for k, state in enumerate(simulate(*args, **options)):
            yield state
            if k == 19:
                raise KeyboardInterrupt

    monkeypatch.setattr(study.skmpm, "simulate", cut)
    with pytest.raises(KeyboardInterrupt):
        study.run("cut", chosen, tmp_path, {})
    monkeypatch.setattr(study.skmpm, "simulate", simulate)
    assert len(table(tmp_path / "cut")) == 20
    study.run("cut", chosen, tmp_path, {})
    assert table(tmp_path / "cut") == table(tmp_path / "whole")
    whole, again = (json.loads((tmp_path / name / "manifest.json").read_text()) for name in ("whole", "cut"))
    assert again == whole
    assert whole["finished"]


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
    found = study.row(20, scene, state)["pressure_points"]
    assert found == pytest.approx(seen.pressure_points - moving / box, rel=1e-6)
    assert found < 0.9 * seen.pressure_points, "and it makes a difference here"


def test_what_is_finished_is_not_run_again_and_what_is_other_is_refused(monkeypatch, tmp_path):
    chosen = study.members(study.parser().parse_args(SMALL))["mu0_seed0"] | {"until": 0.61}
    study.run("member", chosen, tmp_path, {})

    def never(*args, **options):
        raise AssertionError("run again")

    monkeypatch.setattr(study.compaction, "build", never)
    study.run("member", chosen, tmp_path, {})
    monkeypatch.undo()
    with pytest.raises(SystemExit, match="other parameters; delete"):
        study.run("member", chosen | {"until": 0.62}, tmp_path, {})


def test_a_member_that_fails_says_so_and_keeps_its_table(monkeypatch, tmp_path):
    chosen = study.members(study.parser().parse_args(SMALL))["mu0_seed0"]
    monkeypatch.setitem(study.compaction.SCHEMES, "balanced", study.skmpm.Scheme.accurate(max_newton=1))
    study.run("member", chosen, tmp_path, {})
    about = json.loads((tmp_path / "member" / "manifest.json").read_text())
    assert not about["finished"]
    assert "no convergence in 1 Newton iterations" in about["failed"]
    assert len(table(tmp_path / "member")) > 1


@pytest.mark.slow
def test_the_whole_study_in_small(tmp_path):
    """Two seeds in two processes; the rest of the members is cut to what shows that they run."""
    options = study.parser().parse_args(
        [*SMALL, "--out", str(tmp_path), "--processes", "2", "--only", "mu", "regridded"]
    )
    study.main(options)
    for name in ("mu0_seed0", "mu0_seed1", "mu0.5_seed0", "mu0.5_seed1", "regridded_mu0.5"):
        about = json.loads((tmp_path / name / "manifest.json").read_text())
        assert about["finished"], name
        assert float(table(tmp_path / name)[-1]["solid_fraction_nominal"]) == pytest.approx(0.7, abs=1e-6)


def test_the_main_job_keeps_its_promises(tmp_path):
    """A small one: the tables are complete, and the checks of the full one hold."""
    options = ["--discs", "12", "--start", "0.6", "--until", "0.75", "--out", str(tmp_path)]
    checks = main_job.main(main_job.parser().parse_args(options))
    with (tmp_path / "checks.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(checks)
    assert len(table(tmp_path)) == len(checks)
    assert max(line["outside"] for line in checks) <= 0.1
    assert all(abs(line["area"] / line["volume"] - 1.0) <= 5e-3 for line in checks)
    for name in ("packing.vtkhdf", "curves.png", "last.checkpoint"):
        assert (tmp_path / name).stat().st_size > 1000
