"""The study's figures: fits on curves of known constants, the rules of the claims, and both commands."""

import lzma
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import examples.studies.packing_ensemble.archive
import examples.studies.packing_ensemble.figures
import skmpm

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def code():
    """The modules of the study."""
    return examples.studies.packing_ensemble


def member(code, seed=0, friction=0.0, *, until=1.0, parameters=None, **changes):
    """A made-up run: an even lid, and smooth measures with breaks at 0.72 and 0.90."""
    t = 8e-6 * np.arange(1, 1001)
    nominal = 1.0 / np.linspace(1.0 / 0.70, 1.0 / until, t.size)
    phi = 0.99 * nominal
    bend = np.maximum(phi - 0.72, 0.0) - 0.6 * np.maximum(phi - 0.90, 0.0)
    p = 1e7 * 0.3 * np.maximum(phi - 0.82, 0.0) + 1e-3
    values = {
        "t": t, "solid_fraction": phi, "solid_fraction_nominal": nominal,
        "contact_surface": 2.0 * bend, "aspect_ratio": 1.0 + (0.5 + friction) * bend + 1e-3 * seed,
        "anisotropy": 0.2 + friction * (0.3 + 0.1 * seed) + 0.0 * phi,
        "coordination": 4.0 + 3.6 * np.sqrt(np.maximum(phi - 0.842, 0.0)) - 20.0 * np.maximum(0.842 - phi, 0.0),
        "coordination_without_rattlers": 4.0 + 3.6 * np.sqrt(np.maximum(phi - 0.842, 0.0)),
        "pressure": p, "pressure_points": p, "kinetic": 0.0 * p, "kinetic_discs": 0.0 * p, "swing": 0.0 * p,
        "interior_fraction": phi, "interior_pressure": p,
        **{f"pressure_{wall}": p for wall in ("floor", "roof", "left", "right")},
        "overlap": 0.0 * p, "retries": 0.0 * p, "seconds": 0.0 * p,
    }  # fmt: skip
    about = {"friction": friction, "seed": seed} | (parameters or {}), "finished"
    return code.curves.Member(Path("nowhere"), *about, values | {k: f(values) for k, f in changes.items()})


def ensemble(code, seeds=4, **changes):
    """Packings without and with friction; changes apply to those with."""
    members = {f"fast_mu0_seed{seed}": member(code, seed) for seed in range(seeds)}
    return code.curves.Study(
        members | {f"fast_mu0.5_seed{seed}": member(code, seed, 0.5, **changes) for seed in range(seeds)}, []
    )


def slow(code, seeds=4, kind="quasistatic", frictions=(0.0, 0.1, 0.5), parameters=None, **changes):
    """Quasi-static packings with an interior that jams at 0.842 as the targets ask, each a little later."""
    found = {}
    for seed in range(seeds):
        at = 0.842 + 2e-4 * seed

        def pressed(v, at=at):
            return code.scenes.YOUNG / (1.0 - 0.45**2) * 0.25 * np.maximum(v["solid_fraction"] - at, 0.0) + 1e-3

        def touching(v, at=at):
            return 4.0 + 3.6 * np.sqrt(np.maximum(v["solid_fraction"] - at, 0.0)) - 0.5 * (v["solid_fraction"] < at)

        made = {"pressure": pressed, "interior_pressure": pressed, "coordination_without_rattlers": touching,
                "interior_coordination_without_rattlers": touching, "interior_coordination": touching,
                "unbalanced": lambda v: 1e-5 + 0.0 * v["t"], "elastic": lambda v: 1.0 + 0.0 * v["t"]}  # fmt: skip
        for mu in frictions:
            about = {"dt": None, "speed": 0.005} | (parameters or {})
            found[f"{kind}_mu{mu:g}_seed{seed}"] = member(code, seed, mu, parameters=about, **(made | changes))
    return found


def verdicts(rows):
    return {row.claim: row.verdict for row in rows}


