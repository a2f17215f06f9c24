"""The study's figures: fits on curves of known constants, the rules of the claims, and both commands."""

import csv
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import examples.studies.packing_ensemble.figures
import skmpm

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def code():
    """The modules of the study."""
    return examples.studies.packing_ensemble


def member(code, seed=0, friction=0.0, *, until=1.0, **changes):
    """A made-up run: an even lid, and smooth measures with breaks at 0.72 and 0.90."""
    t = 8e-6 * np.arange(1, 1001)
    nominal = 1.0 / np.linspace(1.0 / 0.70, 1.0 / until, t.size)
    phi = 0.99 * nominal
    bend = np.maximum(phi - 0.72, 0.0) - 0.6 * np.maximum(phi - 0.90, 0.0)
    p = 1e7 * 0.3 * np.maximum(phi - 0.82, 0.0) + 1e-3
    values = {
        "t": t, "dt": np.full(t.size, 8e-6), "solid_fraction": phi, "solid_fraction_nominal": nominal,
        "contact_surface": 2.0 * bend, "aspect_ratio": 1.0 + (0.5 + friction) * bend + 1e-3 * seed,
        "anisotropy": 0.2 + friction * (0.3 + 0.1 * seed) + 0.0 * phi,
        "coordination": 4.0 + 3.6 * np.sqrt(np.maximum(phi - 0.842, 0.0)) - 20.0 * np.maximum(0.842 - phi, 0.0),
        "pressure": p, "pressure_points": p, "kinetic": 0.0 * p, "kinetic_discs": 0.0 * p, "swing": 0.0 * p,
        "interior_fraction": phi, "interior_pressure": p,
        **{f"pressure_{wall}": p for wall in ("floor", "roof", "left", "right")},
        "overlap": 0.0 * p, "retries": 0.0 * p, "seconds": 0.0 * p,
    }  # fmt: skip
    about = {"friction": friction, "seed": seed}, "finished"
    return code.curves.Member(Path("nowhere"), *about, values | {k: f(values) for k, f in changes.items()})


def ensemble(code, seeds=4, **changes):
    """Packings without and with friction; changes apply to those with."""
    members = {f"mu0_seed{seed}": member(code, seed) for seed in range(seeds)}
    return code.curves.Study(
        members | {f"mu0.5_seed{seed}": member(code, seed, 0.5, **changes) for seed in range(seeds)}, []
    )


def verdicts(rows):
    return {row.claim: row.verdict for row in rows}


def test_mean_and_standard_error(code):
    """Of 1, 2, 6: mean 3, deviation sqrt 7, over sqrt 3; nan where there is too little to say."""
    samples = np.array([[1.0, 5.0, np.nan], [2.0, np.nan, np.nan], [6.0, np.nan, np.nan]])
    value, error = code.curves.mean(samples)
    assert value == pytest.approx([3.0, 5.0, np.nan], nan_ok=True)
    assert error == pytest.approx([np.sqrt(7.0 / 3.0), np.nan, np.nan], nan_ok=True)


def test_a_mean_over_a_transit_time_is_centred_and_weighs_steps_by_their_length(code):
    """Of a straight line it is the line; halved steps count half; at the ends there is none."""
    length = np.tile([1.0, 0.5, 0.5], 20)
    t = np.cumsum(length)
    middle = t - 0.5 * length  # a step's value stands for its middle
    found = code.curves.steady(t, length, 3.0 * middle, np.full(t.size, 4.0))
    inside = np.isfinite(found)
    assert found[inside] == pytest.approx(3.0 * t[inside], abs=1e-12)
    assert t[inside].min() == 2.0
    assert t[inside].max() == t[-1] - 2.0


def test_first_passage_ignores_going_back(code):
    x, y = np.array([0.0, 1.0, 0.5, 2.0]), np.array([0.0, 10.0, 99.0, 20.0])
    found = code.curves.first_passage(x, y, np.array([-1.0, 0.5, 1.5, 3.0]))
    assert found == pytest.approx([np.nan, 5.0, 15.0, np.nan], nan_ok=True)


