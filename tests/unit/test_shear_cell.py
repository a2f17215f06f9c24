"""Boxes that are periodic in one direction, with walls in the other: against walls, themselves and closed forms."""

from dataclasses import replace

import numpy as np
import pytest

import skmpm
from skmpm import Periodic, Wall

R = 1e-3
H = R / 5
GEL = skmpm.NeoHookean(E=10e6, nu=0.45, density=990.0)
STATIC = skmpm.Scheme(inertia=False)
SQUARE = [(R, R), (3.0 * R, R), (R, 3.0 * R), (3.0 * R, 3.0 * R)]
UPRIGHT = np.eye(2)
TURNED = np.array([[0.0, -1.0], [1.0, 0.0]])  # a quarter turn


def disc(x, r=R, material=GEL, **options):
    return skmpm.Body(skmpm.disc(x, r, spacing=0.74 * H), material, **options)


def cell(places, width, walls, turn=UPRIGHT, **options):
    """Discs at places (n, 2) and walls (point, normal, options), all turned about the origin."""
    bodies = [disc(turn @ np.array(x)) for x in places]
    every = [{k: turn @ np.array(v) if k == "velocity" else v for k, v in more.items()} for *_, more in walls]
    walls = [Wall(turn @ np.array(p), turn @ np.array(n), **e) for (p, n, _), e in zip(walls, every, strict=True)]
    along = (width, None) if abs(turn[0, 0]) > 0.5 else (None, width)
    return skmpm.Scene(bodies, cell=H, walls=walls, periodic=Periodic(*along), **options)


def plates(top, **options):
    return [((0.0, 0.0), (0.0, 1.0), {}), ((0.0, top), (0.0, -1.0), options)]


@pytest.mark.parametrize("centre", [0.0, 0.5, 1.0])
def test_a_single_body_across_the_edge_of_the_box_is_one_inside_it(centre):
    """Squeezed between two walls, wherever in the box it lies; walls are then more than surfaces."""
    block = skmpm.Body(skmpm.box(((8 * centre - 2) * R, 0.0), (4 * R, 4 * R), spacing=R / 4), GEL)
    walls = [Wall((0, 0), (0, 1)), Wall((0, 4 * R), (0, -1), velocity=(0.0, -0.04 * R))]
    plain = skmpm.Scene([block], cell=R / 2, walls=walls, friction=0.5)
    scene = replace(plain, periodic=Periodic(8 * R, None))
    state, alone = (skmpm.run(each, dt=0.5, until=1.0, scheme=STATIC, warn=False) for each in (scene, plain))
    assert state.wall_force[1, 1] == pytest.approx(alone.wall_force[1, 1], rel=1e-9) and alone.wall_force[1, 1] > 0.0


def test_one_disc_is_a_disc_between_four_walls():
    """Its images press on it as smooth walls at their planes of symmetry would: P to 1 % at 4 % of its height."""
    lid = plates(2.0 * R, velocity=(0.0, -0.08 * R))
    periodic = cell([(0.3 * R, R)], 2.0 * R, lid)
    sides = [Wall((-0.7 * R, R), (1, 0)), Wall((1.3 * R, R), (-1, 0))]
    between = replace(periodic, periodic=None, walls=[*periodic.walls, *sides])
    pressures = []
    for scene in (periodic, between):
        *_, state = skmpm.simulate(scene, dt=0.1, until=0.5, scheme=STATIC)
        pressures.append(skmpm.observe(scene, state).pressure)
    assert pressures[0] == pytest.approx(pressures[1], rel=0.01)
    assert pressures[0] > 4e4


