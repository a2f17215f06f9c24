"""Periodic boxes: against walls, against themselves elsewhere, under given rates and stresses; what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from test_only_what_is_required import Calls

import skmpm
from skmpm import Periodic, coulomb
from skmpm.contact.motion import Motion
from skmpm.scene import prescribed_velocities

R = 1e-3
H = R / 5
GEL = skmpm.NeoHookean(E=10e6, nu=0.45, density=990.0)
STATIC = skmpm.Scheme(inertia=False)
TIGHT = skmpm.Scheme(inertia=False, newton_tol=1e-10, contact_tol=1e-12, gap_tol=1e-11)
NAN = np.nan


def disc(x, y, r=R, **options):
    return skmpm.Body(skmpm.disc((x, y), r, spacing=0.74 * H), GEL, **options)


def lattice(n=1, shift=(0.3713 * R, 0.6129 * R), images=None, **box):
    """A square lattice of discs that touch, n by n in the box; `images` displaces them by edges of the box."""
    width, options = 2.0 * R * n, {k: box.pop(k) for k in ("friction",) if k in box}
    places = [(2 * R * i + shift[0], 2 * R * j + shift[1]) for i in range(n) for j in range(n)]
    moved = np.zeros((n * n, 2)) if images is None else width * np.array(images)
    bodies = [disc(*(np.array(x) + k)) for x, k in zip(places, moved, strict=True)]
    return skmpm.Scene(bodies, cell=H, periodic=Periodic(width, width, **box), **options)


def squeeze(rate):
    """A velocity gradient that shortens both edges at a constant speed."""
    return lambda t: -rate / (1.0 - rate * t) * np.eye(2)


def four_walls(rate):
    v = rate * R
    places = (((0, R), (1, 0), (v, 0)), ((2 * R, R), (-1, 0), (-v, 0)), ((R, 0), (0, 1), (0, v)),
              ((R, 2 * R), (0, -1), (0, -v)))  # fmt: skip
    walls = [skmpm.Wall(point, normal, velocity=velocity) for point, normal, velocity in places]
    return skmpm.Scene([disc(R, R)], cell=H, walls=walls)


def test_one_disc_is_a_disc_between_four_walls():
    """P at the same solid fraction within 1 %, from 0.80 to 0.90: images meet at planes where walls would be."""
    rate, dt, found = 1.0, 0.01, []
    for scene in (lattice(1, (R, R), rate=squeeze(rate)), four_walls(rate)):
        seen = [skmpm.observe(scene, s) for s in skmpm.simulate(scene, dt=dt, until=0.07, scheme=STATIC)]
        found.append(np.array([(o.solid_fraction, o.pressure) for o in seen]).T)
    (phi, p), (phi_walls, p_walls) = found
    chosen = (phi > 0.8) & (phi < 0.9)
    assert np.count_nonzero(chosen) >= 3
    assert p[chosen] == pytest.approx(np.interp(phi[chosen], phi_walls, p_walls), rel=0.01)


def test_nothing_depends_on_where_the_box_begins():
    """Four discs, three of them displaced by edges of the box (20 cells long): P to 1e-9, forces to 1e-6."""
    pressures, forces = [], []
    for images in (None, [(0, 0), (1, 0), (0, -1), (2, 3)]):
        scene = lattice(2, images=images, rate=squeeze(1.0), friction=0.3)
        *_, state = skmpm.simulate(scene, dt=0.01, until=0.03, scheme=skmpm.Scheme(inertia=False, newton_tol=1e-6))
        pressures.append(skmpm.observe(scene, state).pressure)
        forces.append(np.sort(skmpm.network(scene, state).force[0]))
    assert pressures[1] == pytest.approx(pressures[0], rel=1e-9)
    assert forces[1] == pytest.approx(forces[0], rel=1e-6)


PRESSED = {"rate": [[0.0, 30.0], [0.0, 0.0]], "stress": [[NAN, NAN], [NAN, -2e5]]}


@pytest.mark.parametrize("theta", [1.0, 0.5])
@pytest.mark.parametrize(
    ("box", "tolerance"),
    [({"rate": -20.0 * np.eye(2)}, 1e-6), (PRESSED, 5e-6)],
    ids=["squeezed", "sheared under a stress"],
)
def test_with_inertia_a_body_and_its_image_move_alike(box, tolerance, theta):
    """Bodies a box away have other velocities and the same motion: to 1e-6 cells after 15 steps of an impact.

    To 5e-6 where the motion of the box is unknown. One of the discs is rigid. If a box did not carry bodies with it
    as its rate changes, they would differ by cells.
    """
    x, tight = [], skmpm.Scheme(newton_tol=1e-9, contact_tol=1e-11, gap_tol=1e-9, theta=theta)
    images = np.array([(0, 0), (1, 0), (0, -1), (2, 3)])
    for k in (None, images):
        scene = lattice(2, images=k, **box, friction=0.3)
        bodies = [*scene.bodies[:3], replace(scene.bodies[3], material=skmpm.Rigid(2000.0))]
        scene = replace(scene, bodies=bodies)
        *_, state = skmpm.simulate(scene, dt=2e-5, until=3e-4, scheme=tight)
        shift = 0.0 if k is None else (state.box @ images.T)[:, state.body]
        x.append(state.x - shift)
        assert state.contacts.force[0].max() > 0.0
    assert np.abs(x[1] - x[0]).max() < tolerance * H


def test_a_box_carries_a_body_as_its_rate_changes():
    """A disc at rest in a box whose edges a stress moves stays at its place in the box, wherever that is."""
    for x in (3 * R, 13 * R):
        box = Periodic(10 * R, 10 * R, stress=[[-1e4, NAN], [NAN, NAN]])
        scene = skmpm.Scene([disc(x, 3 * R)], cell=H, periodic=box)
        *_, state = skmpm.simulate(scene, dt=5e-5, until=2e-3)
        centre = np.average(state.x, axis=1, weights=state.mass)
        assert state.box[0, 0] < 9.9 * R
        assert centre == pytest.approx([x * state.box[0, 0] / (10 * R), 3 * R], rel=1e-6)
        assert np.abs(state.report.energy.kinetic) < 1e-12 * state.report.energy.largest + 1e-20


@pytest.mark.parametrize("component", ["xx", "yy", "xy"])
def test_edges_follow_a_constant_rate_exactly(component):
    """exp(L t) H, whatever the steps, also where steps are chosen."""
    L = np.zeros((2, 2))
    L["xy".index(component[0]), "xy".index(component[1])] = 5.0
    scene = skmpm.Scene([disc(R, R)], cell=H, periodic=Periodic(6 * R, 5 * R, rate=L))
    for dt in (3e-4, None):
        *_, state = skmpm.simulate(scene, dt=dt, until=2e-3)
        exact = expm(2e-3 * L) @ scene.periodic.box
        assert state.box == pytest.approx(exact, abs=1e-12 * R)
        assert state.contacts.gap.size == 0 and np.abs(state.F - np.eye(2)[:, :, None]).max() < 1e-9


@pytest.mark.parametrize("scheme", [skmpm.Scheme(), STATIC], ids=["dynamic", "static"])
def test_the_stress_is_that_given(scheme):
    """Two different pressures on one disc: the stress of the contacts is -P to 1e-3 at the end of a ramp."""
    until, steps = (2e-3, 100) if scheme.inertia else (1.0, 5)
    stress = lambda t: -min(2.0 * t / until, 1.0) * np.array([[2e5, NAN], [NAN, 3e5]])  # noqa: E731
    scene = lattice(1, (R, R), stress=stress)
    *_, state = skmpm.simulate(scene, dt=until / steps, until=until, scheme=scheme)
    found = skmpm.observe(scene, state)
    assert found.stress[0, 0] == pytest.approx(-2e5, rel=2e-3)
    assert found.stress[1, 1] == pytest.approx(-3e5, rel=2e-3)
    assert state.box[0, 0] > state.box[1, 1]


def test_a_stress_that_nothing_bears_is_named():
    """Without inertia, two discs apart: a failed step that says which stress, and that no contact presses."""
    loose = skmpm.Periodic(8 * R, 8 * R, stress=[[-1e4, np.nan], [np.nan, -1e4]])
    scene = skmpm.Scene([disc(2 * R, 2 * R), disc(6 * R, 5 * R)], cell=R / 4, friction=0.5, periodic=loose)
    named = "the stress xx of the periodic box, on which no contact presses: no convergence"
    with pytest.raises(skmpm.StepFailed, match=named):
        list(skmpm.simulate(scene, dt=0.01, until=0.01, scheme=STATIC))


@pytest.mark.parametrize("size, across", [((4.0, 12.0), NAN), ((3.1, 3.1), -1e4)])
def test_a_box_of_a_few_cells_that_a_stress_closes_is_named(size, across):
    """Without inertia it shrinks by a cell in an iteration, and so do both sides at once of the second one."""
    box = skmpm.Periodic(size[0] * R, size[1] * R, stress=[[-1e4, NAN], [NAN, across]])
    scene = skmpm.Scene([disc(1.5 * R, 1.5 * R)], cell=R / 5, periodic=box)
    with pytest.raises(skmpm.StepFailed, match="the periodic box: its stress shrinks a side to nothing"):
        list(skmpm.simulate(scene, dt=0.01, until=0.01, scheme=STATIC, warn=False))


@pytest.mark.parametrize("theta", [1.0, 0.5])
def test_an_edge_with_a_mass_accelerates_as_newton_says(theta):
    """Nothing touches: m L'' = sigma height; the width after a time, to the first order of 200 steps."""
    mass, sigma, until = 1.0, 1e3, 0.05
    box = Periodic(0.08, 0.08, stress=[[sigma, NAN], [NAN, NAN]], mass=mass)
    scene = skmpm.Scene([skmpm.Body(skmpm.disc((0.04, 0.04), 0.004, spacing=7e-4), GEL)], cell=1e-3, periodic=box)
    *_, state = skmpm.simulate(scene, dt=until / 200, until=until, scheme=skmpm.Scheme(theta=theta))
    assert state.box_rate[0, 0] * state.box[0, 0] == pytest.approx(sigma * 0.08 / mass * until, rel=1e-9)
    assert state.box[0, 0] == pytest.approx(0.08 + 0.5 * sigma * 0.08 / mass * until**2, rel=5e-3)
    assert state.box[1, 1] == 0.08


def test_a_fast_fall_costs_what_a_rest_costs():
    """Discs that move by half a box in each step find the same candidates, since their images move with them."""
    discs = [disc(x, R, velocity=(100.0, 0.0)) for x in (R, 3.1 * R)]
    scene, dt = skmpm.Scene(discs, cell=H, periodic=Periodic(5 * R, 5 * R)), 2.5e-5
    state, boundary = skmpm.initial(scene), scene.outlines.point
    motion = Motion.prescribed(scene, state, prescribed_velocities(scene, 0.0, dt, state.box), dt)
    assert motion.largest(dt * state.v[:, boundary], state.x[:, boundary]) < 1e-12 * R


def test_pair_correlation_counts_images():
    """A square lattice: the first ring holds its four neighbours, at 2 R, and g there is 4 over the mean."""
    scene = lattice(3)
    r, g = skmpm.pair_correlation(scene, skmpm.initial(scene), bins=21, largest=5.0 * R)
    first = np.flatnonzero(g)[0]
    assert abs(r[first] - 2.0 * R) < 0.3 * R
    edges = np.linspace(0.0, 5.0 * R, 22)
    ring = np.pi * (edges[first + 1] ** 2 - edges[first] ** 2) / (2.0 * R) ** 2
    assert g[first] == pytest.approx(4.0 / ring, rel=1e-9)


def test_shear_stress_moves_the_upper_edge():
    """A lattice with friction under pressure and a given shear stress, quasi-static: all components to 1 %."""
    stress = lambda t: t * np.array([[-3e5, 4e4], [4e4, -3e5]])  # noqa: E731
    scene = lattice(2, (R, R), stress=stress, friction=0.8)
    *_, state = skmpm.simulate(scene, dt=0.1, until=1.0, scheme=STATIC)
    found = skmpm.observe(scene, state).stress
    assert 0.5 * (found + found.T) == pytest.approx(stress(1.0), abs=0.01 * 3e5)
    assert state.box[0, 1] > 0.0 and state.box[1, 0] == 0.0


@pytest.mark.parametrize(("strain", "lost"), [(0.09, 5e-3), (0.03, 2e-2)])
def test_work_of_the_box_is_stored(strain, lost):
    """Quasi-static, without friction: compression and shear of one disc and back.

    What is lost is lost while the contacts are light, in which the closest points move along the outlines.
    """
    L = strain / 3.0 * np.array([[-3.0, 4.0], [0.0, -3.0]])
    scene = lattice(1, (R, R), rate=lambda t: L if t < 1.0 else -L)
    states = list(skmpm.simulate(scene, dt=0.05, until=2.0, scheme=STATIC))
    energies = [state.report.energy for state in states]
    most = max(e.elastic for e in energies)
    assert most > 0.0
    assert energies[19].external == pytest.approx(energies[19].elastic, rel=2e-2)
    assert abs(energies[-1].dissipated) < lost * most
    assert energies[-1].elastic < 1e-2 * most


def test_work_of_a_sheared_box_is_that_of_its_stress():
    """With friction, to a strain of 0.4: the work is the sum of A sigma : L dt, to 3e-6.

    The stress is that of Love and Weber and, of 1e-5 of the work, the kinetic one, -sum m u u / A.
    """
    places = ((1.0, 1.0), (3.1, 1.0), (2.05, 2.95), (4.15, 2.95))
    box = Periodic(4.2 * R, 3.9 * R, rate=[[0.0, 40.0], [0.0, 0.0]])
    scene, work = skmpm.Scene([disc(x * R, y * R) for x, y in places], cell=H, friction=0.3, periodic=box), 0.0
    for state in skmpm.simulate(scene, dt=5e-5, until=0.4 / 40.0):
        stress = skmpm.observe(scene, state).stress
        mass = np.bincount(state.body, state.mass)
        x, v = (np.stack([np.bincount(state.body, state.mass * c) for c in a]) / mass for a in (state.x, state.v))
        u = v - state.box_rate @ x
        stress -= (mass * u) @ u.T / np.linalg.det(state.box)
        work += np.linalg.det(state.box) * float(np.sum(stress * state.box_rate)) * state.report.dt
    energy = state.report.energy
    assert work == pytest.approx(energy.external, rel=3e-6)
    assert 0.0 < energy.dissipated < energy.external


@pytest.mark.parametrize("theta", [1.0, 0.5])
def test_a_box_works_on_what_flies_in_it(theta):
    """Squeezed along x and sheared: u' = -L u for velocities relative to the box (SLLOD); its work is their energy.

    For L = ((-a, b), (0, 0)) u_y is constant and u_x = (u_x0 - b u_y / a) exp(a t) + b u_y / a. One of the discs is
    rigid, and spins.
    """
    a, b, until, u = 30.0, 20.0, 0.01, np.array([0.4, 0.3])
    box = Periodic(20 * R, 10 * R, rate=[[-a, b], [0.0, 0.0]])
    soft, hard = (disc(x * R, 3 * R, velocity=u) for x in (3.0, 8.0))
    hard = replace(hard, material=skmpm.Rigid(2000.0), spin=20.0)
    scene = skmpm.Scene([soft, hard], cell=H, periodic=box)
    start = skmpm.initial(scene).report.energy
    *_, state = skmpm.simulate(scene, dt=until / 50, until=until, scheme=skmpm.Scheme(theta=theta))
    assert state.contacts.gap.size == 0
    expected = np.array([(u[0] - b * u[1] / a) * np.exp(a * until) + b * u[1] / a, u[1]])
    for body in (0, 1):
        own = state.body == body
        centre, velocity = (np.average(a[:, own], axis=1, weights=state.mass[own]) for a in (state.x, state.v))
        found = velocity - state.box_rate @ centre
        assert found == pytest.approx(expected, rel=1e-9)
    energy, gained = state.report.energy, 0.5 * state.mass.sum() * (expected @ expected - u @ u)
    assert energy.external == pytest.approx(gained, rel=1e-9)
    assert energy.kinetic - start.kinetic == pytest.approx(energy.external, rel=1e-9)
    assert abs(energy.dissipated) < 1e-9 * start.kinetic


def test_one_disc_touches_four_images_of_itself():
    """Z = 4, two pairs with branches as long as the box, forces that balance; of their stress the symmetric part."""
    scene = lattice(1, rate=squeeze(1.0))
    *_, state = skmpm.simulate(scene, dt=0.01, until=0.02, scheme=STATIC)
    found, pairs = skmpm.observe(scene, state), skmpm.network(scene, state)
    assert found.coordination == found.coordination_without_rattlers == 4.0
    assert pairs.bodies.tolist() == [[0, 0], [0, 0]]
    assert np.sort(np.abs(pairs.branch).max(axis=0)) == pytest.approx(np.full(2, state.box[0, 0]), rel=1e-12)
    assert np.abs(state.body_force).max() < 1e-9 * pairs.force[0].max()
    stress = -(pairs.force_xy @ pairs.branch.T) / np.linalg.det(state.box)
    assert 0.5 * (stress + stress.T) == pytest.approx(found.stress, rel=1e-9)
    assert skmpm.contact_pressure(scene, state, 0).pressure.max() > found.pressure


def test_sheared_boxes_are_cut_again_and_restart_exactly():
    """To a strain of 1.2: the second edge stays within half of the first, and a restart gives the same bits."""
    rate, places = np.array([[0.0, 400.0], [0.0, 0.0]]), ((1.0, 1.0), (3.1, 1.0), (2.05, 2.95), (4.15, 2.95))
    box = Periodic(4.2 * R, 3.9 * R, rate=rate)
    scene = skmpm.Scene([disc(x * R, y * R) for x, y in places], cell=H, friction=0.3, periodic=box)
    states = list(skmpm.simulate(scene, dt=2e-5, until=1.2 / 400.0))
    assert max(abs(s.box[0, 1]) for s in states) <= 0.5 * 4.2 * R * (1.0 + 1e-9)
    assert np.ptp([s.box[0, 1] for s in states]) > 0.9 * 4.2 * R
    assert max(s.contacts.force[0].max(initial=0.0) for s in states) > 0.0
    middle = next(i for i, s in enumerate(states) if s.t > 0.4 * 1.2 / 400.0)  # before it is cut
    *_, again = skmpm.simulate(scene, dt=2e-5, until=1.2 / 400.0, start=states[middle])
    assert np.array_equal(again.x, states[-1].x) and np.array_equal(again.box, states[-1].box)
    assert max(s.report.overlap for s in states) < 1e-3


def test_checkpoints_and_recordings_keep_the_box(tmp_path):
    scene = lattice(1, rate=squeeze(1.0))
    *_, state = skmpm.simulate(scene, dt=0.01, until=0.02, scheme=STATIC)
    skmpm.save(tmp_path / "state.npz", state)
    assert np.array_equal(skmpm.load(tmp_path / "state.npz").box, state.box)
    with skmpm.record(tmp_path / "run.vtkhdf", scene) as film:
        film.write(state)
    frame = skmpm.read(tmp_path / "run.vtkhdf")[0]
    assert frame.box == pytest.approx(state.box)
    within = np.linalg.solve(frame.box, frame.x.mean(axis=1))
    assert ((within >= 0.0) & (within < 1.0)).all()


def test_a_box_that_stops_is_another_stage():
    """`continued` takes a compressed box over into one that is held; another box is refused."""
    scene = lattice(1, (R, R), rate=squeeze(1.0))
    *_, state = skmpm.simulate(scene, dt=0.01, until=0.03, scheme=STATIC)
    held = skmpm.Scene(scene.bodies, cell=H, periodic=Periodic(2 * R, 2 * R))
    *_, end = skmpm.simulate(held, dt=0.01, until=0.05, start=skmpm.continued(scene, state, held), scheme=STATIC)
    assert np.array_equal(end.box, state.box)
    assert skmpm.observe(held, end).pressure == pytest.approx(skmpm.observe(scene, state).pressure, rel=1e-2)
    with pytest.raises(skmpm.SceneError, match="only the old scene has a periodic box"):
        skmpm.continued(scene, state, skmpm.Scene(scene.bodies, cell=H))
    with pytest.raises(skmpm.SceneError, match="the periodic box of the new scene is"):
        skmpm.continued(scene, state, skmpm.Scene(scene.bodies, cell=H, periodic=Periodic(2.1 * R, 2 * R)))
    with pytest.raises(skmpm.SceneError, match="the state is periodic in 2 directions, the scene in 0"):
        skmpm.step(skmpm.Scene(scene.bodies, cell=H), state, 1e-3)


def test_scenes_without_a_box_do_not_know_it():
    """No image is looked for and nothing is moved into a box."""
    scene = skmpm.Scene([disc(R, R), disc(3 * R, R)], cell=H, walls=[skmpm.Wall((0, 0), (0, 1))])
    with Calls() as calls:
        list(skmpm.simulate(scene, dt=1e-5, until=3e-5))
    names = ("images._near", "images.reduced", "StressedBox.in_step", "periodic.deformed", "periodic.recut")
    assert [calls.named(name) for name in names] == [0] * len(names)


@pytest.mark.parametrize(
    ("box", "message"),
    [
        (lambda: Periodic(0.0, R), "periodic: width = 0.0; give a length"),
        (lambda: Periodic(R, NAN), "periodic: height = nan"),
        (lambda: Periodic(R, R, rate=3.0), r"periodic: rate = 3.0; give a tensor \(2, 2\)"),
        (lambda: Periodic(R, R, rate=[[0, NAN], [0, 0]]), "periodic: rate = .* and no stress gives component xy"),
        (lambda: Periodic(R, R, rate=lambda t: "fast"), "periodic: rate at t = 0 s = 'fast'"),
        (lambda: Periodic(R, R, stress=[[1.0, 2.0], [3.0, 1.0]]), "periodic: stress = .* is not symmetric"),
        (
            lambda: Periodic(R, R, stress=lambda t: [[-1.0, t + 2.0], [0.0, -1.0]]),
            "periodic: stress at t = 0 s = .* is not symmetric",
        ),
        (lambda: Periodic(R, R, stress=np.full((2, 2), NAN)), "periodic: stress has no component"),
        (lambda: Periodic(R, R, stress=[[np.inf, NAN], [NAN, NAN]]), "periodic: stress = .*finite number"),
        (
            lambda: Periodic(R, R, rate=[[1, 0], [0, 0]], stress=[[-1.0, NAN], [NAN, NAN]]),
            "periodic: rate = .* has a component whose stress is given, too",
        ),
        (lambda: Periodic(R, R, mass=1.0), "periodic: mass = 1.0 without a stress"),
        (lambda: Periodic(R, R, stress=-np.eye(2), mass=-1.0), "periodic: mass = -1.0; give a mass"),
        (lambda: (R, R), "periodic is a tuple; use skmpm.Periodic"),
    ],
)
def test_bad_input_is_refused(box, message):
    with pytest.raises(skmpm.SceneError, match=message):
        skmpm.Scene([disc(0.0, 0.0, 0.4 * R)], cell=H, periodic=box())


def test_walls_and_overlaps_are_refused():
    with pytest.raises(skmpm.SceneError, match="periodic: the scene also has 1 walls"):
        skmpm.Scene([disc(R, R)], cell=H, walls=[skmpm.Wall((0, 0), (0, 1))], periodic=Periodic(3 * R, 3 * R))
    with pytest.raises(skmpm.SceneError, match="body 0 overlaps its own image in the periodic box"):
        skmpm.Scene([disc(R, R)], cell=H, periodic=Periodic(1.9 * R, 3 * R))
    with pytest.raises(skmpm.SceneError, match="bodies 0 and 1 overlap by"):
        skmpm.Scene([disc(0.5 * R, R), disc(3.7 * R, R)], cell=H, periodic=Periodic(4 * R, 4 * R))


def test_a_stress_that_ends_is_named_then():
    scene = lattice(1, stress=lambda t: -np.eye(2) if t < 1.5 else np.full((2, 2), NAN))
    with pytest.raises(
        skmpm.SceneError, match=r"periodic: stress at t = 2 s = .*; a component is given always or never"
    ):
        list(skmpm.simulate(scene, dt=1.0, until=3.0, scheme=STATIC, warn=False))


def test_contact_at_shared_nodes_is_refused():
    with pytest.raises(skmpm.SceneError, match="the box is periodic, which contact = shared_grid cannot"):
        skmpm.initial(lattice(1), scheme=skmpm.Scheme.nezamabadi2017())


def test_packing_in_a_periodic_box():
    """No disc overlaps another or an image; the seed decides; the closed box is another packing."""
    radii = np.random.default_rng(3).uniform(0.7, 1.2, 40)
    packed = skmpm.packing(radii, 12.0, solid_fraction=0.8, periodic=True, seed=2)
    apart = packed.centres[:, :, None] - packed.centres[:, None]
    size = np.array([packed.width, packed.height])[:, None, None]
    apart = np.hypot(*(apart - size * np.rint(apart / size)))
    gap = (apart - radii[:, None] - radii)[~np.eye(40, dtype=bool)]
    assert gap.min() > -1e-5
    assert np.pi * (radii**2).sum() / (packed.width * packed.height) == pytest.approx(0.8, rel=1e-9)
    again = skmpm.packing(radii, 12.0, solid_fraction=0.8, periodic=True, seed=2)
    assert np.array_equal(again.centres, packed.centres)
    edge = packed.centres - radii
    assert edge.min() < 0.0 or (packed.centres + radii > size[:, 0]).any()


def test_a_mixture_of_rigid_and_soft_grains_under_pressure():
    """Four of each: the stress of all contacts, rigid grains included, is -P in a quasi-static box."""
    radii = np.random.default_rng(5).uniform(0.8 * R, 1.1 * R, 8)
    packed = skmpm.packing(radii, 5.5 * R, solid_fraction=0.78, periodic=True, seed=4)
    bodies = [
        skmpm.Body(skmpm.disc(c, r, spacing=0.74 * H), GEL if i % 2 else skmpm.Rigid(2000.0))
        for i, (c, r) in enumerate(zip(packed.centres.T, radii, strict=True))
    ]
    box = Periodic(packed.width, packed.height, stress=lambda t: -1e5 * min(t / 2e-3, 1.0) * np.diag([1.0, NAN])
                   + np.diag([0.0, -1e5 * min(t / 2e-3, 1.0)]) + np.array([[0, NAN], [NAN, 0]]))  # fmt: skip
    scene = skmpm.Scene(bodies, cell=H, friction=0.3, periodic=box)
    *_, state = skmpm.simulate(scene, until=8e-3)
    found = skmpm.observe(scene, state)
    assert found.pressure == pytest.approx(1e5, rel=0.05)
    assert found.overlap < 1e-3


def test_a_body_moves_with_a_box_whose_rate_changes():
    free = skmpm.Body(skmpm.disc((0.07, 0.07), 0.01, spacing=2e-3), skmpm.NeoHookean(1e6, 0.3, 1000.0))
    box = Periodic(0.1, 0.1, rate=lambda t: ((min(t / 0.01, 1.0), 0.0), (0.0, 0.0)))
    scene = skmpm.Scene([free], cell=2.5e-3, periodic=box)
    *_, state = skmpm.simulate(scene, dt=5e-4, until=0.02)
    speed, centre = (np.average(a[0], weights=state.mass) for a in (state.v, state.x))
    assert speed == pytest.approx(state.box_rate[0, 0] * centre, rel=1e-9)


@pytest.mark.parametrize("kind", ["support", "spring"])
def test_a_box_that_a_stress_moves_leaves_bodies_to_what_holds_them(kind):
    """It moved points of supports by a third of a cell, and stiff beds, whose forces jumped, failed."""
    R, gel = 0.02, skmpm.NeoHookean(1e6, 0.3, 1000.0)
    bodies = [
        skmpm.Body(skmpm.disc(((1 + 2 * i) * R, (1 + 2 * j) * R), 0.999 * R, spacing=4e-3), gel)
        for i in (0, 1)
        for j in (0, 1)
    ]

    def held(x):
        return np.hypot(x[0] - 3 * R, x[1] - 3 * R) < R / 2

    how = {"supports": [skmpm.Support(held)]} if kind == "support" else {"springs": [skmpm.Spring(held, 1e8)]}
    box = Periodic(4 * R, 4 * R, stress=((-2e4, np.nan), (np.nan, -2e4)))
    scene = skmpm.Scene(bodies, cell=5e-3, periodic=box, **how)
    retries = 0
    for state in skmpm.simulate(scene, dt=2e-3, until=0.04):
        retries += state.report.retries
    own = held(scene.initial_positions)
    assert retries == 0
    assert np.abs(state.x[:, own] - scene.initial_positions[:, own]).max() < 0.01 * scene.cell


def test_impacts_at_the_end_of_a_step_do_not_depend_on_where_bodies_lie():
    """Round-off of centres decided which contacts of a sheared box took part: energies differed by 10 to 30 %."""
    R, h = 0.1, 0.025
    soft = skmpm.NeoHookean(1e6, 0.3, 1000.0)
    plastic = skmpm.ElastoPlastic(1e6, 0.3, 1000.0, yield_stress=3e4, hardening=1e5, viscosity=200.0)
    scheme = skmpm.Scheme(theta=0.5, newton_tol=1e-9)
    box = Periodic(
        8 * R,
        6 * R,
        rate=[[-1.0, 4.0], [0.0, 0.0]],
        stress=lambda t: [[np.nan, np.nan], [np.nan, -5e3 * (1 + 30 * t)]],
    )

    def kinetic(shift):
        bodies = [
            skmpm.Body(
                skmpm.disc((R + 2 * R * i + 0.0037 + shift[0], R + 2 * R * j + 0.0041 + shift[1]), 0.999 * R,
                           spacing=h / 1.35 * (1.0 + 0.01 * ((4 * j + i) % 5))),
                (plastic, soft)[i % 2],
            )
            for j in range(3)
            for i in range(4)
        ]  # fmt: skip
        scene = skmpm.Scene(bodies, cell=h, periodic=box, friction=0.4)
        *_, state = skmpm.simulate(scene, dt=1e-3, until=8e-3, scheme=scheme)
        return state.report.energy.kinetic

    assert kinetic((3 * h, -5 * h)) == pytest.approx(kinetic((0.0, 0.0)), rel=1e-6)


def test_the_stress_of_a_box_is_that_across_its_edges_with_a_held_body_in_it_too():
    """Held bodies had no branches, as if they were walls."""
    gel, R = skmpm.NeoHookean(1e6, 0.3, 1000.0, viscosity=2000.0), 1.0
    bodies = [
        skmpm.Body(skmpm.disc((1.0 + 2.0 * i, 1.0 + 2.0 * j), R, spacing=0.25), gel)
        for i in (0, 1)
        for j in (0, 1)
        if i + j
    ]
    rigid = skmpm.Body(skmpm.disc((1.0, 1.0), R, spacing=0.25), skmpm.Rigid(1000.0), motion=(0.0, 0.0, 0.0))
    box = Periodic(4.0, 4.0, rate=((-0.02, 0.0), (0.0, -0.02)))
    scene = skmpm.Scene([rigid, *bodies], cell=0.34, periodic=box, friction=0.5)
    *_, state = skmpm.simulate(scene, dt=0.1, until=2.0, scheme=skmpm.Scheme(inertia=False))
    across = np.einsum("ik,jk->ij", state.contacts.vectors, state.contacts.image) / np.linalg.det(state.box)
    np.testing.assert_allclose(skmpm.observe(scene, state).stress, across, atol=0.01 * np.abs(across).max())
    pairs = skmpm.network(scene, state)
    stress = -np.einsum("ik,jk->ij", pairs.force_xy, pairs.branch) / np.linalg.det(state.box)
    np.testing.assert_allclose(stress, across, atol=0.02 * np.abs(across).max())


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_large_problem_in_a_box_under_stress_stays_sparse(friction, filled, monkeypatch):
    """The box moves all contacts: eliminated, it would make W dense, with the same result."""
    box = {"rate": [[0.0, 2.0], [0.0, NAN]], "stress": [[NAN, NAN], [NAN, -2e5]]}
    scene = lattice(9, friction=friction, **box)

    def run():
        *_, state = skmpm.simulate(scene, dt=2e-5, until=8e-5, scheme=skmpm.Scheme(newton_tol=1e-8))
        return state

    sparse, (entries, rows) = run(), filled[-1]
    assert rows > coulomb.MAX_DENSE_ROWS and entries < 0.2 * rows**2
    monkeypatch.setattr(coulomb, "MAX_DENSE_ROWS", 10 * rows)
    dense, (entries, rows) = run(), filled[-1]
    assert entries > 0.6 * rows**2
    assert np.abs(sparse.x - dense.x).max() < 1e-8 * H
    assert sparse.box == pytest.approx(dense.box, rel=1e-9)


def test_a_block_on_its_own_image_touches_it_over_the_length_of_two_blocks():
    """Flat sides that slide over each other: corners of the side that gives no points do not count twice."""
    found = []
    for n in (1, 2):
        blocks = [skmpm.Body(skmpm.box((0.6, j), (2.0, 1.0), spacing=0.125), GEL) for j in range(n)]
        scene = skmpm.Scene(blocks, cell=0.2, periodic=Periodic(4.0, n, rate=[[0.0, 100.0], [0.0, -5.0]]))
        *_, state = skmpm.simulate(scene, dt=1e-4, until=3e-3)
        found.append(skmpm.observe(scene, state).bodies.contact_surface[0])
        assert skmpm.network(scene, state).length.tolist() == pytest.approx(n * [1.7], abs=0.0625)
    assert found[0] == pytest.approx(found[1], rel=1e-3)


def test_a_body_may_be_followed_in_any_image():
    """Contact points were predicted with the rate of the box in the last step: forces differed by 1 to 10 %."""
    L, forces = 4.25 * R, []
    tight = skmpm.Scheme(theta=0.5, newton_tol=1e-8, contact_tol=1e-9, gap_tol=1e-8)
    for shifts in (np.zeros((4, 2)), np.array([(0, 0), (2, -1), (-3, 1), (0, 4)])):
        places = zip(((1.05, 1.02), (3.18, 1.11), (1.22, 3.13), (3.29, 3.21)), shifts, strict=True)
        bodies = [
            skmpm.Body(skmpm.disc(R * np.array(c) + L * k, (1.0 + 0.005 * i) * R, spacing=R / 5), GEL)
            for i, (c, k) in enumerate(places)
        ]
        box = skmpm.Periodic(L, L, rate=[[-100.0, 0.0], [200.0, -100.0]])
        scene = skmpm.Scene(bodies, cell=R / 4, periodic=box, friction=0.3)
        *_, state = skmpm.simulate(scene, dt=1e-4, until=6e-4, scheme=tight)
        forces.append(np.sort(np.hypot(*state.contacts.force))[-6:])
    assert forces[0][0] > 0.0
    np.testing.assert_allclose(forces[1], forces[0], rtol=1e-5)
