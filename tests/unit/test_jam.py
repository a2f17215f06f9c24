"""Packings at their jamming point and under a pressure: against lattices, counts of constraints and themselves."""

import re
from dataclasses import replace
from importlib import import_module
from itertools import permutations
from types import SimpleNamespace

import numpy as np
import pytest

import skmpm

R = 1e-3
H = R / 5
GEL = skmpm.NeoHookean(E=1e6, nu=0.3, density=1000.0)


def disc(x, r=R):
    return skmpm.Body(skmpm.disc(x, r, spacing=0.74 * H), GEL)


def bidisperse(discs, fraction, seed, friction=0.0):
    """Half of the discs are 1.4 times as large, as where jamming is studied."""
    radii = np.where(np.arange(discs) % 2 == 0, 1.0, 1.4) * R
    width = float(np.sqrt(np.pi * (radii**2).sum() / fraction))
    loose = skmpm.packing(radii, width, solid_fraction=fraction, periodic=True, seed=seed)
    bodies = [disc(x, r) for x, r in zip(loose.centres.T, radii, strict=True)]
    box = skmpm.Periodic(loose.width, loose.height)
    return skmpm.Scene(bodies, cell=H, friction=friction, periodic=box)


def lattice(kind, gap):
    """One disc that meets its images in a square box, or two in that of a hexagonal lattice, with gaps [R]."""
    a = (2.0 + gap) * R
    if kind == "square":
        return skmpm.Scene([disc((0.3 * R, 0.1 * R))], cell=H, periodic=skmpm.Periodic(a, a))
    bodies = [disc((0.0, 0.0)), disc((0.5 * a, np.sqrt(0.75) * a))]
    return skmpm.Scene(bodies, cell=H, periodic=skmpm.Periodic(a, np.sqrt(3.0) * a))


def test_the_order_of_materials_does_not_matter():
    """The pressure at jamming is a share of the largest modulus."""
    soft, points = skmpm.NeoHookean(E=1e3, nu=0.3, density=1000.0), skmpm.disc((0, 0), R, spacing=0.74 * H)
    halved = points.with_groups(lambda x: np.where(x[0] < 0.0, "one", "other"))
    both = [skmpm.Body(halved, dict(materials)) for materials in permutations([("one", GEL), ("other", soft)])]
    scenes = [skmpm.Scene([body], cell=H, periodic=skmpm.Periodic(3 * R, 3 * R)) for body in both]
    wanted = {import_module("skmpm.jam")._Search(scene, None).wanted for scene in scenes}
    assert wanted == {import_module("skmpm.jam").JAMMED * skmpm.material.bounded_modulus(GEL)}


@pytest.mark.parametrize(
    ("kind", "jams", "neighbours"), [("square", np.pi / 4, 4), ("hexagonal", np.pi / 12**0.5, 6)]
)
@pytest.mark.parametrize("gap", [0.004, -0.004], ids=["compressed", "released"])
def test_lattices_jam_where_discs_touch(kind, jams, neighbours, gap):
    """At pi / 4 and pi / sqrt(12) to the tolerance of 1e-4, from below and from above."""
    scene, state = lattice(kind, abs(gap)), None
    if gap < 0.0:
        state = skmpm.jam(scene, pressure=2e3).state
    found = skmpm.jam(scene, state, tolerance=1e-4)
    assert found.solid_fraction_nominal == pytest.approx(jams, abs=1e-4)
    assert skmpm.jam(found.scene, found.state, pressure=1e3).coordination == neighbours
    assert found.bracket[1] - found.bracket[0] < 1e-4
    assert found.bracket[1] == found.solid_fraction_nominal


@pytest.mark.parametrize("seed", [0, 1])
def test_frictionless_discs_are_isostatic_at_jamming(seed):
    """Contacts are 2 N - 1 among N discs that are no rattlers (Goodrich, Liu & Nagel, PRL 109 (2012) 095704).

    Nothing in the search knows this count. A thousandth of solid fraction denser there are more.
    """
    scene = bidisperse(14, 0.79, seed)
    found = skmpm.jam(scene)
    backbone = 14 - int(found.rattlers.sum())
    assert found.coordination * backbone / 2.0 == pytest.approx(2 * backbone - 1, abs=1e-9)
    assert 0.78 < found.solid_fraction_nominal < 0.86
    assert found.state.report.unbalanced < 1e-3
    pressures = np.sort(found.path["pressure"])
    below, above = (pressures[pressures < found.pressure], pressures[pressures >= found.pressure])
    assert below.max() < 1e-3 * above.min()  # a packing is jammed, or bears nothing
    assert np.abs(skmpm.network(found.scene, found.state).force[0]).max() > 0.0


def test_a_pressure_is_met_and_its_solid_fraction_is_that_of_a_lattice():
    """To 1e-3; a square lattice then has the strain that `moduli` say, to 5 %: p = K ln(phi / phi_J)."""
    scene = lattice("square", 0.004)
    jammed, found = skmpm.jam(scene), skmpm.jam(scene, pressure=5e3)
    assert found.pressure == pytest.approx(5e3, rel=1e-3)
    assert skmpm.observe(found.scene, found.state).pressure == pytest.approx(5e3, rel=1e-3)
    bulk = [skmpm.moduli(each.scene, each.state).bulk for each in (jammed, found)]
    strain = np.log(found.solid_fraction_nominal / jammed.solid_fraction_nominal)
    assert min(bulk) * strain < 5e3 * 1.05
    assert max(bulk) * strain > 5e3 * 0.95