def test_the_curves_are_a_table(code):
    """Closed forms of the made-up runs, by member and solid fraction; nothing where nothing was reached."""
    lines = code.figures.curves(ensemble(code, seeds=1)).splitlines()
    table = list(csv.DictReader(lines))
    assert [line["member"] for line in table[:: len(table) - 1]] == ["mu0_seed0", "mu0.5_seed0"]
    assert len(table) == 2 * 119, "of 0.693 to 0.990"
    last = {line["solid_fraction"]: line for line in table if line["member"] == "mu0.5_seed0"}
    assert float(last["0.8000"]["aspect_ratio"]) == pytest.approx(1.0 + 1.0 * 0.08, abs=1e-4)
    assert float(last["0.9500"]["pressure"]) == pytest.approx(3e6 * 0.13, rel=2e-3)
    assert float(last["0.9500"]["interior_fraction"]) == pytest.approx(0.95, rel=1e-3)
    assert last["0.6950"]["pressure"] == "nan", "a transit time from the start"


def test_the_height_follows_from_the_nominal_fraction(code):
    """300 discs of the main job, in their box."""
    options = code.curves.compaction.parser().parse_args(["--discs", "40"])
    scene, until = code.curves.compaction.build(options)
    width, height = scene.walls[3].point[0], scene.walls[1].point[1]
    t = np.linspace(0.0, until, 7)
    nominal = scene.initial_volumes.sum() / (width * (height - 2.0 * t))
    run = code.curves.Member(Path(), {"discs": 40}, "finished", {"t": t, "solid_fraction_nominal": nominal})
    assert run.height == pytest.approx(height - 2.0 * t, rel=1e-3)
    assert run.box == pytest.approx(width * (height - 2.0 * t), rel=1e-3)


def test_breaks_are_found_where_they_are(code):
    """Between the samples, and within their scatter with noise."""
    x = np.linspace(0.70, 0.97, 109)
    exact = code.fits.Broken(np.array([0.7613, 0.9028]), np.array([0.1, 1.2, 0.4]), -0.3)
    fit = code.fits.broken(x, exact(x))
    assert fit.breaks == pytest.approx(exact.breaks, abs=1e-5)
    assert fit.slopes == pytest.approx(exact.slopes, abs=1e-4)
    noise = 2e-3 * np.random.default_rng(0).standard_normal(x.size)
    assert code.fits.broken(x, exact(x) + noise).breaks == pytest.approx(exact.breaks, abs=5e-3)
    holes = np.where(np.arange(x.size) > 100, np.nan, exact(x))
    assert code.fits.broken(x, holes).breaks == pytest.approx(exact.breaks, abs=1e-5)
    assert code.fits.broken(x[:8], exact(x[:8])) is None


def test_breaks_are_the_best_of_all_pairs(code):
    """On a wavy curve with many good places: a search by brute force, each pair by itself, finds the same pair."""
    x = np.linspace(0.0, 1.0, 40)
    y = np.sin(11.0 * x) + 0.3 * np.random.default_rng(1).standard_normal(x.size)
    apart = code.fits.APART
    places = x[apart:-apart]
    pairs = [(a, b) for i, a in enumerate(places) for b in places[i + apart :]]
    misfits = []
    for a, b in pairs:
        columns = np.stack([np.ones_like(x), x, np.maximum(x - a, 0.0), np.maximum(x - b, 0.0)], axis=1)
        misfits.append(((columns @ np.linalg.lstsq(columns, y, rcond=None)[0] - y) ** 2).sum())
    assert code.fits._best_pair(x, y) == pytest.approx(pairs[np.argmin(misfits)], abs=1e-12)
    assert ((code.fits.broken(x, y)(x) - y) ** 2).sum() <= min(misfits) + 1e-12