def test_mean_and_standard_error(code):
    """Of 1, 2, 6: mean 3, deviation sqrt 7, over sqrt 3; nan where there is too little to say."""
    samples = np.array([[1.0, 5.0, np.nan], [2.0, np.nan, np.nan], [6.0, np.nan, np.nan]])
    value, error = code.curves.mean(samples)
    assert value == pytest.approx([3.0, 5.0, np.nan], nan_ok=True)
    assert error == pytest.approx([np.sqrt(7.0 / 3.0), np.nan, np.nan], nan_ok=True)


def test_a_mean_over_a_transit_time_is_centred_and_weighs_rows_by_their_length(code):
    """Of a straight line it is the line; halved steps count half; at the ends there is none."""
    length = np.tile([1.0, 0.5, 0.5], 20)
    t = np.cumsum(length)
    middle = t - 0.5 * length  # a step's value stands for its middle
    found = code.curves.steady(t, 3.0 * middle, np.full(t.size, 4.0))
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
    head, *lines = code.figures.curves(ensemble(code, seeds=1))
    table = [dict(zip(head, line, strict=True)) for line in lines]
    assert [line["member"] for line in table[:: len(table) - 1]] == ["fast_mu0_seed0", "fast_mu0.5_seed0"]
    assert len(table) == 2 * 119, "of 0.693 to 0.990"
    last = {line["solid_fraction"]: line for line in table if line["member"] == "fast_mu0.5_seed0"}
    assert float(last["0.8000"]["aspect_ratio"]) == pytest.approx(1.0 + 1.0 * 0.08, abs=1e-4)
    assert float(last["0.9500"]["pressure"]) == pytest.approx(3e6 * 0.13, rel=2e-3)
    assert float(last["0.9500"]["interior_fraction"]) == pytest.approx(0.95, rel=1e-3)
    assert last["0.6950"]["pressure"] == "nan", "a transit time from the start"


def test_the_height_follows_from_the_nominal_fraction(code):
    """300 discs of the main job, in their box."""
    scene, until = code.scenes.build(code.scenes.options_of({"discs": 40}))
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
    assert code.fits.last_passage(phi, np.array([0.0, 2e-3, 0.0, 4e-3]), 1e-3) == pytest.approx(0.825)
    assert np.isnan(code.fits.last_passage(phi, np.zeros(4), 1e-3))
    assert np.isnan(code.fits.last_passage(phi, np.ones(4), 1e-3)), "it resists from the start"


def test_the_line_through_small_pressures_ends_where_packings_jam(code):
    """Exact for a line, whatever comes below and above the window, and whatever pressure there was before."""
    phi = np.linspace(0.80, 0.90, 201)
    p = 0.25 * np.maximum(phi - 0.8437, 0.0)
    p = np.where(p > 4e-3, p + 5.0 * (p - 4e-3), np.where(p < 3e-4, 0.0, p))
    assert code.fits.line_to_zero(phi, p) == pytest.approx(0.8437, abs=1e-6)
    early = np.where((phi > 0.81) & (phi < 0.82), 1e-3, p)
    assert code.fits.line_to_zero(phi, early) == pytest.approx(0.8437, abs=1e-6)
    assert np.isnan(code.fits.line_to_zero(phi, 0.0 * p))
    assert np.isnan(code.fits.line_to_zero(phi, np.where(p > 3e-4, 1.0, 0.0))), "no sample in the window"


def test_the_factor_of_the_law_alone(code):
    phi = np.linspace(0.70, 0.96, 105)
    Z = 4.0 + 3.6 * np.sqrt(np.maximum(phi - 0.84, 0.0))
    p = np.where(phi > 0.84, code.fits.Compaction(0.07, 1.0, 0.84)(phi, Z), 0.0)
    assert code.fits.compaction_factor(phi, Z, p, 0.84) == pytest.approx(0.07, rel=1e-9)
    assert np.isnan(code.fits.compaction_factor(phi, Z, 0.0 * p, 0.84))
    assert np.isnan(code.fits.compaction_factor(phi, Z, p, np.nan))


