"""Steps are pure functions, runs end at `until`, and motions agree with closed forms of the time scheme."""

import re
import signal
from dataclasses import fields, is_dataclass, replace
from importlib import import_module
from itertools import pairwise

import numpy as np
import pytest

import skmpm
from skmpm.io import load, save
from skmpm.material import LinearElastic, NeoHookean, Yeoh
from skmpm.points import Points, box, disc
from skmpm.scene import Body, Load, Scene, SceneError, StepFailed, Support, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial

SOFT, LINEAR = NeoHookean(1e6, 0.3, 1000.0), LinearElastic(1e6, 0.3, 1000.0)
R, CELL, DT = 1e-3, 0.25e-3, 2.0**-17


def round_body(centre=(0.0, 0.0), material=LINEAR, radius=R, **motion):
    return Body(disc(centre, radius, spacing=CELL / 2), material, **motion)


def free(material=LINEAR, gravity=(0.0, 0.0), **motion):
    return Scene([round_body(material=material, **motion)], cell=CELL, gravity=gravity)


def squeeze(material=SOFT, speed=1.0, friction=0.4):
    """A disc between a floor and a lid, another one beside it."""
    walls = [Wall((0, -R), (0, 1), friction=friction), Wall((0, R), (0, -1), velocity=(0, -speed))]
    bodies = [round_body((0, 0), material), round_body((2 * R, 0), material)]
    return Scene(bodies, cell=CELL, walls=walls, friction=friction)


def flat(thing, name="state", left_out=("derived", "seconds")):
    """All numbers of a state by name, copied; without what is kept for speed and the clock."""
    if is_dataclass(thing):
        parts = [(f.name, getattr(thing, f.name)) for f in fields(thing) if f.name not in left_out]
        return {k: v for part, value in parts for k, v in flat(value, f"{name}.{part}").items()}
    return {name: np.array(thing)}


def identical(one, other):
    ours, theirs = flat(one), flat(other)
    assert ours.keys() == theirs.keys()
    for name, value in ours.items():
        assert np.array_equal(value, theirs[name]), name


# --- steps and runs


@pytest.mark.parametrize(
    ("dt", "until"), [(1e-5, 5e-5), (1e-5, 4.3e-5), (3e-6, 1e-4), (1e-3, 1e-4), (1e-5, 3e-5), (1e-6, 7.7e-6)]
)
def test_a_run_ends_exactly_at_until_with_a_shortened_last_step(dt, until):
    states = list(simulate(free(velocity=(1.0, 0.0)), dt=dt, until=until))
    times = np.array([0.0, *(state.t for state in states)])
    assert times[-1] == until
    steps = np.diff(times)
    assert len(steps) == int(np.ceil(until / dt * (1 - 1e-9)))
    assert np.allclose(steps[:-1], dt, rtol=1e-9)
    assert 0.01 * dt < steps[-1] <= dt * (1 + 1e-9)
    moved = states[-1].x - free().bodies[0].points.x
    assert np.allclose(moved, [[until], [0.0]], rtol=0, atol=1e-9 * until)


def test_the_rounding_of_many_steps_adds_no_sliver_of_a_step():
    """A million steps of 1e-7 s may sum to 0.1 s - 1e-17 s, or to a little more than a step less."""
    scene = free()
    start = initial(scene)
    for missing, count in ((1e-17, 0), (0.999999999999e-7, 1), (1.000000000001e-7, 1), (1.5e-7, 2)):
        states = list(simulate(scene, dt=1e-7, until=0.1, start=replace(start, t=0.1 - missing)))
        assert len(states) == count
        assert not states or states[-1].t == 0.1


@pytest.mark.parametrize("dt", [0.0, -1e-6, np.nan, np.inf, None, "1e-6", 0])
def test_a_time_step_that_is_none_is_refused(dt):
    scene = free()
    with pytest.raises(ValueError, match=r"step: dt = .*greater than zero, finite and in seconds"):
        step(scene, initial(scene), dt)
    if dt is not None:  # then `simulate` chooses the steps
        with pytest.raises(ValueError, match=r"simulate: dt = .*greater than zero, finite and in seconds"):
            list(simulate(scene, dt=dt, until=1.0))