@pytest.mark.parametrize(
    ("turn", "moved"), [(UPRIGHT, 0), (UPRIGHT, -3), (TURNED, 1)], ids=["width-none", "width-far", "height-next"]
)
def test_a_sheared_layer_carries_the_tractions_of_its_walls(turn, moved):
    """In equilibrium stress . n is the traction on both walls, to 1e-6 of the pressure (Cauchy), wherever bodies are.

    The stress is that of contacts (Love and Weber), the tractions are forces on walls over the width of the box.
    """
    lid = plates(4.0 * R, pressure=2e5, velocity=(0.05 * R, 0.0))
    places = [SQUARE[0], (3.0 * R + 4.0 * R * moved, R), *SQUARE[2:]]
    scene = cell(places, 4.0 * R, lid, turn, friction=0.5)
    tight = replace(STATIC, newton_tol=1e-9, contact_tol=1e-9, gap_tol=1e-9)
    *_, state = skmpm.simulate(scene, dt=0.2, until=1.0, scheme=tight)
    seen = skmpm.observe(scene, state)
    stress = turn.T @ seen.stress @ turn
    traction = turn.T @ state.wall_force.T / (4.0 * R)  # by the bodies on the walls, (2, 2)
    assert traction[1, 1] == pytest.approx(2e5, rel=1e-6)
    assert stress[:, 1] == pytest.approx(-traction[:, 1], abs=0.2)
    assert stress[:, 1] == pytest.approx(traction[:, 0], abs=0.2)
    assert abs(stress[0, 1]) > 1e3
    assert seen.wall_pressure == pytest.approx(2e5, rel=1e-6)
    height = float((turn.T @ state.walls[1])[1])
    assert seen.solid_fraction_nominal == pytest.approx(state.mass.sum() / GEL.density / (4.0 * R * height), rel=1e-9)


def test_a_disc_rolls_down_a_slope_through_the_box():
    """As without a box to 1e-9 cells, and g sin(a) t^2 / 3 to 5 %, through two boxes (Goldstein, section 2.4)."""
    slope, g, until, found = 0.4, 9.81, 0.06, []
    pull = g * np.array([np.sin(slope), -np.cos(slope)])
    for box in (Periodic(2.2 * R, None), None):
        scene = skmpm.Scene(
            [disc((0.0, R))], cell=H, walls=[Wall((0, 0), (0, 1))], periodic=box, friction=0.5, gravity=pull
        )
        *_, state = skmpm.simulate(scene, dt=4e-4, until=until)
        found.append(float(np.average(state.x[0], weights=state.mass)))
    assert found[0] == pytest.approx(found[1], abs=1e-9 * H)
    assert found[0] == pytest.approx(pull[0] * until**2 / 3.0, rel=0.05)
    assert found[0] > 2 * 2.2 * R


def test_momentum_of_a_sheared_cell():
    """Impulses of walls are the change of momentum to 1e-9."""
    lid = plates(4.0 * R, pressure=1e5, velocity=(1.0, 0.0))
    scene = cell(SQUARE, 4.0 * R, lid, friction=0.5)
    state = skmpm.initial(scene)
    for _ in range(40):
        before, state = state, skmpm.step(scene, state, 2e-5)
        gain = (state.v - before.v) @ state.mass
        size = max(float(np.abs(state.wall_force).max() * 2e-5), 1e-12)
        assert gain == pytest.approx(-2e-5 * state.wall_force.sum(axis=0), abs=1e-9 * size + 1e-15)
    assert state.contacts.image[0].any()
    assert abs(state.wall_force[0, 0]) > 0.0


def test_the_same_run_from_a_file_has_the_same_bits(tmp_path):
    lid = plates(4.2 * R, pressure=1e5, velocity=(1.0, 0.0))
    scene = cell([(R, R), (3.1 * R, R), (0.1 * R, 2.9 * R)], 4.2 * R, lid, friction=0.5)
    *_, state = skmpm.simulate(scene, dt=2e-5, until=2e-4)
    skmpm.save(tmp_path / "cell.checkpoint", state)
    again = skmpm.load(tmp_path / "cell.checkpoint")
    assert again.box.shape == (2, 1)
    one, other = (skmpm.step(scene, each, 2e-5) for each in (state, again))
    assert np.array_equal(one.x, other.x)


def test_files_and_pictures_show_the_edge(tmp_path):
    scene = cell([(R, R), (3.1 * R, R)], 4.2 * R, plates(2.0 * R), friction=0.5)
    state = skmpm.initial(scene)
    with skmpm.record(tmp_path / "cell.vtkhdf", scene) as record:
        record.write(state)
    frame = skmpm.read(tmp_path / "cell.vtkhdf")[0]
    assert frame.box == pytest.approx(state.box)
    axes = skmpm.plot(scene, state, "speed")
    dashed = [line for line in axes.lines if line.get_linestyle() == "--"]
    assert dashed[0].get_xdata().max() == pytest.approx(4.2 * R)
    assert "width 0.0042 m, walls 2" in str(skmpm.preflight(scene))