def test_claims_hold_where_they_do(code):
    """Surfaces differ by a hundredth, up and down."""
    sign = iter([1.0, -1.0, 1.0, -0.5])
    surface = {"contact_surface": lambda v: v["contact_surface"] + 0.01 * next(sign)}
    found = verdicts(code.claims.rows(ensemble(code, **surface), "fast"))
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
            ),
            "fast",
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
        assert verdicts(code.claims.jamming(code.curves.Study(runs, [])))[claim] == verdict
    at_rest = {"quasistatic_mu0_seed0": resists(0.845), "quasistatic_mu0.5_seed0": resists(0.81)}
    found = verdicts(code.claims.jamming(code.curves.Study(at_rest, [])))
    assert found["with the gap corrected it comes at jamming, without friction"] == "holds"
    assert found["with friction it comes earlier"] == "holds"


def test_nothing_run_says_so(code):
    nothing = code.curves.Study({}, [])
    rows = [*code.claims.rows(nothing, "fast"), *code.claims.jamming(nothing), *code.checks.rows(nothing),
            *code.targets.rows(nothing, "periodic")]  # fmt: skip
    assert {row.verdict for row in rows} == {"not run"}
    one = code.curves.Study({"fast_mu0_seed0": member(code), "fast_mu0.5_seed0": member(code, 0, 0.5)}, [])
    found = verdicts(code.claims.rows(one, "fast"))
    assert found["alpha is larger with friction"] == "not run", "one packing has no error"
    short = verdicts(code.claims.rows(ensemble(code, until=0.92), "fast"))
    assert short["alpha is larger with friction"] == "not run", "0.95 was not reached"


def test_checks_see_what_is_apart(code):
    """4 % between walls and contacts fail, 2 % do not."""
    for excess, verdict in ((1.02, "holds"), (1.04, "does not hold")):
        walls = {f"pressure_{w}": lambda v, e=excess: e * v["pressure"] for w in ("floor", "roof", "left", "right")}
        found = verdicts(code.checks.rows(ensemble(code, **walls)))
        assert found["2 m/s: P from contacts and walls agree"] == verdict
        assert found["2 m/s: P from contacts and points agree"] == "holds"


def scaled(factor):
    """A member's pressures, so many times as large."""
    return {name: lambda v, name=name: factor * v[name] for name in ("pressure", "interior_pressure")}


def test_grids_and_materials_that_are_apart(code):
    """6 % between two grids fail, 4 % do not; the same of P/E* of two Poisson's ratios, of one packing."""
    usual = slow(code)
    low, high = 1.04, 1.06
    for excess, verdict in ((low, "holds"), (high, "does not hold")):
        others = {}
        for name, m in usual.items():
            table = dict(m.table) | {"pressure": excess * m.table["pressure"]}
            others[name.replace("quasistatic", "fine")] = replace(m, table=table)
        m = usual["quasistatic_mu0_seed1"]
        plane = (1.0 - 0.45**2) / (1.0 - 0.3**2)
        others["nu0.3_mu0_seed1"] = replace(
            m,
            parameters=m.parameters | {"nu": 0.3},
            table=m.table | {"pressure": excess * plane * m.table["pressure"]},
        )
        found = verdicts(code.checks.rows(code.curves.Study(usual | others, [])))
        assert found["P(Phi) at R/h = 5 and 8, friction 0.1"] == verdict
        assert found["P/E* by current Phi, Poisson's ratio 0.3 over 0.45, friction 0"] == verdict
        assert found["P/E* by current Phi, Poisson's ratio 0.495 over 0.45, friction 0"] == "not run"


def test_rates_are_judged_by_what_packings_differ_by(code):
    """Packings scatter by 2 %: lids that differ by 1 % do not matter, by 3 % they do."""
    factors = np.array([0.97, 0.99, 1.01, 1.03])
    usual = {name: replace(m, table=m.table | {"pressure": factors[m.options.seed] * m.table["pressure"]})
             for name, m in slow(code).items()}  # fmt: skip
    claim = "P(Phi), lids of 0.02 and 0.002 m/s, friction 0"
    for apart, verdict in ((1.01, "holds"), (1.05, "does not hold")):
        first = usual["quasistatic_mu0_seed0"]
        lids = {"lid0.02_mu0_seed0": first, "lid0.002_mu0_seed0": replace(
            first, table=first.table | {"pressure": apart * first.table["pressure"]})}  # fmt: skip
        rows = code.checks.rows(code.curves.Study(usual | lids, []))
        assert verdicts(rows)[claim] == verdict
        assert verdicts(rows)["P(Phi), lids of 0.02 and 0.002 m/s, friction 0.5"] == "not run"


