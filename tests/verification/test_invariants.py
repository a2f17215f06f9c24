"""Invariants of a step for every scheme: momentum, action and reaction, energy, rigid motion, the solution.

Every tolerance is either round-off (1e-12 of the largest term) or the tolerance that the scheme was given.
"""

from dataclasses import replace
from functools import partial
from importlib import import_module

import numpy as np
import pytest

from skmpm import linear
from skmpm.material import LinearElastic, NeoHookean, Rigid
from skmpm.points import box, disc
from skmpm.scene import Body, Scene, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.algorithm import step
from skmpm.step.derived import bulk_of
from skmpm.step.initial_state import initial
from skmpm.step.regrid import regridded_state

SOFT, LINEAR = NeoHookean(1e6, 0.3, 1000.0), LinearElastic(1e6, 0.3, 1000.0)
STIFF = NeoHookean(1e8, 0.3, 1000.0)
R, CELL, DT = 1e-3, 0.25e-3, 1e-5


def round_body(centre, material=SOFT, radius=R, **motion):
    return Body(disc(centre, radius, spacing=CELL / 2), material, **motion)


def collision(first=SOFT, second=SOFT, friction=0.5):
    """Two discs that hit each other off centre at 3 m/s, spinning, and separate again."""
    bodies = [
        round_body((0, 0), first, velocity=(2.0, 0.3), spin=300.0),
        round_body((2.02 * R, 0.3 * R), second, 0.9 * R, velocity=(-1.0, 0.0)),
    ]
    return Scene(bodies, cell=CELL, friction=friction)


def squeeze(velocity=(0.0, -2.0)):
    """Two discs, one upon the other and beside its top, between a floor and a lid that comes down."""
    rise = np.sqrt(4 - 0.3**2) * R
    walls = [Wall((0, 0), (0, 1), friction=0.5), Wall((0, 2 * R + rise), (0, -1), velocity=velocity, friction=0.3)]
    return Scene([round_body((0, R)), round_body((0.3 * R, R + rise))], cell=CELL, walls=walls, friction=0.4)


def momentum(state):
    return state.v @ state.mass


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def cartesian(contacts):
    """Forces (2, k) on the first bodies, in x and y."""
    tangent = np.stack([-contacts.normal[1], contacts.normal[0]])
    return contacts.force[0] * contacts.normal + contacts.force[1] * tangent


MOMENTUM = {
    "banded": ({"linear": linear.banded}, 1e-12),
    "direct": ({"linear": linear.direct}, 1e-12),
    "amg": ({"linear": partial(linear.amg, tol=1e-8)}, 1e-8),
    "midpoint": ({"theta": 0.5}, 1e-12),
    "anchored anew": ({"anchor": 0.0}, 1e-12),
    "seed": ({"anchor": 0.0, "contact": Scheme.nezamabadi2017().contact}, 1e-12),
}


@pytest.mark.parametrize(("options", "tolerance"), MOMENTUM.values(), ids=MOMENTUM.keys())
def test_linear_momentum_of_a_free_scene_is_kept(options, tolerance):
    """Through a frictional collision of two free bodies, to 1e-12 of the sum of |m v| (amg: to its tolerance).

    Contact impulses enter as r and -r, internal forces sum to zero because the shape functions sum to one.
    """
    scene, scheme = collision(), Scheme(**options)
    state = initial(scene, scheme=scheme)
    before, scale = momentum(state), np.abs(state.v * state.mass).sum()
    pushed = np.zeros(2)
    for state in simulate(scene, dt=DT, until=24 * DT, scheme=scheme):
        assert np.abs(momentum(state) - before).max() <= tolerance * scale
        if state.contacts.gap.size:
            pushed = np.maximum(pushed, np.abs(state.contacts.force).max(axis=1))
    assert pushed.min() > 1.0  # they did collide, with friction