def test_walls_and_distances_are_those_of_one_period():
    """Hexagonal rows of points beside each other: g(r) has its first peak at their distance, also across the edge."""
    places = [(2.2 * R * (i + 0.5 * (j % 2)), R + 2.0 * R * j) for j in range(4) for i in range(3)]
    scene = cell(places, 6.6 * R, plates(8.0 * R))
    r, g = skmpm.pair_correlation(scene, skmpm.initial(scene), bins=30, largest=3.0 * R)
    assert r[np.argmax(g)] == pytest.approx(2.2 * R, abs=0.1 * R)


def test_gravity_along_the_box_needs_rough_walls():
    for friction, direction, warns in ((0.0, (1.0, 0.0), True), (0.5, (1.0, 0.0), False), (0.0, (0.0, -1.0), False)):
        scene = cell([(R, R)], 4.2 * R, plates(2.0 * R), friction=friction, gravity=direction)
        assert any("periodic" in str(w) for w in skmpm.preflight(scene).warnings) == warns


@pytest.mark.parametrize(
    ("box", "walls", "words"),
    [
        (Periodic(None, None), [], "width and height are None"),
        (Periodic(4 * R, None, rate=((1.0, 0.0), (0.0, 0.0))), [], "move its walls instead"),
        (Periodic(4 * R, None, stress=((-1.0, np.nan), (np.nan, np.nan))), [], "move its walls instead"),
        (Periodic(4 * R, None, mass=1.0), [], "move its walls instead"),
        (Periodic(-4 * R, None), [], "width"),
        (Periodic(4 * R, None), [Wall((0, 0), (1, 0))], "normals like \\(0, 1\\)"),
        (Periodic(None, 4 * R), [Wall((0, 0), (0, 1))], "normals like \\(1, 0\\)"),
        (Periodic(4 * R, 4 * R), [Wall((0, 0), (0, 1))], "Periodic\\(width, None\\)"),
    ],
)
def test_what_is_refused(box, walls, words):
    with pytest.raises(skmpm.SceneError, match=words):
        skmpm.Scene([disc((R, R))], cell=H, walls=walls, periodic=box)


def test_moduli_need_a_box_that_is_periodic_in_both_directions():
    scene = cell([(R, R)], 2.0 * R, plates(2.0 * R))
    with pytest.raises(skmpm.SceneError, match="both directions"):
        skmpm.moduli(scene, skmpm.initial(scene))


@pytest.mark.parametrize("along", [(True, False), (False, True)])
@pytest.mark.parametrize("shapes", ["discs", "ellipses"])
def test_packings_that_are_periodic_in_one_direction(shapes, along):
    """No overlap across the open sides, none with the walls, and bodies that lie across the open ones."""
    R_s = np.random.default_rng(0).uniform(0.8, 1.2, 30) * R
    given = R_s if shapes == "discs" else [skmpm.ellipse((0, 0), (r, 0.6 * r), spacing=0.7 * H) for r in R_s[:15]]
    packed = skmpm.packing(given, width=9 * R, solid_fraction=0.6, periodic=along, seed=2)
    points = (
        [skmpm.disc(x, r, spacing=0.7 * H) for x, r in zip(packed.centres.T, R_s, strict=True)]
        if shapes == "discs"
        else packed.points
    )
    sides = {True: (packed.width, None), False: (None, packed.height)}[along[0]]
    size = np.array([packed.width, packed.height])
    across = np.array([0.0, 1.0]) if along[0] else np.array([1.0, 0.0])
    walls = [Wall((0, 0), across), Wall(size * across, -across)]
    scene = skmpm.Scene([skmpm.Body(p, GEL) for p in points], cell=H, walls=walls, periodic=Periodic(*sides))
    x = scene.initial_positions
    axis = 0 if along[0] else 1
    assert (x[axis] < 0.0).any() or (x[axis] > size[axis]).any()


def test_a_body_longer_than_the_period_is_named():
    with pytest.raises(skmpm.SceneError, match=r"body 0 overlaps its own image.*make the box wider"):
        cell([(R, R)], 1.9 * R, plates(2.0 * R))


def test_a_region_without_walls_has_no_pair_correlation():
    scene = cell([(R, R), (3 * R, R)], 4.2 * R, [])
    with pytest.raises(skmpm.SceneError, match="no walls or periodic box close the region"):
        skmpm.pair_correlation(scene, skmpm.initial(scene))


def test_no_answer_for_packings_is_refused():
    with pytest.raises(skmpm.PackingError, match="True, False, or two"):
        skmpm.packing([R] * 4, width=9 * R, periodic="x")