def test_targets_hold_where_they_do_and_only_there(code):
    """Packings made to jam at 0.842 and follow 3.6 times the root; then ones that jam at 0.80 by a cube root."""
    found = {row.claim: row for row in code.targets.rows(code.curves.Study(slow(code), []), "quasistatic")}
    assert found["Phi_J, P extrapolated to zero, friction 0"].measured.startswith("0.8423 ± 0.0001")
    assert found["Phi_J, P extrapolated to zero, friction 0"].verdict == "holds"
    assert found["Phi_J, P extrapolated to zero, friction 0.5"].verdict == "does not hold"
    assert found["Phi_J where Z without rattlers passes 4, friction 0"].verdict == "holds"
    root = next(row for claim, row in found.items() if claim.startswith("(Z - 4) / sqrt"))
    assert (root.verdict, root.measured[:4]) == ("holds", "3.60")
    assert found["exponent of Z - 4 over the same range"].measured.startswith("0.50")
    assert found["exponent of Z - 4 over the same range"].verdict == "holds"
    expected = 0.25 * (0.926 - 0.8423) / (1.0 - 0.45**2)
    assert found["P/E at Phi = 0.926, friction 0"].measured.startswith(f"{expected:.3f}")
    assert found["P/E at Phi = 0.926, friction 0"].verdict == "does not hold"
    other = slow(code, interior_coordination_without_rattlers=lambda v: 4.0 + np.cbrt(v["solid_fraction"] - 0.85))
    found = {row.claim: row for row in code.targets.rows(code.curves.Study(other, []), "quasistatic")}
    assert found["Phi_J where Z without rattlers passes 4, friction 0"].verdict == "does not hold"
    assert found["exponent of Z - 4 over the same range"].verdict == "does not hold"


def test_the_tables_of_the_page_show_rows_of_the_files(code):
    """Each line is a row, in bold where its rule is not met, and no rule of the page is without its row."""
    study, short = code.curves.Study(slow(code) | slow(code, kind="periodic"), []), code.summary
    targets = [code.targets.rows(study, kind) for kind in code.targets.KINDS]
    lines = {line[0]: line[1:] for line in short.beside(short.TARGETS, *targets, ("a", "b"))}
    assert lines["quantity"] == ("required", "a", "b")
    assert lines["Phi_J by pressure, friction 0"] == ("0.83-0.86", "0.842", "0.842")
    assert lines["Phi_J by pressure, friction 0.5"] == ("0.79-0.82", "**0.842**", "**0.842**")
    nothing = code.curves.Study({}, [])
    claims, checks = code.claims.rows(nothing, "fast"), code.checks.rows(nothing)
    assert all(short.starting(targets[0], begin) for begin in short.TARGETS)
    assert all(short.starting(claims, begin) for begin in short.CLAIMS)
    assert all(short.starting(checks, begin) for begin in short.CURVES)
    kinds = [[kind for kind in short.KINDS if short.starting(checks, f"{kind}: {begin}")] for begin in short.STATES]
    assert all(kinds)
    assert {cell for line in short.curves(checks)[1:] for cell in line[2:]} == {"-"}, "nothing was run"
    states = {line[0]: line[2:] for line in short.states(code.checks.rows(study))}
    assert states["inertial number"][0].startswith("**"), "the made-up lid is fast"
    grid = short.shared_grid(code.curves.Study({"shared_grid_mu0_r6": member(code)}, []))
    assert grid[1][:4] == ("shared grid, R/h = 6", "0", grid[1][2], "0.717") and float(grid[1][2]) > 0.8