@pytest.mark.parametrize(
    "materials", [(SOFT, SOFT), (SOFT, LINEAR), (LINEAR, LINEAR)], ids=["soft", "mixed", "linear"]
)
def test_contact_forces_are_what_changes_the_momentum_of_each_body(materials):
    """Free bodies: dt times the contact forces on each, to the tolerance of Newton's method (1e-6)."""
    scene = collision(*materials)
    state, largest = initial(scene), 0.0
    for new in simulate(scene, dt=DT, until=16 * DT):
        force = cartesian(new.contacts)
        largest = max(largest, np.abs(force).max(initial=0.0))
        for b in (0, 1):
            own, on = new.body == b, new.contacts.bodies == b
            change = (new.v[:, own] - state.v[:, own]) @ new.mass[own]
            pushed = DT * (force[:, on[0]].sum(axis=1) - force[:, on[1]].sum(axis=1))
            assert np.abs(change - pushed).max() <= 1e-5 * np.abs(new.v[:, own] * new.mass[own]).sum()
        state = new
    assert largest > 10.0


def test_forces_on_walls_are_those_of_the_contacts_and_change_the_momentum():
    """To round-off, and to Newton's tolerance."""
    scene = squeeze()
    state = initial(scene)
    for new in simulate(scene, dt=DT, until=12 * DT):
        force = cartesian(new.contacts)
        for i in (0, 1):
            on = new.contacts.bodies[1] == -1 - i
            assert np.allclose(new.wall_force[i], -force[:, on].sum(axis=1), rtol=1e-13, atol=1e-13)
        change = momentum(new) - momentum(state)
        size = DT * np.abs(force).sum()
        assert np.abs(change + DT * new.wall_force.sum(axis=0)).max() <= 1e-5 * size
        state = new
    assert new.wall_force[1, 1] > 5.0 > -5.0 > new.wall_force[0, 1]