@pytest.mark.parametrize("until", [np.nan, None, -1.0, np.inf])
def test_an_end_that_is_none_is_refused(until):
    with pytest.raises(ValueError, match=r"simulate: until = "):
        list(simulate(free(), dt=1e-5, until=until))


def test_an_end_before_the_start_is_refused_and_at_the_start_nothing_is_left_to_do():
    scene = free()
    *_, start = simulate(scene, dt=1e-5, until=3e-5)
    with pytest.raises(ValueError, match=r"until = 2e-05 s lies before start, at t = 3e-05 s; .* add start\.t"):
        simulate(scene, dt=1e-5, until=2e-5, start=start)
    assert not list(simulate(scene, dt=1e-5, until=3e-5, start=start))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scheme": "fast"}, r"scheme = 'fast'; give a Scheme, as skmpm.Scheme.fast\(\)"),
        ({"start": "run.chk"}, r"start: expected a State, got 'run.chk'; use one, as returned by skmpm.load\(path\)"),
    ],
)
def test_what_is_no_scheme_and_no_state_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        simulate(free(), dt=1e-5, until=1e-4, **options)


def test_a_step_and_the_initial_state_refuse_the_same():
    one, two = free(), Scene([round_body(), round_body((3 * R, 0.0))], cell=CELL)
    with pytest.raises(SceneError, match=r"step: the state has .* points, the scene"):
        step(two, initial(one), 1e-5)
    with pytest.raises(ValueError, match="step: scheme = 'fast'; give a Scheme"):
        step(one, initial(one), 1e-5, scheme="fast")
    with pytest.raises(ValueError, match="initial: scheme = 'fast'; give a Scheme"):
        initial(one, scheme="fast")


@pytest.mark.parametrize("field", ["x", "v", "F", "C"])
def test_a_state_that_is_not_finite_is_refused(field):
    """Solvers did not converge, and recommended a smaller dt."""
    scene = free()
    state = initial(scene)
    values = getattr(state, field).copy()
    values[..., 3] = np.nan
    with pytest.raises(SceneError, match=f"start: {field} of the state has values that are not finite"):
        simulate(scene, dt=1e-5, until=1e-4, start=replace(state, **{field: values}))


def test_a_handler_of_sigterm_that_is_set_during_a_run_stays(tmp_path):
    before, own = signal.getsignal(signal.SIGTERM), lambda *_: None
    states = simulate(free(), dt=1e-5, until=3e-5, checkpoint=tmp_path / "run.chk")
    next(states)
    try:
        signal.signal(signal.SIGTERM, own)
        list(states)
        assert signal.getsignal(signal.SIGTERM) is own
    finally:
        signal.signal(signal.SIGTERM, before)


def test_a_checkpoint_that_cannot_be_written_is_refused_before_the_run(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"there is no directory .*none; create it first"):
        simulate(free(), dt=1e-5, until=1e-4, checkpoint=tmp_path / "none" / "run.chk")
    with pytest.raises(IsADirectoryError, match=r"is a directory; give a file in it"):
        simulate(free(), dt=1e-5, until=1e-4, checkpoint=tmp_path)


def test_changes_of_a_state_or_of_the_arrays_bodies_were_made_from_do_not_change_the_scene():
    """Positions in millimetres for a plot; one buffer for all bodies."""
    points = disc((0.0, 0.0), R, spacing=0.5 * CELL)
    buffer = points.x.copy()
    scene = Scene([Body(Points(buffer, points.volume, points.outline), LINEAR)], cell=CELL)
    buffer += 3.0 * R
    x = initial(scene).x
    x *= 1e3
    np.testing.assert_array_equal(initial(scene).x, points.x)