def test_the_compaction_law_gives_back_its_constants(code):
    phi = np.linspace(0.70, 0.96, 105)
    Z = 4.0 + 3.6 * np.sqrt(np.maximum(phi - 0.84, 0.0))
    exact = code.fits.Compaction(0.13, 0.987, 0.836)
    p = np.where(phi > 0.836, exact(phi, Z), 0.0)
    fit = code.fits.compaction_law(phi, Z, p)
    assert [fit.b, fit.phi_max, fit.phi_0] == pytest.approx([0.13, 0.987, 0.836], rel=1e-4)
    assert code.fits.compaction_law(phi, Z, 0.0 * p) is None


def test_the_power_law_gives_back_its_constants(code):
    """Two per cent: between two samples Z is straight, so Phi_J is off by up to one, 2.5e-4."""
    phi = np.linspace(0.70, 0.96, 1041)
    above = np.maximum(phi - 0.8375, 0.0)
    fit = code.fits.power_law(phi, np.where(above > 0.0, 4.0 + 3.6 * above**0.55, 2.0), 4.0)
    assert fit.phi_J == pytest.approx(0.8375, abs=3e-4)
    assert [fit.a, fit.beta] == pytest.approx([3.6, 0.55], rel=0.02)
    assert code.fits.power_law(phi, np.full(phi.size, 3.0), 4.0) is None


def test_the_first_change_is_the_last_crossing(code):
    phi = np.array([0.6, 0.7, 0.8, 0.9])
    assert code.fits.first_change(phi, np.array([0.0, 2e-3, 0.0, 4e-3])) == pytest.approx(0.825)
    assert np.isnan(code.fits.first_change(phi, np.zeros(4)))
    assert np.isnan(code.fits.first_change(phi, np.ones(4))), "it resists from the start"


def test_claims_hold_where_they_do(code):
    """Surfaces differ by a hundredth, up and down."""
    sign = iter([1.0, -1.0, 1.0, -0.5])
    surface = {"contact_surface": lambda v: v["contact_surface"] + 0.01 * next(sign)}
    found = verdicts(code.claims.rows(ensemble(code, **surface)))
    assert found["S(Phi) is the same for both frictions"] == "holds"
    assert found["alpha is larger with friction"] == "holds"
    assert found["A_m is larger with friction"] == "holds"
    assert found["alpha, friction 0: three regimes, slow, fast and slower"] == "holds"
    assert found["S, friction 0.5: they change at 0.72 and 0.9"] == "holds"
    assert found["alpha grows faster with friction between the breaks"] == "holds"
    assert found["circles become nearly polygons"] == "not run", "no states were kept"


def test_claims_do_not_hold_where_they_do_not(code):
    """More surface with friction; an anisotropy that scatters about the same; breaks elsewhere; the rest holds."""
    sign, other = iter([1.0, -1.0, 1.0, -1.0]), iter([1.0, 1.0, -1.0, -1.0])
    found = verdicts(
        code.claims.rows(
            ensemble(
                code,
                contact_surface=lambda v: (
                    v["contact_surface"] + 3.0 * np.maximum(v["solid_fraction"] - 0.78, 0.0) + 0.01 * next(other)
                ),
                anisotropy=lambda v: 0.2 + 0.2 * next(sign) + 0.0 * v["t"],
            )
        )
    )
    assert found["S(Phi) is the same for both frictions"] == "does not hold"
    assert found["A_m is larger with friction"] == "does not hold"
    assert found["S, friction 0.5: they change at 0.72 and 0.9"] == "does not hold"
    assert found["alpha is larger with friction"] == "holds"


def test_the_first_change_decides_the_artefact(code):
    """Runs that resist at the gap's fraction, to 0.01, hold; those that all resist at one fraction do not."""

    def resists(at):
        return member(code, interior_pressure=lambda v: 1e8 * np.maximum(v["solid_fraction"] - at, 0.0))

    claim = "in the mode of Nezamabadi et al. (2017) the first change moves with R/h as 0.842/(1 + h/2R)^2 says"
    for place, verdict in (
        (lambda cells: code.claims.apparent(cells) + 0.01, "holds"),
        (lambda cells: 0.742, "does not hold"),
    ):
        runs = {f"shared_grid_mu0_r{cells}": resists(place(cells)) for cells in (6, 8, 10)}
        assert verdicts(code.claims.rows(code.curves.Study(runs, [])))[claim] == verdict
    slow = {"slow_mu0": resists(0.845), "slow_mu0.5": resists(0.81)}
    found = verdicts(code.claims.rows(code.curves.Study(slow, [])))
    assert found["with the gap corrected it comes at jamming, without friction"] == "holds"
    assert found["with friction it comes earlier"] == "holds"