@pytest.mark.parametrize("material", [SOFT, LINEAR], ids=["soft", "linear"])
def test_rigid_translation_gives_no_force(material):
    """To round-off of the stiffness times the displacement, by hundreds of radii."""
    scene = Scene([round_body((0, 0), material)], cell=CELL)
    state = initial(scene)
    bulk = bulk_of(scene, state, Scheme())
    displacement = np.tile([0.3, -0.7], state.displacement.size // 2)
    assert np.abs(bulk.force(bulk.at(displacement))).max() <= 1e-12 * material.E * 0.7


@pytest.mark.parametrize("bodies", [1, 2])
@pytest.mark.parametrize(("material", "speed"), [(SOFT, 1.0), (SOFT, 50.0), (LINEAR, 50.0), (STIFF, 1.0)], ids=str)
def test_free_flight_stays_without_stress_and_never_stops(material, speed, bodies):
    """Nothing but round-off is left of the balance of momentum, and it must not count as an imbalance."""
    discs = [round_body((0, 3 * i * R), material, velocity=(speed, -speed)) for i in range(bodies)]
    scene = Scene(discs, cell=CELL, gravity=(0.0, -9.81))
    *_, state = simulate(scene, dt=DT, until=30 * DT)
    assert np.abs(state.stress).max() <= 1e-11 * material.E
    assert state.report.newton <= 2


@pytest.mark.parametrize("angle", [0.01, 1.0, 3.0])
def test_rigid_rotation_gives_no_force_and_no_false_stress_neohookean(angle):
    """Turned as it is, and turned once more after its body grids were built anew; to round-off."""
    scene = Scene([round_body((0.3 * R, 0.1 * R))], cell=CELL)
    state = initial(scene)
    turn = rotation(angle)
    turned = replace(
        state,
        x=turn @ state.x,
        F=np.einsum("ij,jkp->ikp", turn, state.F),
        displacement=np.zeros(0),
        derived=None,
    )
    for at in (state, regridded_state(scene, turned, Scheme())[0]):
        bulk, position = bulk_of(scene, at, Scheme()), at.derived.assembly.grid.position
        there = bulk.at(((turn - np.eye(2)) @ position).T.ravel())
        assert np.abs(bulk.force(there)).max() <= 1e-12 * SOFT.E * R
        assert np.abs(bulk.cauchy(there)).max() <= 1e-12 * SOFT.E
        assert abs(bulk.energy(there)) <= 1e-12 * SOFT.E * R**2


def test_a_spinning_disc_turns_without_false_stress():
    """By 0.9 rad in 90 steps: only the stress of the centrifugal force, rho omega^2 R^2 = 250 Pa of E = 1 MPa.

    Twice that, because it sets in at once; a strain that saw the rotation would give 400 kPa.
    """
    scene = Scene([round_body((0, 0), spin=500.0)], cell=CELL)
    *_, state = simulate(scene, dt=2 * DT, until=180 * DT, scheme=Scheme(theta=0.5))
    angle = np.arctan2(state.F[1, 0] - state.F[0, 1], state.F[0, 0] + state.F[1, 1])
    assert np.allclose(angle, 0.9, rtol=0, atol=2e-3)
    assert np.abs(state.stress).max() < 2.0 * 1000.0 * (500.0 * R) ** 2


def test_linear_elasticity_sees_a_false_strain_in_rotation():
    """cos(angle) - 1 in both directions, as its documentation says."""
    scene = Scene([round_body((0, 0), LINEAR)], cell=CELL)
    state = initial(scene)
    bulk, angle = bulk_of(scene, state, Scheme()), 0.1
    turn = rotation(angle)
    stress = bulk.cauchy(bulk.at(((turn - np.eye(2)) @ state.derived.assembly.grid.position).T.ravel()))
    lam, mu = LINEAR.lame
    false = 2.0 * (lam + mu) * (np.cos(angle) - 1.0)
    assert np.allclose(stress, false * np.eye(2)[:, :, None], rtol=0, atol=1e-9 * LINEAR.E)


def test_amg_banded_direct_give_the_same_step():
    """Two discs between walls with friction, twelve steps: equal to the solvers' tolerance."""
    scene, states = squeeze(), {}
    for name in ("banded", "direct", "amg"):
        *_, states[name] = simulate(scene, dt=DT, until=12 * DT, scheme=Scheme(linear=getattr(linear, name)))
    assert states["direct"].contacts.force.shape[1] >= 10
    for field in ("x", "v", "F", "stress", "wall_force"):
        exact = getattr(states["direct"], field)
        for name, tolerance in (("banded", 1e-11), ("amg", 1e-9)):
            assert np.abs(getattr(states[name], field) - exact).max() <= tolerance * np.abs(exact).max(), (
                field,
                name,
            )


class Counting:
    """A linear solver that counts its factorisations and solves."""

    def __init__(self):
        self.factorised = self.solved = 0

    def __call__(self, A, blocks, rigid_motions):  # noqa: D102
        self.factorised += 1
        return CountingSolver(self, linear.banded(A, blocks, rigid_motions))


class CountingSolver:
    """The solver it makes."""

    name = "counting"

    def __init__(self, count, solver):
        self.count, self.delassus, self._solver = count, solver.delassus, solver

    def __call__(self, b):  # noqa: D102
        self.count.solved += 1
        return self._solver(b)


def test_a_linear_material_factorises_once_for_as_long_as_dt_and_anchor_stay():
    scene, count = collision(LINEAR, LINEAR), Counting()
    scheme = Scheme(linear=count)
    states = list(simulate(scene, dt=DT, until=10 * DT, scheme=scheme))
    assert sum(state.report.factorisations for state in states) == count.factorised == 1
    state = step(scene, states[-1], DT / 2, scheme=scheme)
    assert count.factorised == 2
    state = step(scene, state, DT / 2, scheme=scheme)
    assert count.factorised == 2
    step(scene, state, DT / 2, scheme=replace(scheme, theta=0.5))
    assert count.factorised == 3
    step(scene, replace(state, derived=None, factored=None), DT / 2, scheme=scheme)
    assert count.factorised == 4
    step(scene, state, DT / 2, scheme=replace(scheme, anchor=0.0))
    assert count.factorised == 5


@pytest.mark.parametrize("change", ["modulus", "ghost", "modulus without ghost", "material of one body"])
def test_a_factor_is_not_kept_for_another_scene_or_scheme(change):
    """The step from a state does not depend on what was kept for speed with it."""
    scene, scheme = collision(LINEAR, LINEAR), Scheme(ghost=0.0 if change.endswith("without ghost") else 0.005)
    state = step(scene, initial(scene, scheme=scheme), DT, scheme=scheme)
    if change == "ghost":
        scheme = Scheme(ghost=0.5)
    else:
        stiff = LinearElastic(4e6, 0.3, 1000.0)
        scene = collision(stiff, LINEAR if change == "material of one body" else stiff)
    kept, fresh = step(scene, state, DT, scheme=scheme), step(scene, replace(state, derived=None), DT, scheme=scheme)
    assert np.array_equal(kept.v, fresh.v)
    assert np.array_equal(kept.stress, fresh.stress)


def test_a_single_free_linear_body_does_exactly_one_solve_per_step():
    count = Counting()
    scene = Scene([round_body((0, 0), LINEAR, velocity=lambda x: 1e3 * x)], cell=CELL, gravity=(0, -9.81))
    *_, state = simulate(scene, dt=DT, until=7 * DT, scheme=Scheme(linear=count))
    assert (count.factorised, count.solved, state.report.newton) == (1, 7, 1)


def test_zero_gravity_forms_nothing(monkeypatch):
    def never(*arguments):
        raise AssertionError("gravity was formed")

    monkeypatch.setattr(import_module("skmpm.step.scene_forces"), "gravity_at", never)
    still, falling = (Scene([round_body((0, 0))], cell=CELL, gravity=g) for g in ((0, 0.0), (0.0, -1e-9)))
    step(still, initial(still), DT)
    with pytest.raises(AssertionError, match="gravity was formed"):
        step(falling, initial(falling), DT)


def total(energy):
    return energy.kinetic + energy.elastic + energy.dissipated - energy.external - energy.push_out - energy.regridding


SCHEMES = {"default": Scheme(), "midpoint": Scheme(theta=0.5), "anchored anew": Scheme(anchor=0.0)}


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES.keys())
@pytest.mark.parametrize("material", [SOFT, LINEAR], ids=["soft", "linear"])
def test_the_energy_budget_closes(material, scheme):
    """Kinetic + elastic + dissipated - external - push-out - relaid is constant to round-off, with walls and gravity.

    And each share is what it is: kinetic at least that of the points (of the nodes, whose velocities the points
    average), external the work of lid and gravity; nothing dissipated is negative but for the error of the midpoint
    rule in a nonlinear material, 7e-4 of the work in the first step, in which the contacts stick.
    """
    walls = [Wall((0, 0), (0, 1), friction=0.5), Wall((0, 2 * R), (0, -1), velocity=(0.2, -1.0), friction=0.5)]
    gravity = np.array([0.0, -1000.0])
    scene = Scene([round_body((0, R), material)], cell=CELL, walls=walls, gravity=gravity)
    state = initial(scene, scheme=scheme)
    begin, given, largest, gain = total(state.report.energy), 0.0, 0.0, 1e-6 if scheme.theta == 1.0 else 1e-3
    for new in simulate(scene, dt=DT, until=20 * DT, scheme=scheme):
        energy = new.report.energy
        largest = max(largest, energy.external)
        assert abs(total(energy) - begin) <= 1e-12 * largest
        given += DT * float(-new.wall_force[1] @ [0.2, -1.0])
        given += float(gravity @ ((new.x - state.x) @ new.mass))
        assert energy.external == pytest.approx(given, rel=1e-6, abs=1e-9)
        points = 0.5 * float(new.mass @ (new.v**2).sum(axis=0))
        assert points * (1.0 - 1e-12) <= energy.kinetic <= 2.0 * points
        assert energy.dissipated >= state.report.energy.dissipated - gain * largest
        state = new
    assert (energy.regridding != 0.0) == (scheme.anchor == 0.0)
    assert energy.elastic > 0.5 * energy.external


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_no_energy_is_gained_in_a_collision(friction):
    """Backward Euler: kinetic + elastic never exceeds what it was plus external work and push-out, step by step."""
    scene = collision(friction=friction)
    state = initial(scene)
    start = state.report.energy.kinetic
    for new in simulate(scene, dt=DT, until=30 * DT):
        was, now = state.report.energy, new.report.energy
        assert now.dissipated >= was.dissipated - 1e-6 * start
        assert now.kinetic + now.elastic <= start + now.push_out + 1e-6 * start
        assert now.push_out <= 1e-4 * start
        assert now.external == 0.0
        state = new
    assert new.contacts.force[0].max(initial=0.0) == 0.0  # apart again
    assert 0.3 * start < now.kinetic < 0.9 * start