SCHEMES = {
    "default": Scheme(),
    "midpoint": Scheme(theta=0.5),
    "updated Lagrangian": Scheme(anchor=0.0),
    "anchored at a bound": Scheme(anchor=0.005),
    "nezamabadi2017": Scheme.nezamabadi2017(),
}


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES.keys())
def test_a_step_is_pure_and_yields_a_new_object(scheme):
    """The state given is the same afterwards, to the bit."""
    scene = squeeze()
    state = initial(scene, scheme=scheme)
    for _ in range(3):
        copy = flat(state)
        new = step(scene, state, DT, scheme=scheme)
        assert new is not state
        assert new.t == state.t + DT
        for name, value in flat(state).items():
            assert np.array_equal(value, copy[name]), name
        for name in ("x", "v", "F", "C", "stress"):
            assert not np.shares_memory(getattr(new, name), getattr(state, name)), name
        state = new


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES.keys())
def test_a_run_is_deterministic(scheme):
    """The same input gives the same output, to the bit, whether factors were kept or not."""
    scene = squeeze(LINEAR)
    *_, one = simulate(scene, dt=DT, until=6 * DT, scheme=scheme)
    *_, other = simulate(squeeze(LINEAR), dt=DT, until=6 * DT, scheme=scheme)
    identical(one, other)
    again = step(scene, one, DT, scheme=scheme)
    identical(again, step(scene, one, DT, scheme=scheme))


@pytest.mark.parametrize("material", [SOFT, LINEAR], ids=["soft", "linear"])
def test_start_continues_a_run(material, tmp_path):
    """Cut in two, and cut in two with a file in between: to the bit."""
    scene = squeeze(material)
    states = list(simulate(scene, dt=DT, until=8 * DT))
    *_, half = simulate(scene, dt=DT, until=4 * DT)
    identical(half, states[3])
    *_, end = simulate(scene, dt=DT, until=8 * DT, start=half)
    identical(end, states[-1])
    save(tmp_path / "half", half)
    *_, end = simulate(scene, dt=DT, until=8 * DT, start=load(tmp_path / "half"))
    identical(end, states[-1])
    assert list(simulate(scene, dt=DT, until=8 * DT, start=end)) == []


def test_the_state_at_t_0_holds_the_contacts_there():
    """Not those to which moving walls and bodies will come: gaps below a quarter of a cell, none without."""
    walls = [Wall((0, -R), (0, 1)), Wall((0, 2 * R), (0, -1), velocity=(0, -2.0))]
    near = round_body((2 * R + 0.1 * CELL, 0), velocity=(-50.0, 0.0))
    far = round_body((0, -R + 9 * R), velocity=(0.0, -50.0))
    scene = Scene([round_body((0, 0)), near], cell=CELL, walls=walls)
    contacts = initial(scene).contacts
    found = set(map(tuple, np.sort(contacts.bodies, axis=0).T.tolist()))
    assert found == {(0, 1), (-1, 0), (-1, 1)}
    assert contacts.gap.min() >= -1e-9 * CELL
    assert contacts.gap.max() < 0.25 * CELL
    assert not contacts.force.any()
    assert initial(Scene([round_body((0, 0)), far], cell=CELL)).contacts.gap.size == 0


# --- failures and checkpoints


@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize("overlap", [0.0, 1e-12])
def test_bodies_that_overlap_by_rounding_rest(friction, overlap):
    """Boxes side by side, i L + L being more than (i + 1) L for some i, or by 1e-12 R: nothing is pushed away."""
    side = 0.01
    bodies = [
        Body(box((i * side - overlap * i * R, 0.0), (side, side), spacing=side / 10), NeoHookean(1e6, 0.3, 1e3))
        for i in range(7)
    ]
    scene = Scene(bodies, cell=side / 6, friction=friction)
    states = list(simulate(scene, dt=1e-4, until=2e-3))
    assert sum(state.report.retries for state in states) == 0
    assert np.abs(states[-1].v).max() <= 10.0 * (overlap * R + 1e-16) / 1e-4


def test_a_failed_step_gives_back_the_very_state_it_was_given():
    scene = squeeze(speed=5.0)
    for scheme in (Scheme(max_newton=1), Scheme(max_newton=1, anchor=0.0)):
        state = step(scene, initial(scene), 1e-7)
        with pytest.raises(StepFailed) as failure:
            step(scene, state, 1e-5, scheme=scheme)
        assert failure.value.state is state


