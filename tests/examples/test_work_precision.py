"""The work-precision study at small size: its commands, resumption, records, and rules of comparison."""

import re
import shutil
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from test_studies import run

import skmpm
from skmpm.sweep import execution

ROOT = Path(__file__).parents[2]
DOCS, STUDY = ROOT / "docs" / "studies", ROOT / "examples" / "studies" / "work_precision"


@pytest.fixture
def study():
    """Gives the study's modules by their names."""
    return lambda name: import_module(f"examples.studies.work_precision.{name}")


@pytest.fixture
def no_pictures(study, monkeypatch):
    """Called, lets pages be written without their pictures: drawing them once will do."""

    def leave_out():
        for name in ("fronts", "parameters", "codes"):
            monkeypatch.setattr(study("page").figures, name, lambda *args: None)

    return leave_out


CANTILEVER = ["--scenes", "cantilever", "--only", "preset", "sample", "--runs", "2", "--processes", "1"]


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """The study of the cantilever, presets and two of the sample, and the page of it with all pictures.

    By path from elsewhere: the process that the study spawns finds it, too.
    """
    folder = tmp_path_factory.mktemp("study")
    (folder / "docs").mkdir()
    (folder / "docs" / "work_precision.md").write_text((DOCS / "work_precision.md").read_text())
    assert "cantilever preset" in run([STUDY], *CANTILEVER, "--out", "out", "--docs", "docs", cwd=folder)
    return folder


def test_commands(study, no_pictures, ran, tmp_path):
    """The study and the page of it; run again, nothing is done; and the page alone."""
    shutil.copytree(ran, tmp_path, dirs_exist_ok=True)
    no_pictures()
    module, page = study("study"), study("page")
    where = ["--out", str(tmp_path / "out"), "--docs", str(tmp_path / "docs")]
    options = module.parser().parse_args([*CANTILEVER, *where])
    found = skmpm.Sweep.read(tmp_path / "out")
    assert len(found) == 5
    balanced = [m for m in found if m.parameters["setting"]["newton_tol"] == 1e-3]
    assert [m.columns["newton"].tolist() for m in balanced] == [[1.0] * 4]
    times = [(member.folder / "table.csv").stat().st_mtime_ns for member in found]
    module.main(options)
    assert [(member.folder / "table.csv").stat().st_mtime_ns for member in found] == times
    rest = (DOCS / "work_precision.md").read_text().split("<!-- /codes -->\n")[1]
    for _ in range(2):
        page.write(tmp_path / "out", tmp_path / "docs")
        text = (tmp_path / "docs" / "work_precision.md").read_text()
        assert "\ncantilever,5,2," in (tmp_path / "docs" / "work_precision" / "scenes.csv").read_text()
        assert "All with one version of the library, skmpm" in text
        assert text.count("## Presets") == 1
        assert text.endswith(rest)
    assert len((tmp_path / "docs" / "work_precision" / "results.csv").read_text().splitlines()) == 6
    linked = re.findall(r"\{download\}`[^<]* <work_precision/([^>]*)>`", text.split("<!-- /codes -->")[0])
    assert len(linked) >= 7 and all((tmp_path / "docs" / "work_precision" / name).exists() for name in linked)


def test_every_setting_is_a_scheme_and_larger_samples_begin_with_smaller(study):
    """All that is planned is accepted by `Scheme`; the plan has every reason to run; what is idle is left out."""
    parameters, scenes, module = study("parameters"), study("scenes"), study("study")
    members = module.plan(list(scenes.CASES), 64)
    for member in members:
        case = scenes.CASES[member.scene]
        if not case.against:
            parameters.scheme_of(member.setting, inertia=case.inertia)
        assert scenes.setting_on(member.scene, member.setting) == member.setting
    assert {m.why for m in members} == set(module.KINDS)
    assert parameters.sample(64)[:10] == parameters.sample(10)
    loose = parameters.DEFAULT | {"contact_tol": 1e-4, "theta": 0.5}
    same = [
        name for name in ("cantilever", "hertz", "collision") if scenes.setting_on(name, loose) == parameters.DEFAULT
    ]
    assert same == ["cantilever"]


def test_presets_are_those_of_the_library(study):
    """What the study measures under their names solves as tightly as they do, and averages dilatation as they do."""
    parameters = study("parameters")
    for name, setting in parameters.PRESETS.items():
        assert parameters.scheme_of(setting, inertia=True) == getattr(skmpm.Scheme, name)()


