"""Materials with memory: their states in steps, files, pictures and stages, and what is refused."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from skmpm import (
    Body,
    ElastoPlastic,
    LinearElastic,
    NeoHookean,
    Scene,
    SceneError,
    Scheme,
    StepFailed,
    Support,
    Wall,
    box,
    check_material,
    continued,
    disc,
    initial,
    load,
    plot,
    preflight,
    read,
    record,
    save,
    simulate,
    step,
)
from skmpm.material import has_memory, in_step, virgin
from skmpm.plot.snapshot import of_frame
from skmpm.scene import mises, plastic_strain, stress_zz
from skmpm.step.derived import bulk_of
from skmpm.step.terms import Budget

R, CELL, DT = 1e-3, 0.25e-3, 2e-5
METAL = ElastoPlastic(1e6, 0.3, 1000.0, yield_stress=1e4, hardening=5e4)
GEL = NeoHookean(1e6, 0.3, 1000.0)
STATIC = Scheme(inertia=False)


def pressed(material=METAL, **options):
    """A disc between plates, of which the upper one comes down by a tenth of R in 5 steps."""
    walls = [Wall((0, R), (0, -1), velocity=(0, -1.0)), Wall((0, -R), (0, 1))]
    return Scene([Body(disc((0, 0), R, spacing=CELL / 2), material)], cell=CELL, walls=walls, friction=0.3, **options)


def states_of(scene, *, until=5 * DT, dt=DT, **options):
    return list(simulate(scene, dt=dt, until=until, **options))


# The law.


@pytest.mark.parametrize("hardening", [0.0, 5e4, 5e6])
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.4999])
def test_the_law_passes_its_check(nu, hardening):
    """Energy, stress, tangent and update fit each other; perfectly plastic and nearly incompressible ones, too."""
    report = check_material(ElastoPlastic(1e6, nu, 1000.0, yield_stress=1e4, hardening=hardening))
    assert "update keeps what it gave and turns with the body" in report


def test_below_the_yield_stress_it_is_hencky():
    """W = mu e : e + lambda / 2 (tr e)^2 of the logarithmic strains, and no internal variable changes."""
    lam, mu = METAL.lame
    e = np.array([[4e-3, -2e-3, 1e-9], [1e-3, -5e-3, -2e-9]])
    F = np.zeros((2, 2, 3))
    F[0, 0], F[1, 1] = np.exp(e)
    state = np.repeat(np.array([METAL.state0]).T, 3, axis=1)
    exact = mu * (e**2).sum(axis=0) + 0.5 * lam * e.sum(axis=0) ** 2
    np.testing.assert_allclose(METAL.energy(F, state), exact, rtol=1e-6)
    assert np.array_equal(METAL.update(F, state), state)


def test_a_step_dissipates_the_yield_stress_times_the_flow():
    """W(F; before) - W(F; after), and an inverted point keeps its state."""
    rng = np.random.default_rng(0)
    F, state = np.eye(2)[:, :, None] + rng.uniform(-0.3, 0.3, (2, 2, 50)), np.repeat([METAL.state0], 50, axis=0).T
    after = METAL.update(F, state)
    lost = in_step(METAL, state).dissipated(F, after)
    np.testing.assert_allclose(lost, METAL.yield_stress * after[0], rtol=1e-9, atol=1e-6)
    assert after[0].min() > 0.0
    mirrored = F * np.array([1.0, -1.0])[None, :, None]
    assert np.array_equal(METAL.update(mirrored, state), state)
    assert np.isinf(METAL.energy(mirrored, state)).all()


@pytest.mark.parametrize("J", [3.0, 1.5, 0.5, 0.1])
def test_the_stress_across_the_plane_follows_from_those_in_it_at_any_change_of_volume(J):
    """Uniaxial flow without hardening: that of von Mises times J is the yield stress."""
    metal, F = ElastoPlastic(10.0, 0.3, 1.0, yield_stress=0.3), np.eye(2)[:, :, None].copy()
    state = np.array(metal.state0)[:, None]
    for F[1, 1] in np.linspace(1.0, J, 80):
        stress, state = metal.stress(F, state), metal.update(F, state)
    cauchy = np.einsum("ikn,jkn->ijn", stress, F) / J
    limit = mises(cauchy, metal.stress_zz(cauchy, state)) * J
    assert limit[0] == pytest.approx(0.3, rel=1e-6)


def test_others_have_no_memory():
    assert has_memory(METAL) and not has_memory(GEL)
    assert virgin(GEL) is GEL


# In a scene.


def test_a_pressed_disc_keeps_its_shape_and_accounts_for_its_energy():
    """Work is stored or dissipated; no point is beyond the yield stress, up to averages over its cell."""
    scene = pressed()
    states = states_of(scene, scheme=replace(STATIC, newton_tol=1e-6))
    end, energy = states[-1], states[-1].report.energy
    assert end.internal.shape == (4, end.x.shape[1])
    assert 0.02 < end.internal[0].max() < 0.5
    assert energy.plastic > 0.3 * energy.external
    # Work by the trapezoidal rule, in five steps of which the first meets the yield stress.
    assert abs(energy.dissipated) < 0.05 * energy.external
    limit = METAL.yield_stress + METAL.hardening * end.internal[0]
    assert np.percentile(mises(end.stress, stress_zz(scene, end)) / limit, 90) < 1.1
    elastic = states_of(pressed(GEL), scheme=STATIC)[-1]
    assert elastic.report.energy.plastic == 0.0
    assert elastic.internal.shape[0] == 0


@pytest.mark.parametrize("anchor", [np.inf, 0.02])
def test_the_update_sees_the_deformation_that_the_stress_sees(anchor):
    """With the internal variables of the end of a step, stresses there are the same and nothing flows any more."""
    scene, scheme = pressed(), replace(STATIC, anchor=anchor)
    end = states_of(scene, scheme=scheme)[-1]
    bulk = bulk_of(scene, end, scheme)
    assert all(bulk.mean_dilatation)
    configuration = bulk.at(end.displacement)
    np.testing.assert_allclose(bulk.cauchy(configuration), end.stress, rtol=0.0, atol=1e-9 * METAL.yield_stress)
    np.testing.assert_allclose(bulk.updated(configuration), end.internal, rtol=0.0, atol=1e-12)
    assert abs(bulk.dissipated(configuration, end.internal)) < 1e-12 * end.report.energy.plastic


def test_viscosity_adds_to_plasticity():
    """Both dissipate, apart from each other."""
    energy = states_of(pressed(replace(METAL, viscosity=10.0)), scheme=STATIC)[-1].report.energy
    assert energy.viscous > 0.05 * energy.external
    assert energy.plastic > 0.05 * energy.external


def test_a_round_body_that_may_flow_is_not_indifferent_to_rotation():
    """Residual strains turn with it, so that its rotation is an unknown without friction, too."""
    for law, indifferent in ((GEL, True), (METAL, False)):
        assert replace(pressed(law), friction=0.0).indifferent_to_rotation.tolist() == [indifferent]


def test_with_inertia_the_budget_of_each_step_closes():
    """What backward Euler and friction dissipate is positive; plastic flow is apart from it."""
    before = None
    for state in states_of(pressed(), dt=2e-6, until=6e-5):
        energy = state.report.energy
        if before is not None:
            assert energy.plastic >= before.plastic
            assert energy.dissipated >= before.dissipated - 1e-6 * energy.external
        before = energy
    assert energy.plastic > 0.0


@pytest.mark.parametrize(
    "scheme",
    [STATIC, Scheme(), Scheme(anchor=0.02), Scheme(theta=0.5)],
    ids=["static", "dynamic", "regridding", "midpoint"],
)
def test_a_run_continues_from_a_checkpoint_bit_for_bit(scheme, tmp_path):
    scene = pressed()
    states = states_of(scene, scheme=scheme)
    save(tmp_path / "state", states[1])
    again = states_of(scene, scheme=scheme, start=load(tmp_path / "state"))
    assert np.array_equal(again[-1].internal, states[-1].internal)
    assert np.array_equal(again[-1].stress, states[-1].stress)
    assert again[-1].report.energy == states[-1].report.energy
    assert states[-1].internal[0].max() > 0.01


def test_a_step_leaves_the_state_at_its_start_as_it_was():
    """Also one that fails, whose remedy is to repeat it with a shorter one."""
    scene = pressed()
    start = states_of(scene, scheme=STATIC)[2]
    internal = start.internal.copy()
    after = step(scene, start, DT, scheme=STATIC)
    assert not np.array_equal(after.internal, internal)
    with pytest.raises(StepFailed) as failure:
        step(scene, start, 40 * DT, scheme=STATIC)
    assert failure.value.state is start
    assert np.array_equal(start.internal, internal)


def test_time_does_not_matter_without_inertia():
    """The same displacements in other times, to the tolerance of the iteration."""
    slow = replace(pressed(), walls=[Wall((0, R), (0, -1), velocity=(0, -1e-3)), Wall((0, -R), (0, 1))])
    scheme = replace(STATIC, newton_tol=1e-8, gap_tol=1e-9, contact_tol=1e-12)
    ends = states_of(pressed(), scheme=scheme)[-1], states_of(slow, dt=1e3 * DT, until=5e3 * DT, scheme=scheme)[-1]
    np.testing.assert_allclose(ends[0].internal, ends[1].internal, rtol=0.0, atol=1e-6)


def test_a_turning_body_does_not_flow():
    """A disc with residual stresses turns by a radian: its internal variables stay, its stress turns with it."""
    pressing, free = pressed(), replace(pressed(), walls=[])
    bent = states_of(pressing, scheme=STATIC)[-1]
    released = step(free, continued(pressing, bent, free), DT, scheme=STATIC)
    rate, angle = 100.0, 1.0
    arm = released.x - np.average(released.x, axis=1, weights=released.mass)[:, None]
    turning = np.array([[0.0, -rate], [rate, 0.0]])
    C = np.einsum("ij,jkp->ikp", turning, released.F)
    start = replace(released, v=turning @ arm, C=C, t=0.0)
    end = states_of(free, dt=1e-4, until=angle / rate, start=start, scheme=Scheme(newton_tol=1e-6))[-1]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    expected = np.einsum("ij,jkp,lk->ilp", turn, released.stress, turn)
    assert np.abs(released.stress).max() > 0.2 * METAL.yield_stress
    np.testing.assert_allclose(end.internal, released.internal, rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(end.stress, expected, rtol=0.0, atol=0.02 * METAL.yield_stress)


def stretching(x):
    return 5e3 * np.array([[1.0], [-1.0]]) * (x - 2 * CELL)


def test_of_several_materials_each_point_has_its_own():
    """A plastic core in an elastic skin: internal variables of the core only, of a material that has fewer zeros."""
    points = disc((0, 0), R, spacing=CELL / 2).with_groups(lambda x: np.where(np.hypot(*x) < R / 2, "core", "skin"))
    core = points.group == "core"
    scene = replace(pressed(), bodies=[Body(points, {"core": METAL, "skin": Damage()}), Body(far(points), GEL)])
    start = initial(scene)
    end = states_of(scene, scheme=STATIC)[-1]
    own = slice(0, points.size)
    np.testing.assert_array_equal(
        start.internal[:, own][:, ~core], [[1.0], [0.0], [0.0], [0.0]] @ np.ones((1, (~core).sum()))
    )
    assert not end.internal[:, points.size :].any()
    assert (end.internal[1:3, own][:, core] != 0.0).all()
    assert (end.internal[0, own][~core] < 1.0).any()
    assert np.isnan(plastic_strain(scene, end.internal)[own][~core]).all()


def far(points):
    return points.placed((5 * R, 0.0), 0.0)


def test_what_flow_dissipates_does_not_hide_a_gain_of_energy():
    """Of 1 J, 0.97 are stored and 0.05 dissipated: 0.02 too much."""
    budget = Budget(elastic=np.array([1.0, 0.97]), plastic=0.05)
    assert budget.surplus == pytest.approx(0.02)


# Files, pictures, stages.


def test_recordings_and_pictures_show_it(tmp_path):
    scene = pressed()
    end = states_of(scene, scheme=STATIC)[-1]
    with record(tmp_path / "run.vtkhdf", scene) as film:
        film.write(end)
    frame = read(tmp_path / "run.vtkhdf")[-1]
    np.testing.assert_allclose(frame.points["plastic_strain"], end.internal[0], rtol=1e-6)
    assert np.isfinite(frame.points["stress"]).all()
    np.testing.assert_allclose(of_frame(frame).fields["plastic strain"](), end.internal[0], rtol=1e-6)
    assert plot(scene, end, "plastic strain").child_axes[0].get_ylabel() == "plastic strain"
    soft = pressed(GEL)
    with record(tmp_path / "soft.vtkhdf", soft) as film:
        film.write(initial(soft))
    frame = read(tmp_path / "soft.vtkhdf")[0]
    assert "plastic_strain" not in frame.points and np.isnan(of_frame(frame).fields["plastic strain"]()).all()
    with pytest.raises(ValueError, match=r"plastic strain is nan .*; it needs a material that yields"):
        plot(soft, initial(soft), "plastic strain")


def test_stages_keep_internal_variables_and_their_material():
    scene = pressed()
    end = states_of(scene, scheme=STATIC)[-1]
    released = replace(scene, walls=scene.walls[1:])
    assert np.array_equal(continued(scene, end, released).internal, end.internal)
    hard = replace(METAL, yield_stress=2e4)
    assert continued(scene, end, pressed(hard)).internal is end.internal
    with pytest.raises(SceneError, match="points of body 0 have internal variables of another material"):
        continued(scene, end, pressed(GEL))


def test_a_state_without_them_does_not_fit():
    with pytest.raises(SceneError, match="the state has 0 internal variables, the scene 4"):
        step(pressed(), initial(pressed(GEL)), DT)


def test_a_scheme_in_which_flow_locks_is_warned_of():
    (line,) = [
        s for s in str(preflight(pressed(), 1e-6, scheme=Scheme(mean_dilatation=False))).splitlines() if s[0] == "!"
    ]
    assert line.startswith("! body 0: ElastoPlastic without mean dilatation; plastic flow locks")
    assert "no warnings" in str(preflight(pressed(), 1e-6))


# What is refused.


@pytest.mark.parametrize("name", ["yield_stress", "hardening"])
@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf, "1e4", None])
def test_constants_that_make_no_sense_are_refused_by_name(name, value):
    with pytest.raises(SceneError, match=f"body 0: {name}"):
        pressed(replace(METAL, **{name: value}))


def test_a_yield_stress_of_zero_is_refused():
    with pytest.raises(SceneError, match=r"body 0: yield_stress = 0\.0; give a stress in Pa, greater than zero"):
        pressed(replace(METAL, yield_stress=0.0))


WEAK = 2e4  # [Pa]


@dataclass(frozen=True)
class Damage:
    """Green's strain with stored energy d W, d = 1 / (1 + W / WEAK) at the largest W so far: a law that softens.

    A step has the potential min over d <= before of d W + D(d) - D(before), D = WEAK (d - ln d).
    """

    fault: str = ""
    density: float = 1000.0

    @property
    def lame(self):
        """Of the undamaged material."""
        return 4e5, 4e5

    @property
    def state0(self):
        """One integrity."""
        return {"number": 1.0, "empty": (), "nan": (np.nan,)}.get(self.fault, (1.0,))

    def _stored(self, F):
        E = 0.5 * (np.einsum("kip,kjp->ijp", F, F) - np.eye(2)[:, :, None])
        trace = E[0, 0] + E[1, 1]
        return 4e5 * np.einsum("ijp,ijp->p", E, E) + 2e5 * trace**2, E, trace

    def _integrity(self, W, before):
        d = 1.0 / (1.0 + W / WEAK)
        return np.where(d < before, d, before)

    def energy(self, F, state):
        """The potential of the step."""
        W, J = self._stored(F)[0], F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
        d = self._integrity(W, state[0])
        lost = WEAK * (d - np.log(d) - state[0] + np.log(state[0]))
        return np.where(J > 0.0, d * W + lost, np.inf)

    def stress(self, F, state):
        """F times d S."""
        W, E, trace = self._stored(F)
        S = 8e5 * E + 4e5 * trace * np.eye(2)[:, :, None]
        return self._integrity(W, state[0]) * np.einsum("ijp,jkp->ikp", F, S)

    def tangent(self, F, state):
        """By complex steps."""
        steps = 1e-30j * np.eye(4)
        columns = [self.stress(F + step.reshape(2, 2, 1), state).imag / 1e-30 for step in steps]
        return np.stack(columns, axis=2).reshape(2, 2, 2, 2, -1)

    def update(self, F, state):
        """The integrity at the end of the step, unless there is a fault in it."""
        if self.fault == "shape":
            return state[0]
        if self.fault == "raises":
            raise KeyError("flow")
        after = self._integrity(self._stored(F)[0], state[0])
        if self.fault == "at rest":
            after = 0.9 * after
        if self.fault == "drift":
            after = np.where(after < 1.0, 0.99 * after, after)
        if self.fault == "frame":
            after = np.minimum(after, 1.0 / (1.0 + (F[0, 1] - F[1, 0]) ** 2))
        if self.fault == "too far":
            after = np.maximum(np.floor(20.0 * after), 1.0) / 20.0
        if self.fault == "healing":
            after = np.sqrt(after)
        return after[None]


def test_a_law_of_ones_own_with_memory_passes_its_check_and_runs():
    """Damage: it softens, and `preflight` has nothing against it."""
    assert "update keeps" in check_material(Damage())
    end = states_of(pressed(Damage()), scheme=STATIC)[-1]
    assert end.internal.shape[0] == 1
    assert end.internal.min() < 0.99
    assert end.report.energy.plastic > 0.0
    assert "no warnings" in str(preflight(pressed(Damage()), 1e-6))


@pytest.mark.parametrize(
    ("fault", "message"),
    {
        "number": r"state0 = 1\.0; give its internal variables, a tuple of finite numbers",
        "empty": r"state0 = \(\); give its internal variables",
        "nan": r"state0 = \(nan,\); give its internal variables",
        "shape": r"update gives .*; give finite numbers, \(1, 3\)",
        "raises": "update raises KeyError: 'flow', at F = I and state0, 3 points",
        "at rest": r"update gives \[0\.9\] at F = I and state0 = \(1\.0,\); give state0 there",
        "drift": r"update\(F, update\(F, state\)\) and update\(F, state\) differ by",
        "frame": r"update\(Q F, state\) and update\(F, state\) differ by",
        "too far": r"stress\(F, update\(F, state\)\) and stress\(F, state\) differ by",
        "healing": r"energy\(F, state\) - energy\(F, update\(F, state\)\) is -.* Pa; a step dissipates energy",
    }.items(),
)
def test_what_is_wrong_with_a_law_with_memory_is_named(fault, message):
    with pytest.raises(ValueError, match=message):
        check_material(Damage(fault))


def test_a_law_without_update_or_that_says_linear_is_refused():
    for attributes, message in (
        ({"update": None}, r"it lacks update\(F, state\)"),
        ({"linear": True}, "linear = True"),
    ):
        wrong = type("Wrong", (Damage,), attributes)()
        with pytest.raises(SceneError, match=message):
            pressed(wrong)


def test_linear_elastic_beside_it_stays_as_it_was():
    """A scene of both runs; the linear body has no internal variables."""
    plain = LinearElastic(1e6, 0.3, 1000.0)
    bodies = [Body(box((-R, -R), (2 * R, R), spacing=CELL / 2), m) for m in (METAL,)]
    bodies.append(Body(box((-R, 0.0), (2 * R, R), spacing=CELL / 2), plain))
    held = Support(lambda x: x[1] < -R + 1e-9, velocity=(0.0, 0.0))
    lid = Wall((0, R), (0, -1), velocity=(0, -1.0))
    scene = Scene(bodies, cell=CELL, walls=[lid], supports=[held], friction=0.5)
    end = states_of(scene, scheme=STATIC)[-1]
    assert end.internal[0, end.body == 0].max() > 1e-3
    assert not end.internal[:, end.body == 1].any()