def test_a_linear_solver_that_gives_up_is_a_failed_step():
    class Tired:
        name = "tired"

        def __call__(self, b):
            raise np.linalg.LinAlgError("no more iterations")

    scene = free(velocity=(1.0, 0.0))
    for scheme in (Scheme(linear=lambda A, blocks, motions: Tired()), Scheme(linear=indefinite)):
        with pytest.raises(StepFailed, match=r"no more iterations|not positive definite"):
            step(scene, initial(scene), DT, scheme=scheme)


def test_too_few_points_are_named_where_the_matrix_is_not_positive_definite():
    """At t = 0, undeformed, without inertia: no smaller dt would help."""
    turn = np.array([[np.sqrt(0.75), -0.5], [0.5, np.sqrt(0.75)]])
    block, corner = box((0, 0), (10.0, 10.0), spacing=1.5), np.array([[0.3], [0.37]])
    points = Points(turn @ block.x + corner, block.volume, block.outline)
    held = Support(lambda x: turn[:, 1] @ (x - corner) < 0.01)
    scene = Scene([Body(points, SOFT)], cell=1.0, supports=[held], gravity=(0.0, -1e-3))
    message = (
        r"body 0: its matrix is not positive definite, .*; \d\d of its \d\d cells hold one point, which leaves"
        r" motions without stiffness; use a smaller spacing of its points, a larger cell"
    )
    with pytest.raises(StepFailed, match=message):
        step(scene, initial(scene), 1.0, scheme=Scheme(inertia=False))


def test_a_body_that_softens_is_not_said_to_have_too_few_points():
    """The place with the largest stretches is named: they are beyond the stretch at which its law has a peak."""
    soft = Yeoh(c10=1e5, c20=-5e4, c30=0.0, bulk=1e6, density=1000.0)
    held = [Support(lambda x: x[1] < 0.11), Support(lambda x: x[1] > 0.89, velocity=(0.0, 1.0))]
    scene = Scene([Body(box((0, 0), (1.0, 1.0), spacing=0.1), soft)], cell=0.2, supports=held)
    says = r"body 0 near \((\S+), (\S+)\) m: its matrix is not positive definite as it is deformed, with stretches of"
    with pytest.raises(StepFailed, match=says + r" (\S+) and (\S+) here; use a law that does not soften") as failure:
        skmpm.run(scene, dt=0.05, until=0.5, scheme=Scheme(inertia=False), warn=False)
    x, y, least, most = map(float, re.search(says + r" (\S+) and (\S+)", str(failure.value)).groups())
    assert np.hypot(*(failure.value.state.x - [[x], [y]])).min() < np.sqrt(2.0) * scene.cell
    assert least < 0.7 and most > 1.4


def indefinite(A, blocks, motions):
    raise np.linalg.LinAlgError("not positive definite")


def test_a_checkpoint_is_written_at_the_end_and_now_and_then(tmp_path, monkeypatch):
    path, scene = tmp_path / "run", free(velocity=(1.0, 0.0))

    def run():
        for state in simulate(scene, dt=DT, until=6 * DT, checkpoint=path):
            yield state, load(path).t / DT if path.exists() else 0

    states, written = zip(*run(), strict=True)
    assert written == (0,) * 6
    identical(load(path), states[-1])
    path.unlink()
    monkeypatch.setattr(import_module("skmpm.simulation"), "CHECKPOINT_EVERY", 0.0)
    _, written = zip(*run(), strict=True)
    assert written == (1, 2, 3, 4, 5, 6)


# --- closed forms in discrete time


