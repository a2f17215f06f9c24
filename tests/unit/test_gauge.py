"""The gauge condition of round bodies without friction, and Newton's method where stiff bodies rotate."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
import scipy.sparse as sp

import skmpm
from skmpm import linear
from skmpm.linear.corrected import without_added_mass
from skmpm.material import LinearElastic, NeoHookean
from skmpm.points import box, disc
from skmpm.scene import Body, Load, Scene, Support, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.algorithm import step
from skmpm.step.forces import DeadLoad
from skmpm.step.gauge import gauge_condition
from skmpm.step.initial_state import initial
from skmpm.step.scene_forces import external_force

R, CELL = 1e-3, 2e-4
GEL = NeoHookean(10e6, 0.45, 990.0)
CROSSING = R / float(np.sqrt((GEL.lame[0] + 2.0 * GEL.lame[1]) / GEL.density))  # [s]


def body(material=GEL, points=None, **options):
    return Body(disc((0.0, 0.0), R, spacing=0.74 * CELL) if points is None else points, material, **options)


def between_walls(speed, friction=0.0, **options):
    """A disc, off the nodes of its grid, that four walls approach."""
    points = disc((0.13 * CELL, 0.31 * CELL), R, spacing=0.74 * CELL)
    walls = []
    for n in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        at = np.array([0.13 * CELL, 0.31 * CELL]) - R * np.array(n)
        walls.append(Wall(at, n, velocity=speed * np.array(n, dtype=float), friction=friction))
    return Scene([Body(points, GEL, **options)], cell=CELL, walls=walls)


def spin(state):
    """Mean rotation rate of all points [rad/s]."""
    return float(np.average(0.5 * (state.C[1, 0] - state.C[0, 1]), weights=state.mass))


# --- the solver


def test_the_solver_on_the_gauge_is_that_of_the_saddle_point_problem():
    """Two bodies with the condition and one without it; against the bordered matrix."""
    rng = np.random.default_rng(0)
    sizes = [6, 8, 5]
    blocks = 2 * np.concatenate([[0], np.cumsum(sizes)])
    owner, n = np.repeat([0, 1, 2], sizes), 2 * sum(sizes)
    A, m = np.zeros((n, n)), np.zeros(n)
    for b, (begin, end) in enumerate(pairwise(blocks)):
        G = rng.normal(size=(end - begin, end - begin))
        A[begin:end, begin:end] = G @ G.T + np.eye(end - begin)
        m[begin:end] = rng.normal(size=end - begin) * (b < 2)
    inner, none = linear.direct(sp.bsr_array(A, blocksize=(2, 2)), blocks, None), np.zeros(3)
    solver = without_added_mass(inner, blocks, none, none, m)
    conditions = np.stack([m * (np.repeat(owner, 2) == b) for b in (0, 1)], axis=1)
    bordered = np.block([[A, conditions], [conditions.T, np.zeros((2, 2))]])
    b = rng.normal(size=(n, 4))
    wanted = np.linalg.solve(bordered, np.concatenate([b, np.zeros((2, 4))]))[:n]
    assert solver(b) == pytest.approx(wanted, abs=1e-11)
    assert solver(b[:, 0]) == pytest.approx(wanted[:, 0], abs=1e-11)
    rows = sp.csr_array(np.eye(n)[[0, 3, 5, 14, 20, 30]])
    assert solver.delassus(rows).toarray() == pytest.approx(rows @ solver(rows.T.toarray()), abs=1e-12)


# --- the bodies


@dataclass(frozen=True)
class Fibred:
    """NeoHookean with the energy of fibres along x."""

    E: float
    nu: float
    density: float

    def __getattr__(self, name):
        return getattr(NeoHookean(self.E, self.nu, self.density), name)

    def energy(self, F):  # noqa: D102
        return NeoHookean(self.E, self.nu, self.density).energy(F) + 1e5 * (F[0, 0] ** 2 + F[1, 0] ** 2 - 1.0) ** 2


@pytest.mark.parametrize(
    ("bodies", "options", "wanted"),
    [
        ([body()], {}, [True]),
        ([body(points=box((-R, -R), (R, R), spacing=0.74 * CELL))], {}, [False]),
        ([body(LinearElastic(10e6, 0.3, 990.0))], {}, [False]),
        ([body(NeoHookean(10e6, 0.45, 990.0, viscosity=1.0))], {}, [False]),
        ([body(Fibred(10e6, 0.45, 990.0))], {}, [False]),
        ([body()], {"friction": 0.1}, [False]),
        ([body(), body(points=disc((5.0 * R, 0.0), R, spacing=0.74 * CELL))], {}, [True, True]),
        ([body()], {"supports": [Support(lambda x: x[1] < -0.8 * R)]}, [False]),
        ([body()], {"loads": [Load(lambda x: x[1] < -0.8 * R, (0.0, 1.0))]}, [False]),
    ],
)
def test_bodies_that_can_turn_inside_their_shape(bodies, options, wanted):
    assert Scene(bodies, cell=CELL, **options).indifferent_to_rotation.tolist() == wanted


# --- what the condition does


def test_a_pressed_disc_without_friction_does_not_turn():
    """Compressed by 8 % in steps in which waves cross it 50 times; without the condition its grid turns it."""
    scene, dt = between_walls(0.08 * R / (40 * 50 * CROSSING)), 50 * CROSSING
    states = list(simulate(scene, dt=dt, until=40 * dt))
    assert max(abs(spin(s)) * s.report.dt for s in states) < 1e-4
    assert sum(s.report.retries for s in states) == 0
    assert abs(states[-1].wall_force[2, 0]) / (2.0 * R) > 0.02 * GEL.E


def test_a_disc_that_spins_between_plates_keeps_its_spin_in_short_steps():
    scene = between_walls(0.0, spin=30.0)
    state = list(simulate(scene, dt=0.2 * CROSSING, until=4.0 * CROSSING))[-1]
    assert spin(state) == pytest.approx(30.0, rel=1e-6)


def test_a_light_contact_in_a_long_step_takes_no_spin():
    """A slow spin by 9e-4 rad in the step, of a disc that touches four walls without force.

    Backward Euler would take half of the square of this angle from it.
    """
    dt = 20 * CROSSING
    scene = between_walls(0.0, spin=9e-4 / dt)
    assert spin(step(scene, initial(scene), dt)) == pytest.approx(9e-4 / dt, rel=1e-9)


def test_friction_leaves_the_rotation_to_the_contacts():
    """The same disc with friction at the walls, one of which slides: it turns."""
    squeezed = between_walls(0.02 * R / (10 * CROSSING), friction=0.5)
    floor = replace(squeezed.walls[0], velocity=np.array([0.02, 0.02]) * R / (10 * CROSSING))
    scene = replace(squeezed, walls=[floor, *squeezed.walls[1:]])
    state = step(scene, initial(scene), 10 * CROSSING)
    assert abs(spin(state)) * 10 * CROSSING > 1e-3


@pytest.mark.parametrize("dt", [2.0 * CROSSING, None])
def test_a_field_of_gravity_turns_a_disc_on_a_smooth_floor(dt):
    """Weight and a field a e_z x X of gravity: after t the disc has turned by a t^2 / 2 = 0.3.

    The condition held it still. Backward Euler turns it by a dt t / 2 too far.
    """
    until = 30.0 * CROSSING
    turning = 2.0 * 0.3 / until**2

    def gravity(x, t):
        return np.stack([-turning * x[1], turning * x[0] - 1e4])

    scene = Scene([body()], cell=CELL, walls=[Wall((0.0, -R), (0.0, 1.0))], gravity=gravity)
    assert scene.indifferent_to_rotation.all()
    *_, state = simulate(scene, dt=dt, until=until)
    angle = float(np.arctan2(*np.tensordot(state.F, state.mass, axes=1)[::-1, 0]))
    assert angle == pytest.approx(0.3, rel=0.12)


def test_a_uniform_field_that_varies_in_time_leaves_the_condition():
    """Its moment is round-off."""
    scene = replace(between_walls(0.0), gravity=lambda x, t: np.stack([0.0 * x[0], -9.81 * np.exp(-t) + 0.0 * x[1]]))
    state = initial(scene)
    v0 = np.zeros(state.displacement.size)
    dt, gravity = 20 * CROSSING, DeadLoad(external_force(scene, state, 0.0), None, v0)
    assert gauge_condition(scene, step(scene, state, dt), v0, [gravity], dt, Scheme()).bodies.all()


def test_a_rough_wall_that_hits_a_disc_within_a_long_step_turns_it():
    """On a smooth floor: the condition of the step before its first contact took away a third of its spin."""
    radius, gel = 0.02, NeoHookean(1e8, 0.3, 1000.0)
    hits = Wall((-radius - 1e-3, 0), (1, 0), velocity=(0.3, 2.0), friction=0.5)
    scene = Scene(
        [Body(disc((0.0, radius), radius, spacing=3e-3), gel)],
        cell=4e-3, walls=[Wall((0, 0), (0, 1)), hits], gravity=(0.0, -9.81),
    )  # fmt: skip
    *_, state = simulate(scene, dt=2e-3, until=0.02)
    speed = np.average(state.v[0], weights=state.mass)
    assert -spin(state) == pytest.approx(2.0 * 0.5 * speed / radius, rel=0.05)


# --- quasi-static steps


def squeezed(turn, **options):
    """Four walls, turned on the grid, close in on a disc by a tenth of its radius in 25 quasi-static steps."""
    c, s = np.cos(turn), np.sin(turn)
    centre = CELL * np.array([0.13, 0.31])
    normals = [np.array(n) for n in ((c, s), (-c, -s), (-s, c), (s, -c))]
    walls = [Wall(centre - R * n, n, velocity=R * n, **options) for n in normals]
    points = disc(tuple(centre), R, spacing=0.74 * CELL)
    scene = Scene([Body(points, GEL)], cell=CELL, walls=walls)
    return scene, list(simulate(scene, dt=0.004, until=0.1, scheme=Scheme(inertia=False)))


@pytest.mark.parametrize("turn", [0.0, 0.7, 1.3])
def test_a_quasi_static_disc_does_not_turn_inside_its_shape(turn):
    """Without the condition 300 iterations in the first of 25 steps, and 0.05 rad in one of them.

    The second step is solved twice, since the contacts become wide in it.
    """
    _, states = squeezed(turn)
    assert sum(state.report.retries for state in states) == 0
    iterations = [state.report.newton for state in states]
    assert sum(iterations) <= 60 and max(iterations) <= 6
    assert max(abs(spin(state)) for state in states) * 0.004 < 5e-4


def test_walls_with_friction_turn_quasi_static_discs():
    """One wall with friction: no condition, before or in contact."""
    scene, states = squeezed(0.0, friction=0.1)
    scheme = Scheme(inertia=False)
    assert scene.indifferent_to_rotation.all()
    for state in (initial(scene, scheme=scheme), states[-1]):
        assert gauge_condition(scene, state, np.zeros(state.displacement.size), (), 0.004, scheme) is None


def test_the_condition_bears_no_torque_that_the_continuum_has():
    """What it bears is the noise of the grid: less than 2 % of the virial 2 p V under quasi-static pressure."""
    scene, states = squeezed(0.7)
    state, force = states[-1], skmpm.network(scene, states[-1])
    arm = force.centre - np.average(state.x, axis=1, weights=state.mass)[:, None]
    torque = (arm[0] * force.force_xy[1] - arm[1] * force.force_xy[0]).sum()
    virial = -(arm * force.force_xy).sum()
    assert virial > 0.0 and abs(torque) < 0.02 * virial


# --- stiff bodies that rotate


@pytest.mark.parametrize("angle", [0.01, 0.05, 0.2])
def test_a_stiff_body_that_spins_takes_four_iterations(angle):
    """Steps in which waves cross it 1e5 times: the stress of a linear rotation exceeds inertia 1e7 times.

    Combined with earlier iterates (Anderson acceleration) it took 16.
    """
    scene = Scene([body(spin=1.0)], cell=CELL)
    state = initial(scene)
    for _ in range(3):
        state = step(scene, state, angle)
        assert state.report.newton <= 4
    assert np.abs(state.volume / scene.initial_volumes - 1.0).max() < 1e-9


def test_quadratic_convergence_is_kept_under_rotation():
    """To 1e-10 at most two iterations more than to 1e-3."""
    scene = Scene([body(spin=1.0)], cell=CELL)
    loose, tight = (step(scene, initial(scene), 0.05, scheme=Scheme(newton_tol=tol)) for tol in (1e-3, 1e-10))
    assert tight.report.newton <= loose.report.newton + 2