def pushed(points, velocity, material):
    """A disc, another behind it, and a rigid body that comes from the right."""
    first, behind = (SOFT, LINEAR) if material is SOFT else (LINEAR, SOFT)
    bodies = [
        round_body((0, 0), first),
        Body(points, Rigid(1.0), motion=lambda t: (*velocity(t), 0.0)),
        round_body((-2 * R, 0), behind),
    ]
    return Scene(bodies, cell=CELL, friction=0.3)


OBSTACLES = {
    "disc": disc((2 * R, 0), R, spacing=CELL / 2),
    "finer disc": disc((2 * R, 0), R, spacing=CELL / 4),
    "box": box((R, -R), (R, 2 * R), spacing=CELL / 2),
}


@pytest.mark.parametrize("points", OBSTACLES.values(), ids=OBSTACLES.keys())
@pytest.mark.parametrize("material", [SOFT, LINEAR], ids=["soft", "linear"])
def test_a_rigid_body_moves_as_prescribed_and_exerts_equal_and_opposite_forces(points, material):
    """LinearElastic, NeoHookean and Rigid in one scene; the pusher accelerates, v(t) = (-1 - a t, 0.5).

    Its path is exact to round-off, because the midpoint rule integrates a linear velocity exactly; the force of its
    contacts is what changes the others' momentum, to Newton's tolerance.
    """
    a = 2e4
    scene = pushed(points, lambda t: (-1.0 - a * t, 0.5), material)
    state = initial(scene)
    for new in simulate(scene, dt=DT / 2, until=16 * DT / 2):
        t, own = new.t, new.body == 1
        path = np.array([-t - 0.5 * a * t**2, 0.5 * t])
        assert np.allclose(new.x[:, own], points.x + path[:, None], rtol=0, atol=1e-15)
        assert np.allclose(new.v[:, own], [[-1.0 - a * t], [0.5]], rtol=1e-14)
        assert not new.stress[:, :, own].any()
        bodies, force = new.contacts.bodies, cartesian(new.contacts)
        on_rigid = force[:, bodies[0] == 1].sum(axis=1) - force[:, bodies[1] == 1].sum(axis=1)
        change = (new.v - state.v)[:, ~own] @ new.mass[~own] / (DT / 2)
        assert np.abs(change + on_rigid).max() <= 1e-5 * np.abs(force).sum()
        state = new
    assert on_rigid[0] > 20.0 and on_rigid[1] < -1.0  # pushed back, and dragged by friction