@pytest.mark.parametrize("theta", [1.0, 0.5, 0.7])
@pytest.mark.parametrize("kind", ["constant", "field"])
def test_free_fall_follows_the_theta_rule_to_round_off(theta, kind):
    """v_n = v_0 + g t_n, x_n = x_0 + v_0 t_n + g t_n^2 / 2 + (theta - 1/2) g dt t_n: backward Euler to exact."""
    g, v0 = np.array([3.0, -9.81]), np.array([0.4, 1.0])
    gravity = g if kind == "constant" else (lambda X, t: np.repeat(g[:, None], X.shape[1], axis=1))
    scene = free(gravity=gravity, velocity=v0)
    *_, state = simulate(scene, dt=DT, until=12 * DT, scheme=Scheme(theta=theta))
    t = 12 * DT
    path = v0 * t + 0.5 * g * t**2 + (theta - 0.5) * g * DT * t
    assert np.allclose(state.v, (v0 + g * t)[:, None], rtol=0, atol=1e-11)
    assert np.allclose(state.x, scene.bodies[0].points.x + path[:, None], rtol=0, atol=1e-12 * R)
    work = (0.5 * (v0 + g * t) @ (v0 + g * t) - 0.5 * v0 @ v0) * state.mass.sum()
    energy = state.report.energy
    assert energy.external - energy.dissipated == pytest.approx(work, rel=1e-9)
    assert energy.external == pytest.approx(state.mass.sum() * g @ path, rel=1e-9)


@pytest.mark.parametrize("theta", [1.0, 0.5])
def test_gravity_in_time_is_taken_at_t_plus_theta_dt(theta):
    """g(t) = a t: v_n = a dt^2 sum (i + theta), for the midpoint rule the exact a t^2 / 2."""
    a, seen = 1e6, []

    def gravity(X, t):
        seen.append(t)
        return a * t * np.array([[0.0], [-1.0]]) * np.ones(X.shape)

    scene = free(gravity=gravity)
    *_, state = simulate(scene, dt=DT, until=5 * DT, scheme=Scheme(theta=theta), warn=False)
    times = (np.arange(5) + theta) * DT
    assert np.allclose(seen, [0.0, *times], rtol=1e-12)  # the first is the scene's check
    assert np.allclose(state.v[1], -a * DT * times.sum(), rtol=1e-10)


def test_gravity_is_a_field_of_initial_positions():
    """A body force -k X that would compress: every point of a soft disc starts with its own acceleration."""
    k = 1e6
    scene = Scene([round_body((0.1 * R, 0.0))], cell=CELL, gravity=lambda X, t: -k * X)
    state = step(scene, initial(scene), 1e-9, scheme=Scheme(ghost=0.0))
    X = scene.bodies[0].points.x
    assert np.abs(state.v / 1e-9 + k * X).max() <= 0.15 * k * R  # lumped mass, Q1 interpolation
    assert (state.v @ state.mass / 1e-9) == pytest.approx(-k * X @ state.mass, rel=1e-9)


def test_a_velocity_field_is_that_of_the_points_at_t_0():
    """f(x), its gradient as affine field C; a spin adds to it."""
    L = np.array([[1.0, 2.0], [-3.0, 0.5]])
    scene = free(velocity=lambda x: 7.0 + L @ x, spin=11.0)
    state = initial(scene)
    X, W = scene.bodies[0].points.x, np.array([[0.0, -11.0], [11.0, 0.0]])
    centre = X @ state.mass / state.mass.sum()
    assert np.allclose(state.v, 7.0 + L @ X + W @ (X - centre[:, None]), rtol=1e-12)
    assert np.allclose(state.C, (L + W)[:, :, None], rtol=1e-6)


@pytest.mark.parametrize("scheme", [Scheme(), Scheme(theta=0.5)], ids=["backward Euler", "midpoint"])
def test_spin_gives_the_angular_momentum_of_the_disc_and_a_step_keeps_it(scheme):
    """I omega = 1/2 m R^2 omega: exactly, for the points have the disc's second moments.

    The step keeps it up to what backward Euler loses, (omega dt)^2 a step.
    """
    omega = 200.0
    scene = Scene([round_body((3 * R, -R), spin=omega, velocity=(1.0, 2.0), material=SOFT)], cell=CELL)
    exact = 0.5 * np.pi * R**4 * 1000.0 * omega

    def angular(state):
        mass, centre = state.mass, state.x @ state.mass / state.mass.sum()
        v = state.v - (state.v @ mass / mass.sum())[:, None]
        arm = state.x - centre[:, None]
        return float(mass @ (arm[0] * v[1] - arm[1] * v[0]))

    assert angular(initial(scene)) == pytest.approx(exact, rel=1e-12)
    *_, state = simulate(scene, dt=DT, until=20 * DT, scheme=scheme)
    allowed = 20 * (omega * DT) ** 2 if scheme.theta == 1.0 else 0.0
    assert angular(state) == pytest.approx(exact, rel=1e-4 + 2 * allowed)