def test_nothing_run_says_so(code):
    nothing = code.curves.Study({}, [])
    rows = [*code.claims.rows(nothing), *code.checks.rows(nothing)]
    assert {row.verdict for row in rows} == {"not run"}
    one = code.curves.Study({"mu0_seed0": member(code), "mu0.5_seed0": member(code, 0, 0.5)}, [])
    assert verdicts(code.claims.rows(one))["alpha is larger with friction"] == "not run", "one packing has no error"
    short = verdicts(code.claims.rows(ensemble(code, until=0.92)))
    assert short["alpha is larger with friction"] == "not run", "0.95 was not reached"


def test_checks_see_what_is_apart(code):
    """4 % between walls and contacts fail, 2 % do not; 6 % between two grids fail."""
    for excess, verdict in ((1.02, "holds"), (1.04, "does not hold")):
        walls = {f"pressure_{w}": lambda v, e=excess: e * v["pressure"] for w in ("floor", "roof", "left", "right")}
        found = verdicts(code.checks.rows(ensemble(code, **walls)))
        assert found["P from contacts and walls agree"] == verdict
        assert found["P from contacts and points agree"] == "holds"
    members = ensemble(code).members
    for excess, verdict in ((1.04, "holds"), (1.06, "does not hold")):
        fine = {
            f"fine_mu{f:g}": member(code, 0, f, pressure=lambda v, e=excess: e * v["pressure"]) for f in (0.0, 0.5)
        }
        found = verdicts(code.checks.rows(code.curves.Study(members | fine, [])))
        assert found["P(Phi) at R/h = 5 and 8"] == verdict
        assert found["P(Phi) with a lid at 0.5 m/s"] == "not run"


def test_the_shape_of_ellipses_and_hexagons(code):
    """Ellipses drawn with 400 points have no excess; a hexagon's is sqrt(12) / pi - 1."""
    angle = np.linspace(0.0, 2.0 * np.pi, 401)
    for ratio in (1.0, 1.3, 2.0):
        x, y = ratio * np.cos(angle), np.sin(angle)
        perimeter = np.hypot(np.diff(x), np.diff(y)).sum()
        area = 0.5 * (x[:-1] * y[1:] - x[1:] * y[:-1]).sum()
        assert perimeter**2 / (4.0 * np.pi * area) == pytest.approx(code.stages.ellipse(ratio), rel=1e-4)


def test_symbols_are_written_as_such(code):
    assert code.figures.greek("Phi_max, alpha, alphabet") == r"$\Phi_{max}$, $\alpha$, alphabet"


def test_how_far_discs_that_push_each_other_are_apart(code):
    """Two discs whose polygons have corners that face each other, 0.3 cells apart; a third that pushes nothing."""
    gel, centres = skmpm.LinearElastic(E=1e7, nu=0.3, density=1e3), ((0.0, 0.0), (2.06, 0.0), (0.0, 2.5))
    bodies = [skmpm.Body(skmpm.disc(centre, 1.0, spacing=0.15), gel) for centre in centres]
    scene = skmpm.Scene(bodies, cell=0.2)
    state = skmpm.initial(scene)
    one = np.ones((2, 1))
    pushed = replace(state.contacts, bodies=np.array([[0], [1]]), x=one, normal=one, force=one)
    facing = [state.x[0, state.body == b] for b in (0, 1)]
    expected = (facing[1].min() - facing[0].max()) / scene.cell
    assert expected == pytest.approx(0.3, abs=0.02)
    assert code.stages.apart(scene, replace(state, contacts=pushed)) == pytest.approx(expected, rel=0.02)