def test_chosen_steps_are_one_more_level_where_there_is_inertia(study):
    """They have no length and no pace; statics know nothing of them."""
    parameters, scenes, discs = study("parameters"), study("scenes"), study("discs")
    chosen = parameters.DEFAULT | {"chosen": True, "pace": 4.0}
    assert discs.time_step(chosen, 8e-6) is None
    assert scenes.setting_on("packing", chosen) == parameters.DEFAULT | {"chosen": True}
    assert scenes.setting_on("hertz", chosen) == parameters.DEFAULT
    runs = {scene: [s for s in scenes.CASES[scene].settings if s["chosen"]] for scene in study("results").LIDS}
    assert [len(settings) for settings in runs.values()] == [1] * 4


def test_ends_of_runs(study):
    """A run without enough time or points says so; costs are counted up to there."""
    module, parameters, results = study("study"), study("parameters"), study("results")
    (late,) = module.measure("hertz", parameters.DEFAULT, 0.05)
    assert late["status"] == "too long: more than 0.05 s"
    setting = parameters.DEFAULT | {"cells": 6.3, "spacing": 2.0}
    (torn,) = module.build("cantilever", setting, kept=Path())
    assert torn["status"].startswith("failed")
    columns = {name: np.array([value]) for name, value in torn.items()}
    versions = {"versions": {"source": "0" * 64}}
    member = SimpleNamespace(
        columns=columns, parameters={"scene": "cantilever", "setting": setting}, status="finished", manifest=versions
    )
    run = results.run_of(results.result_of(member), frozenset(), None)
    assert run.error == float("inf")
    assert run.status == torn["status"]


def test_retiming_keeps_the_shorter_time(study, no_pictures, ran, tmp_path):
    """The presets on the cantilever once more, beside the first time; the faster counts."""
    no_pictures()
    module, results = study("study"), study("results")
    shutil.copytree(ran, tmp_path, dirs_exist_ok=True)
    where = ["--out", str(tmp_path / "out"), "--docs", str(tmp_path / "docs")]
    command = ["--scenes", "cantilever", "--only", "preset", "--processes", "1", *where]
    module.main(module.parser().parse_args([*command, "--retime"]))
    found = skmpm.Sweep.read(tmp_path / "out")
    assert sorted(member.parameters.get("again", 0) for member in found) == [0] * 5 + [1] * 3
    runs = results.load(tmp_path / "out").why("cantilever", "preset")
    assert len(runs) == 3
    for timed in runs:
        same = [m for m in found if results.key(m.parameters["setting"]) == results.key(timed.setting)]
        assert timed.seconds == pytest.approx(min(m.columns["seconds"].sum() / 4.0 for m in same), rel=1e-12)


def test_references(study):
    """Tip against Timoshenko's beam to 1 %: the clamp holds the depth too. Q2 elements half as fine: 5e-4.

    Hertz at depth 0.02: force / E* R is 0.010287 by the formula and 0.9985 of it by finite elements.
    """
    beam, statics = study("beam"), study("statics")
    E = statics.E / (1.0 - statics.NU**2)
    bending = beam.FORCE * beam.LENGTH**3 * 4.0 / (E * beam.DEPTH**3)
    shear = beam.FORCE * beam.LENGTH / (5.0 / 6.0 * statics.MU * beam.DEPTH)
    assert beam.finite_elements(16).tip == pytest.approx(bending + shear, rel=1e-2)
    assert beam.finite_elements(8).tip == pytest.approx(beam.finite_elements(16).tip, rel=5e-4)
    assert study("hertz").reference(0.02)[0] == pytest.approx(0.010287 * 0.9985, rel=1e-3)


def test_a_long_run_goes_on_from_its_checkpoint(study, monkeypatch, tmp_path):
    """The packing up to 0.72, cut after eight steps: curves and counts are those of a run that was not cut."""
    discs, parameters, module, results = study("discs"), study("parameters"), study("study"), study("results")
    monkeypatch.setattr(discs, "END", 0.72)
    setting = parameters.DEFAULT | {"cells": 2.5}
    left = iter(range(7))
    worker = execution.Worker(stopping=lambda: next(left, None) is None)
    found = []
    for name, workers in (("whole", [execution.Worker()]), ("cut", [worker, execution.Worker()])):
        (tmp_path / name).mkdir()
        about = {"scene": "packing", "setting": setting}
        task = execution.Task(tmp_path / name, about, "", (), {})
        ended = [execution.run_member(partial(module.build, kept=tmp_path), task, each).status for each in workers]
        assert ended[-1] == "finished"
        found.append(results.result_of(skmpm.Sweep.read(tmp_path)[name]))
    assert ended == ["interrupted", "finished"]
    whole, cut = found
    for curve in ("fraction", "pressure", "lid", "alpha"):
        np.testing.assert_array_equal(cut["measured"][0][curve], whole["measured"][0][curve])
    for count in ("steps", "newton", "contact", "points"):
        assert cut["cost"][count] == whole["cost"][count]
    assert np.isfinite(whole["measured"][0]["alpha"]).sum() > 5