@pytest.mark.parametrize(
    "motion", [{"velocity": lambda x: 2e3 * x * [[1], [-1]]}, {"spin": 500.0}], ids=["mode", "spin"]
)
def test_the_midpoint_rule_keeps_the_energy_of_a_free_disc_better_than_backward_euler(motion):
    """Half a period of its quadrupole mode, and 0.1 rad of a rotation."""
    lost = {}
    for theta in (0.5, 1.0):
        scene = free(SOFT, **motion)
        begin = initial(scene).report.energy.kinetic
        *_, state = simulate(scene, dt=5e-6, until=2e-4, scheme=Scheme(theta=theta))
        energy = state.report.energy
        lost[theta] = 1.0 - (energy.kinetic + energy.elastic) / begin
        assert energy.dissipated == pytest.approx(lost[theta] * begin, rel=1e-9, abs=1e-12 * begin)
    assert lost[1.0] > 0.0
    assert abs(lost[0.5]) < 0.25 * lost[1.0]


# --- anchors


@pytest.mark.parametrize("material", [SOFT, LINEAR], ids=["soft", "linear"])
@pytest.mark.parametrize("anchor", [0.0, 0.02])
def test_a_compression_regrids_and_keeps_its_wall_force(material, anchor):
    """The same compression for every bound, within 10 % of that without regridding (stress relaxes slightly)."""
    walls = [Wall((0, 0), (0, 1)), Wall((0, 2 * R), (0, -1), velocity=(0, -1.0))]
    scene = Scene([round_body((0, R), material)], cell=CELL, walls=walls)
    *_, once = simulate(scene, dt=1e-5, until=20e-5)
    scheme = Scheme(anchor=anchor)
    states = [initial(scene, scheme=scheme), *simulate(scene, dt=1e-5, until=20e-5, scheme=scheme)]
    regridded = [not np.array_equal(a.x_anchor, b.x_anchor) for a, b in pairwise(states)]
    assert sum(regridded) == 19 if anchor == 0.0 else 2 <= sum(regridded) < 19
    for before, after, new in zip(states, states[1:], regridded, strict=False):
        assert np.array_equal(after.x_anchor, before.x if new else before.x_anchor)
        assert np.isfinite(after.wall_force).all()
    assert np.array_equal(once.x_anchor, states[0].x)
    assert states[-1].wall_force[1, 1] == pytest.approx(once.wall_force[1, 1], rel=0.1)
    ours, theirs = states[-1].report.energy, once.report.energy
    assert ours.elastic == pytest.approx(theirs.elastic, rel=0.15)
    assert np.allclose(states[-1].volume.sum(), once.volume.sum(), rtol=2e-3)


def test_the_seed_runs_two_discs_between_walls():
    """Twenty steps: no body passes a wall, both walls of a pair bear the same, forces only push."""
    walls = [
        Wall((0, 0), (0, 1)),
        Wall((0, 4 * R), (0, -1), velocity=(0, -2.0)),
        Wall((-R, 0), (1, 0)),
        Wall((R, 0), (-1, 0)),
    ]
    scene = Scene([round_body((0, y * R), SOFT) for y in (1, 3)], cell=CELL, walls=walls, friction=0.5)
    states = list(simulate(scene, dt=5e-6, until=1e-4, scheme=Scheme.nezamabadi2017()))
    assert len(states) == 20
    for state in states:
        assert (state.contacts.force[0] >= 0.0).all()
        assert not state.contacts.gap.any()
        assert np.isfinite(state.stress).all()
    end = states[-1]
    assert np.abs(end.x[0]).max() <= R + 0.01 * CELL
    assert end.x[1].min() >= -0.01 * CELL
    assert end.x[1].max() <= 4 * R - 2e-4 + 0.01 * CELL
    left, right = end.wall_force[2:, 0]
    assert end.wall_force[1, 1] > 50.0
    assert right == pytest.approx(-left, rel=0.05)