def test_what_is_not_quasi_static_is_seen(code):
    """The made-up lid shrinks the box in 8 ms: its inertial number is 100 times too large; forces are balanced."""
    found = verdicts(code.still.still(code.curves.Study(slow(code), [])))
    assert found["uniaxial: inertial number at P = 0.001 E*"] == "does not hold"
    assert found["uniaxial: unbalanced force ratio, median above that pressure"] == "holds"
    assert found["uniaxial: kinetic over elastic energy, median above that pressure"] == "holds"
    assert found["uniaxial: step of Phi, median from 0.01 below jamming to 0.02 above"] == "holds"
    loud = slow(code, unbalanced=lambda v: 2e-3 + 0.0 * v["t"])
    found = verdicts(code.still.still(code.curves.Study(loud, [])))
    assert found["uniaxial: unbalanced force ratio, median above that pressure"] == "does not hold"


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


SMALL = ["--discs", "15", "--seeds", "2", "--start", "0.72", "--until", "0.755", "--only", "fast_mu0_", "fast_mu0.5_"]


@pytest.fixture(scope="module")
def ran(code, tmp_path_factory):
    """The ensemble in small: 15 discs, two seeds, two frictions; copies stand for the members that take longer."""
    folder = tmp_path_factory.mktemp("study")
    docs = folder / "docs"
    docs.mkdir()
    shutil.copy(ROOT / "docs" / "studies" / "packing_ensemble.md", docs)
    options = [*SMALL, "--processes", "2", "--out", str(folder / "out"), "--docs", str(docs)]
    code.study.main(code.study.parser().parse_args(options))
    return folder / "out"


def drawn(code, study, docs):
    docs.mkdir()
    shutil.copy(ROOT / "docs" / "studies" / "packing_ensemble.md", docs)
    (docs / "packing_ensemble").mkdir()
    rows = code.figures.main(code.figures.parser().parse_args(["--study", str(study), "--docs", str(docs)]))
    return rows, (docs / "packing_ensemble.md").read_text()


@pytest.fixture(scope="module")
def made(code, ran, tmp_path_factory):
    """The page of the small ensemble, once: its rows, its text and its directory, which tests copy."""
    docs = tmp_path_factory.mktemp("made") / "docs"
    return *drawn(code, ran, docs), docs


@pytest.mark.slow
def test_both_commands(code, ran, made, tmp_path):
    """Study, then figures: the pictures that can be drawn, small ones, and a page with measured figures."""
    rows, page, docs = made
    shutil.copytree(docs, tmp_path / "docs")
    pictures = {path.name: path.stat().st_size for path in (tmp_path / "docs" / "packing_ensemble").glob("*.png")}
    assert set(pictures) == {"figure2.png", "figure4.png", "pressure.png"}
    written = {path.name for path in (tmp_path / "docs" / "packing_ensemble").iterdir()}
    tables = ("checks", "claims", "curves", "grid", "members", "targets")
    assert written == {*pictures, *(f"{name}.csv" for name in tables)}
    assert set(re.findall(r"\{download\}`[^<]* <packing_ensemble/([^>]*)>`", page)) <= written
    assert all(2_000 < size < 120_000 for size in pictures.values())
    assert set(re.findall(r"!\[.*\]\(packing_ensemble/(.*)\)", page)) == set(pictures)
    found = {row.claim: row for row in rows}
    assert found["A_m is larger with friction"].verdict in ("not run", "does not hold"), "0.80 was not reached"
    identity = found["2 m/s: P = (Phi Z/4) sigma_l, sigma_l = mean(f.l) / mean(V_p) by own code"]
    assert identity.verdict == "holds", identity.measured
    for name in ("fast_mu0_seed0", "fast_mu0.5_seed0"):
        member = code.curves.read(ran).get(name)
        walls, carried = member.column("walls")[1:], member.column("pressure - swing")[1:]
        assert np.abs(carried - walls).mean() < 2e-3 * np.abs(walls).mean(), "virial theorem, step by step"
        assert np.abs(member.column("pressure")[1:] - walls).mean() > 0.1 * np.abs(walls).mean(), "which is needed"
    members = (tmp_path / "docs" / "packing_ensemble" / "members.csv").read_text()
    assert members.count("at its end") == 4
    assert "\nfine_mu0_seed0,-,-," in members
    again = code.figures.main(
        code.figures.parser().parse_args(["--study", str(ran), "--docs", str(tmp_path / "docs")])
    )
    assert (again, (tmp_path / "docs" / "packing_ensemble.md").read_text()) == (rows, page), (
        "a second time changes nothing"
    )