def test_curves_are_compared_to_their_ends(study):
    """Curves that differ by a tenth everywhere, looked at every 0.003: errors of 0.1, to a per cent of it.

    The last look is at 0.918; taking the rest for nothing made errors of alpha of 0.1 where there were none.
    """
    fraction = np.append(np.arange(0.70, 0.92, 0.003), 0.92).tolist()
    rise = [f - 0.69 for f in fraction]

    def curves(size, alpha):
        return {
            "fraction": fraction,
            "lid": [size * y for y in rise],
            "pressure": [size * y for y in rise],
            "alpha": [1.0 + alpha * y if f < 0.919 else np.nan for f, y in zip(fraction, rise, strict=True)],
        }

    errors = study("discs").packing_errors(curves(1.1, 0.9), curves(1.0, 1.0))
    assert errors == pytest.approx({"work": 0.1, "pressure": 0.1, "alpha": 0.1}, rel=1e-2)


def made(study, scene, errors, seconds):
    """Runs with these errors and costs, by (parameter, level) against `balanced`."""
    results, parameters = study("results"), study("parameters")
    runs = {}
    for one, error in errors.items():
        setting = study("scenes").setting_on(scene, parameters.BALANCED | dict(one))
        about = (
            scene,
            setting,
            frozenset({"one", "speed"}),
            "finished",
            {"seconds": seconds[one], "newton": 2.0},
            {"largest": error},
        )
        runs[results.key(setting)] = results.Run(*about)
    return runs


def test_beating(study):
    """Cheaper by more than 1.3 with no larger error beats; cheaper with a larger error, or by 1.2, does not.

    What makes no difference on a scene, as friction's solver on the cantilever, beats nothing there.
    """
    results = study("results")
    default, finer, loose = (), (("spacing", 0.5),), (("contact_tol", 1e-4),)
    errors = {default: 0.1, finer: 0.05, loose: 0.1}
    runs = {
        "cantilever": made(study, "cantilever", {default: 0.1, finer: 0.05}, {default: 1.0, finer: 0.5}),
        "hertz": made(study, "hertz", errors, {default: 1.0, finer: 0.7, loose: 0.8}),
        "collision": made(study, "collision", {default: 0.1, finer: 0.2}, {default: 1.0, finer: 0.1}),
    }
    (only,) = results.beating(results.Found(runs))
    assert only.setting["spacing"] == 0.5
    assert only.ratios == {"cantilever": 2.0, "hertz": pytest.approx(1 / 0.7)}
    assert only.iterations == {"cantilever": 1.0, "hertz": 1.0}


def test_laws_are_found_again(study):
    """A fit to errors made by the law, 40 settings: constants to 1 %; other parameters and spacings do not enter."""
    fits, parameters, results = study("fits"), study("parameters"), study("results")
    runs, rng = {}, np.random.default_rng(0)
    for n, step_control in zip(rng.uniform(3.2, 12, 40), rng.uniform(0.1, 4, 40), strict=True):
        setting = parameters.DEFAULT | {"cells": n, "pace": step_control}
        error = 0.8 / n**1.5 + 0.3 * 0.116 * step_control
        about = (frozenset({"one"}), "finished", {"seconds": 1.0, "steps": 1.0}, {"largest": error})
        runs[results.key(setting)] = results.Run("collision", setting, *about)
        for other in ({"spacing": 0.5}, {"theta": 0.5}, {"newton_tol": 1e-2}):
            run = results.Run("collision", setting | other, *about[:3], {"largest": 9.0})
            runs[results.key(run.setting)] = run
    for way in (0.01, 0.03):
        setting = parameters.DEFAULT | {"pace": way}
        steps = fits.resolution(results.Run("lid 2", setting, frozenset(), "", {"steps": 1.0}, {}))[1] / way
        about = (frozenset({"speed"}), "finished", {"seconds": 1.0, "steps": steps}, {"largest": 0.7 * way})
        runs_of_lid = {results.key(setting): results.Run("lid 2", setting, *about)}
    found = results.Found({"collision": runs, "lid 2": runs_of_lid})
    assert fits.driven_time(found) == pytest.approx(0.7)
    (fit,) = fits.fits(found)["impact"][:1]
    assert len(fit.runs) == 40
    law = fit.law
    np.testing.assert_allclose([law.scale, law.power, law.time], [0.8, 1.5, 0.3], rtol=0.01)
    assert fit.worst < 1.01