def test_bodies_of_every_shape_and_material_share_a_scene():
    """A box and a disc, soft and linear, on a floor: they fall together and rest on it."""
    floor = Wall((0, 0), (0, 1), friction=0.3)
    bodies = [
        Body(box((0.01 * R, 0.02 * R), (R, R), spacing=CELL / 2), SOFT),
        round_body((2.5 * R, 1.02 * R), LINEAR),
    ]
    scene = Scene(bodies, cell=CELL, walls=[floor], gravity=(0.0, -1e4))
    *_, state = simulate(scene, dt=2e-5, until=2e-3, scheme=Scheme())
    weight = -state.mass.sum() * 1e4
    assert state.wall_force[0, 1] == pytest.approx(weight, rel=0.2)
    assert (state.x[1] > -1e-3 * CELL).all()


@pytest.mark.parametrize(
    ("first", "then"),
    [
        ({}, {"inertia": False}),
        ({"inertia": False}, {}),
        ({}, {"theta": 0.5}),
        ({}, {"mean_dilatation": True}),
        ({}, {"ghost": 0.02}),
    ],
)
def test_a_factor_is_not_kept_for_another_scheme(first, then):
    """A pulled linear bar whose scheme changes between two steps: as if nothing had been kept, to the bit."""
    bar = Body(box((0.0, 0.0), (1.0, 0.25), spacing=0.05), LinearElastic(1e6, 0.3, 1000.0))
    ends = {
        "supports": [Support(lambda x: x[0] < 1e-9)],
        "loads": [Load(lambda x: x[0] > 1.0 - 1e-9, (1e3, 0.0))],
    }
    scene, dt = Scene([bar], cell=0.1, **ends), 1e-4
    state = step(scene, initial(scene, scheme=Scheme(**first)), dt, scheme=Scheme(**first))
    kept, fresh = (step(scene, s, dt, scheme=Scheme(**then)) for s in (state, replace(state, derived=None)))
    assert np.array_equal(kept.x, fresh.x)
    assert not np.array_equal(kept.x, step(scene, state, dt, scheme=Scheme(**first)).x)


@pytest.mark.parametrize(("dt", "ends"), [(None, (0.3, 0.1 + 0.2)), (0.01, (0.3, 0.3 + 2.5e-11))])
def test_a_run_does_not_end_with_a_sliver_of_a_step(dt, ends):
    """Round-off of gaps over 5e-17 s is a large velocity: 432 J/m became 5e14, without a word."""
    gel = NeoHookean(1e6, 0.3, 1000.0)
    bodies = [Body(disc((x, y), 1.0, spacing=0.3), gel) for x, y in ((1.0, 1.0), (1.3, 3.0))]
    walls = [Wall((0, 0), (0, 1)), Wall((0, 0), (1, 0)), Wall((2.31, 0), (-1, 0))]
    lid = Wall((0, 4.0), (0, -1), velocity=(0, -0.5))
    scene = Scene(bodies, cell=0.4, friction=0.3, gravity=(0, -10), walls=[*walls, lid])
    *_, state = simulate(scene, dt=dt, until=ends[0])
    if dt is None:
        assert not list(simulate(scene, until=ends[1], start=state))
        return
    *others, last = simulate(scene, dt=dt, until=ends[1])
    assert last.report.dt == pytest.approx(0.5 * dt) and others[-1].report.dt == pytest.approx(0.5 * dt)
    assert last.report.energy.kinetic < 2.0 * state.report.energy.kinetic


def test_run_returns_the_last_state():
    """That of `simulate`, of `start` where no step leads to `until`, and the first one at t = 0."""
    scene = free(velocity=(1.0, 0.0))
    *_, last = simulate(scene, dt=DT, until=3 * DT)
    found = skmpm.run(scene, until=3 * DT, dt=DT)
    assert np.array_equal(found.x, last.x) and found.t == last.t
    assert skmpm.run(scene, until=found.t, dt=DT, start=found) is found
    assert skmpm.run(scene, until=0.0).t == 0.0
    with pytest.raises(TypeError, match="speed"):
        skmpm.run(scene, until=DT, speed=1.0)