@pytest.mark.slow
def test_all_pictures_and_those_of_an_earlier_study_go(code, ran, tmp_path):
    kinds = ("fast", "quasistatic", "periodic", "fine", "lid0.02", "lid0.002", "nu0.3")
    for copy, name in (
        *(
            (f"{kind}_mu{mu}_seed{k}", f"fast_mu{mu}_seed{k}")
            for kind in kinds
            for mu in ("0", "0.5")
            for k in (0, 1)
        ),
        *((f"shared_grid_mu0_r{cells}", "fast_mu0_seed1") for cells in (6, 8, 10)),
        ("regridded_mu0.5_seed0", "fast_mu0.5_seed1"),
    ):
        shutil.copytree(ran / name, tmp_path / "study" / copy)
    drawn(code, tmp_path / "study", tmp_path / "docs")
    pictures = {path.name for path in (tmp_path / "docs" / "packing_ensemble").glob("*.png")}
    assert pictures == set(code.pictures.PICTURES)
    manifest = tmp_path / "study" / "regridded_mu0.5_seed0" / "manifest.json"
    manifest.write_text(manifest.read_text().replace('"status": "finished"', '"status": "running"'))
    for kind in kinds[1:]:
        for folder in (tmp_path / "study").glob(f"{kind}_*"):
            shutil.rmtree(folder)  # its pictures need not be drawn again
    options = ["--study", str(tmp_path / "study"), "--docs", str(tmp_path / "docs")]
    code.figures.main(code.figures.parser().parse_args(options))
    assert not (tmp_path / "docs" / "packing_ensemble" / "forgetting.png").exists()
    assert "not finished, not used" in (tmp_path / "docs" / "packing_ensemble" / "members.csv").read_text()


@pytest.mark.slow
def test_another_machine_goes_on_from_what_stands_beside_the_page(code, ran, made, tmp_path):
    """Archived and restored: the same page, with the pictures of states as they were; members are not run again."""
    rows, page, docs = made
    docs, study = shutil.copytree(docs, tmp_path / "docs"), tmp_path / "study"
    kept = (docs / "packing_ensemble" / "figure4.png").read_bytes()
    members = (docs / "packing_ensemble" / "members.csv").read_text()
    options = ["--study", str(ran), "--docs", str(docs)]
    code.archive.main(code.archive.parser().parse_args(options))
    for path in (docs / "packing_ensemble" / "members").iterdir():
        text = lzma.decompress(path.read_bytes()).decode()
        assert str(ran) not in text and '"host"' not in text
    options = ["--study", str(study), "--docs", str(docs)]
    assert code.archive.restore(docs, study, "0.0.1") == [] and not study.exists()
    code.archive.main(code.archive.parser().parse_args([*options, "--restore", "--version", skmpm.__version__]))
    assert not list(study.rglob("*.checkpoint"))
    again = code.figures.main(code.figures.parser().parse_args(options))
    assert verdicts(again) == verdicts(rows)
    assert (docs / "packing_ensemble" / "members.csv").read_text() == members and members.count("\nfast_") >= 4
    runs = re.findall(r"(?m)^Made by.*", (docs / "packing_ensemble.md").read_text())
    assert runs == re.findall(r"(?m)^Made by.*", page) and len(runs) == 1
    assert (docs / "packing_ensemble" / "figure4.png").read_bytes() == kept
    code.study.main(code.study.parser().parse_args([*SMALL, "--out", str(study), "--docs", str(docs)]))
    assert not list(study.rglob("*.checkpoint"))