def test_codes_are_compared_by_their_cheapest_runs_within_an_error(study):
    """Of runs of 4, 2 and 1 s that err by 1, 3 and 30 %, the second is compared at 5 %; references are left out."""
    results = study("results")
    levels = {
        (("pace", p),): (error, cost) for p, error, cost in ((0.5, 0.01, 4.0), (1.0, 0.03, 2.0), (2.0, 0.3, 1.0))
    }
    runs = made(study, "squeeze 2", {k: e for k, (e, _) in levels.items()}, {k: c for k, (_, c) in levels.items()})
    runs |= {"fine": replace(next(iter(runs.values())), whys=frozenset({"reference"}), errors={"largest": 0.0})}
    mine, *others = results.codes(results.Found({"squeeze 2": runs}), "squeeze 2").values()
    assert len(mine) == 3
    assert others == [[], []]
    assert results.cheapest(mine, 0.05).seconds == 2.0
    assert results.cheapest(mine, 0.005) is None


def elements(study, centres, radii, box, friction, **options):
    """Discs of finite elements of a material that is not too stiff in volume, and the speed of its waves [m/s]."""
    material = skmpm.NeoHookean(E=1e6, nu=0.3, density=1000.0)
    found = study("penalty").Discs(np.array(centres).T, np.array(radii), material, box, friction, **options)
    return found, material, skmpm.material.wave_speed(material)


def test_finite_elements_obey_hertz(study):
    """A disc that plates press by 0.05 R each slowly: force to 4 % (3.3; with 24 instead of 16 elements 2.1)."""
    height = float(np.ptp(study("penalty").disc_mesh(16).nodes[:, 1]))
    one, _, c = elements(study, [(2.0, 0.5 * height)], [1.0], (4.0, height), 0.0, mesh=16, penalty=4.0)
    one.advance(round(40.0 / c / one.dt), 0.1 * c / 40.0)
    force = one.advance(round(10.0 / c / one.dt), drag=c)
    assert one.top == pytest.approx(height - 0.1, rel=1e-3)
    assert force == pytest.approx(study("hertz").reference(0.05)[0] * 1e6 / 0.91, rel=0.04)


def test_finite_elements_conserve_momentum_and_energy(study):
    """Two discs collide off centre without friction: momentum to round-off, energy by the law of skmpm to 0.3 %."""
    two, material, c = elements(
        study, [(3.0, 3.0), (5.0, 3.9)], [1.0, 0.9], (10.0, 10.0), 0.0, mesh=12, penalty=2.0, damping=0.0, courant=0.4
    )
    two.v[0, :, 0, :2] = 0.05 * c, -0.05 * c
    mesh, r = two.mesh, two.radii[:, None]
    b = np.concatenate([mesh.b, -mesh.b], axis=1).reshape(-1, 4, 2) / mesh.area[:, None, None]
    mass = (material.density * mesh.mass * r**2)[..., None]

    def balance():
        F = np.einsum("dzai,zaj->ijdz", two.by_disc(two.x)[:, mesh.elements], b) / r
        W = material.energy(np.ascontiguousarray(F.reshape(2, 2, -1))).reshape(F.shape[2:])
        kinetic = 0.5 * (mass * two.by_disc(two.v) ** 2).sum()
        return (mass * two.by_disc(two.v)).sum(axis=(0, 1)), kinetic, (W * mesh.area * r**2).sum()

    before, kinetic, _ = balance()
    two.advance(round(30.0 / c / two.dt))
    after, *energies = balance()
    one = (mass * two.by_disc(two.v))[0].sum(axis=0)
    np.testing.assert_allclose(after, before, rtol=0.0, atol=1e-12 * abs(one[1]))
    assert one[1] < -0.2 * before[0]  # they have met
    assert sum(energies) == pytest.approx(kinetic, rel=3e-3)


def test_finite_elements_obey_coulomb(study):
    """A disc that slides between pressed plates loses momentum by mu times the impulse of both, to round-off."""
    height = float(np.ptp(study("penalty").disc_mesh(8).nodes[:, 1]))
    one, _, c = elements(study, [(5.0, 0.5 * height)], [1.0], (20.0, height), 0.5, mesh=8, penalty=1.0)
    one.advance(round(20.0 / c / one.dt), 0.05 * c / 20.0)
    one.advance(round(5.0 / c / one.dt), drag=c)
    one.v[:] = 0.0
    one.v[:, :, 0] = 0.1 * c
    steps = round(2.0 / c / one.dt)
    push = steps * one.dt * one.advance(steps)
    right, up = 1000.0 * one.mesh.mass @ one.by_disc(one.v)[0]
    assert np.pi * 100.0 * c - right == pytest.approx(0.5 * (2.0 * push + up), rel=1e-9)