def test_friction_jams_looser_with_fewer_contacts():
    """Z between 3 and 4, and a lower solid fraction than without friction."""
    smooth, rough = (skmpm.jam(bidisperse(8, 0.76, 0, friction=mu), tolerance=1e-4) for mu in (0.0, 0.5))
    assert rough.solid_fraction_nominal < smooth.solid_fraction_nominal
    assert 2.5 < rough.coordination < smooth.coordination


def test_the_search_halves_from_the_looser_packing():
    """Increments of 1e-3, then intervals halved: the path of solid fractions is that of the protocol."""
    found = skmpm.jam(lattice("square", 0.004), increment=1e-3, tolerance=1e-4)
    phi, p = found.path["solid_fraction_nominal"], found.path["pressure"]
    bears = p > 1e-8 * 1e6
    first = int(np.argmax(bears))
    assert np.diff(phi[: first + 1]) == pytest.approx(1e-3, abs=1e-12)
    low, high = phi[first - 1], phi[first]
    for k in range(first + 1, phi.size):
        assert phi[k] == pytest.approx(0.5 * (low + high), abs=1e-12)
        low, high = (low, phi[k]) if bears[k] else (phi[k], high)
    assert (low, high) == pytest.approx(found.bracket, abs=1e-12)


def test_each_packing_at_rest_is_logged(caplog):
    with caplog.at_level("INFO", logger="skmpm"):
        found = skmpm.jam(lattice("square", 0.01), tolerance=1e-4)
    lines = [line for line in caplog.messages if line.startswith("jam: at rest")]
    assert len(lines) == found.path["pressure"].size
    assert f"solid fraction of {found.path['solid_fraction_nominal'][-1]:.6g}, pressure" in lines[-1]


def test_it_shows_what_was_found():
    found = skmpm.jam(lattice("square", 0.004), tolerance=1e-3)
    assert re.fullmatch(
        r"Jam\(solid fraction 0\.78\d+, pressure .*Pa, coordination 4, rattlers 0, unbalanced .*\)", repr(found)
    )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"pressure": -1.0}, "pressure = -1.0"),
        ({"pressure": "high"}, "jam: pressure"),
        ({"increment": 0.2}, "between 1e-6 and 0.05"),
        ({"increment": None}, "between 1e-6 and 0.05"),
        ({"tolerance": 0.0}, "jam: tolerance"),
        ({"tolerance": 0.01}, "between 1e-9 and the increment"),
        ({"pressure": 1e9, "increment": 0.05}, "where the search ends; give a pressure below that"),
    ],
)
def test_what_is_wrong_is_refused(options, words):
    with pytest.raises((skmpm.SceneError, skmpm.StepFailed), match=words):
        skmpm.jam(lattice("square", 0.004), **options)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"gravity": (0.0, -9.81)}, "jam: the scene has gravity"),
        ({"loads": [skmpm.Load(lambda x: x[0] > 0, (1.0, 0.0))]}, "jam: the scene has loads"),
        ({"supports": [skmpm.Support(lambda x: x[0] > 0)]}, "jam: the scene has supports"),
        ({"cohesion": 10.0}, "jam: the scene has cohesion"),
    ],
)
def test_other_forces_than_contact_are_refused(changes, words):
    with pytest.raises(skmpm.SceneError, match=words):
        skmpm.jam(replace(lattice("square", 0.004), **changes))


@pytest.mark.parametrize("measure", [skmpm.jam, lambda scene: skmpm.moduli(scene, skmpm.initial(scene))])
def test_what_moves_is_refused(measure):
    """A rigid body that is drawn along moved by its speed in every static step, and the search never ended."""
    drawn = skmpm.Body(skmpm.disc((3 * R, 3 * R), R, spacing=0.74 * H), skmpm.Rigid(1000.0), motion=(0.1, None, 0))
    scene = skmpm.Scene([disc((0, 0)), drawn], cell=H, periodic=skmpm.Periodic(6 * R, 6 * R))
    with pytest.raises(skmpm.SceneError, match=r"rigid body 1 moves at 0.1 m/s in a packing that is to rest"):
        measure(scene)


def test_a_box_is_needed():
    scene = skmpm.Scene([disc((0, 0))], cell=H, walls=[skmpm.Wall((0, -R), (0, 1))])
    with pytest.raises(skmpm.SceneError, match="jam: the scene has no box"):
        skmpm.jam(scene)


def test_grains_that_rearrange_are_compressed_further(monkeypatch):
    """Steps above 2e-4 jam at 0.79, shorter ones rearrange the grains, and the packing jams at 0.794."""
    module = import_module("skmpm.jam")
    scene = bidisperse(8, 0.785, seed=0)

    def further(search, packing, change):
        fraction = packing.fraction + change
        way = 0.794 if change < 2e-4 else packing.state
        seen = SimpleNamespace(solid_fraction_nominal=fraction, pressure=1e5 * max(fraction - way, 0.0))
        search.rows.append((fraction, seen.pressure, 4.0, 0.0))
        bodies = SimpleNamespace(coordination_without_rattlers=np.ones(8))
        seen.solid_fraction, seen.coordination_without_rattlers, seen.bodies = fraction, 4.0, bodies
        return module._Packing(way, seen)

    monkeypatch.setattr(module._Search, "further", further)
    first = SimpleNamespace(solid_fraction_nominal=0.785, pressure=0.0)
    monkeypatch.setattr(module._Search, "at_rest", lambda *_: module._Packing(0.79, first))
    found = skmpm.jam(scene, tolerance=1e-5)
    assert found.solid_fraction_nominal == pytest.approx(0.794, abs=1e-5)
    assert found.pressure <= 1e5 * 1e-5
    assert found.bracket[0] <= 0.794 <= found.bracket[1]