def test_a_rigid_body_with_constant_velocity_pushes_as_a_wall_does():
    """A rigid box in place of a wall: the same force and the same disc, to the tolerance of the steps (1e-5).

    The box is coarser than the disc, so that it is the disc's boundary points that touch in both.
    """
    box_body = Body(box((R, -3 * R), (R, 6 * R), spacing=CELL), Rigid(1.0), motion=(-2.0, 0.0, 0.0))
    wall = Wall((R, 0), (-1, 0), velocity=(-2.0, 0.0))
    floor = Wall((-R, 0), (1, 0))
    with_box = Scene([round_body((0, 0)), box_body], cell=CELL, walls=[floor])
    with_wall = Scene([round_body((0, 0))], cell=CELL, walls=[floor, wall])
    *_, one = simulate(with_box, dt=DT, until=15 * DT)
    *_, other = simulate(with_wall, dt=DT, until=15 * DT)
    n = with_wall.offsets[-1]
    bodies, force = one.contacts.bodies, cartesian(one.contacts)
    on_box = force[0, bodies[0] == 1].sum() - force[0, bodies[1] == 1].sum()
    assert on_box > 20.0
    assert on_box == pytest.approx(other.wall_force[1, 0], rel=1e-4)
    assert np.abs(one.x[:, :n] - other.x).max() <= 1e-6 * CELL