@pytest.fixture(scope="module")
def ran(code, tmp_path_factory):
    """The ensemble in small: 30 discs, two seeds, two frictions; copies stand for the members that take longer."""
    out = tmp_path_factory.mktemp("study")
    options = ["--discs", "30", "--seeds", "2", "--until", "0.755", "--only", "mu", "--processes", "2"]
    code.study.main(code.study.parser().parse_args([*options, "--out", str(out)]))
    return out


def drawn(code, study, docs):
    docs.mkdir()
    shutil.copy(ROOT / "docs" / "studies" / "packing_ensemble.md", docs)
    rows = code.figures.main(code.figures.parser().parse_args(["--study", str(study), "--docs", str(docs)]))
    return rows, (docs / "packing_ensemble.md").read_text()


@pytest.mark.slow
def test_both_commands(code, ran, tmp_path):
    """Study, then figures: the pictures that can be drawn, small ones, and a page with measured figures."""
    rows, page = drawn(code, ran, tmp_path / "docs")
    pictures = {path.name: path.stat().st_size for path in (tmp_path / "docs" / "packing_ensemble").glob("*.png")}
    assert set(pictures) == {"figure2.png", "figure4.png", "pressure.png", "coordination.png"}
    assert {path.name for path in (tmp_path / "docs" / "packing_ensemble").iterdir()} == {*pictures, "curves.csv"}
    assert all(2_000 < size < 120_000 for size in pictures.values())
    assert set(re.findall(r"!\[.*\]\(packing_ensemble/(.*)\)", page)) == set(pictures)
    found = {row.claim: row for row in rows}
    assert found["A_m is larger with friction"].verdict in ("not run", "does not hold"), "0.80 was not reached"
    identity = found["P = (Phi Z/4) sigma_l, sigma_l = mean(f.l) / mean(V_p) by own code"]
    assert identity.verdict == "holds", identity.measured
    for name in ("mu0_seed0", "mu0.5_seed0"):
        member = code.curves.read(ran).get(name)
        walls, carried = member.column("walls")[1:], member.column("pressure - swing")[1:]
        assert np.abs(carried - walls).mean() < 2e-3 * np.abs(walls).mean(), "virial theorem, step by step"
        assert np.abs(member.column("pressure")[1:] - walls).mean() > 0.1 * np.abs(walls).mean(), "which is needed"
    assert page.count("at its end") == 4
    assert "| fine_mu0 | - |" in page
    again = code.figures.main(
        code.figures.parser().parse_args(["--study", str(ran), "--docs", str(tmp_path / "docs")])
    )
    assert (again, (tmp_path / "docs" / "packing_ensemble.md").read_text()) == (rows, page), (
        "a second time changes nothing"
    )


@pytest.mark.slow
def test_all_pictures_and_those_of_an_earlier_study_go(code, ran, tmp_path):
    for copy, name in (
        *((f"{kind}_mu{f}", f"mu{f}_seed0") for kind in ("fine", "slow") for f in ("0", "0.5")),
        *((f"shared_grid_mu0_r{cells}", "mu0_seed1") for cells in (6, 8, 10)),
        ("regridded_mu0.5", "mu0.5_seed1"),
        *((name, name) for name in ("mu0_seed0", "mu0_seed1", "mu0.5_seed0", "mu0.5_seed1")),
    ):
        shutil.copytree(ran / name, tmp_path / "study" / copy)
    drawn(code, tmp_path / "study", tmp_path / "docs")
    assert len(list((tmp_path / "docs" / "packing_ensemble").glob("*.png"))) == 7
    manifest = tmp_path / "study" / "regridded_mu0.5" / "manifest.json"
    manifest.write_text(manifest.read_text().replace('"status": "finished"', '"status": "running"'))
    options = ["--study", str(tmp_path / "study"), "--docs", str(tmp_path / "docs")]
    code.figures.main(code.figures.parser().parse_args(options))
    assert not (tmp_path / "docs" / "packing_ensemble" / "forgetting.png").exists()
    assert "not finished, not used" in (tmp_path / "docs" / "packing_ensemble.md").read_text()
