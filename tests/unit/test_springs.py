"""Springs against closed forms: beds and bars, their forces, energies and matrices, and errors in them."""

import sys
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
import scipy.sparse as sp
from scipy.linalg import block_diag

import skmpm
from skmpm import LinearElastic, NeoHookean, Spring, coulomb, linear, spring_forces
from skmpm.linear.corrected import joined
from skmpm.points import box, disc, from_mesh
from skmpm.scene import Body, Load, Scene, SceneError, StepFailed, Support, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.algorithm import step
from skmpm.step.derived import bulk_of
from skmpm.step.initial_state import initial
from skmpm.step.scene_forces import springs_of

sys.path.append(str(Path(__file__).parent))
from test_only_what_is_required import Calls

CELL, K = 0.1, 1e3  # [m], [N/m2]
STIFF = NeoHookean(1e8, 0.3, 1000.0)  # a block of 1 m2 has 1000 kg/m and hardly deforms
MIDPOINT, STATIC = Scheme(theta=0.5), Scheme(inertia=False, newton_tol=1e-8)
PERIOD = 2.0 * np.pi * np.sqrt(1000.0 / K)


def block(left=0.0, material=STIFF, bottom=0.0, **motion):
    return Body(box((left, bottom), (1.0, 1.0), spacing=CELL / 2), material, **motion)


def everywhere(x):
    return np.ones(x.shape[1], dtype=bool)


def left(x):
    return x[0] < 1.5


def right(x):
    return x[0] > 1.5


def run(scene, until, steps, scheme=MIDPOINT, **options):
    *_, state = simulate(scene, dt=until / steps, until=until, scheme=scheme, **options)
    return state


def moved(scene, state):
    return (state.x - scene.initial_positions).mean(axis=1)


def total(energy):
    return energy.kinetic + energy.elastic + energy.springs


# Beds.


@pytest.mark.parametrize("material", [STIFF, LinearElastic(1e8, 0.3, 1000.0)], ids=["finite", "linear"])
def test_a_block_on_a_bed_has_the_period_of_its_mass(material):
    """2 pi (m / k)^(1/2), to the second order of the midpoint rule, whose period is (1 + (omega dt)^2 / 12) of it."""
    errors = []
    for steps in (50, 100):
        scene = Scene([block(material=material, velocity=(1.0, 0.0))], cell=CELL, springs=[Spring(everywhere, K)])
        state = run(scene, PERIOD, steps)
        late = -moved(scene, state)[0] / np.sqrt(1000.0 / K)  # x = (m / k)^(1/2) sin(omega t)
        assert late == pytest.approx(2 * np.pi * (2 * np.pi / steps) ** 2 / 12, rel=0.02)
        errors.append(late)
        assert total(state.report.energy) == pytest.approx(500.0, rel=1e-9)  # that of the midpoint rule is kept
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)


@pytest.mark.parametrize("scheme", [STATIC, Scheme(inertia=False, newton_tol=1e-5)], ids=["tight", "lax"])
def test_a_load_extends_a_bed_by_force_over_stiffness(scheme):
    """A body that springs alone hold, without inertia: exactly, in both directions, with different stiffnesses."""
    push = Load(lambda x: x[0] > 1.0 - 1e-9, (3.0, 5.0))
    balance = Load(lambda x: x[0] < 1e-9, (0.0, 5.0))  # with the moment of the first
    scene = Scene([block()], cell=CELL, loads=[push, balance], springs=[Spring(everywhere, (K, 4 * K))])
    state = step(scene, initial(scene, scheme=scheme), 1.0, scheme=scheme)
    np.testing.assert_allclose(moved(scene, state), [3.0 / K, 10.0 / (4 * K)], rtol=1e-4)
    np.testing.assert_allclose(spring_forces(scene, state), [[-3.0, -10.0]], rtol=0.0, atol=100 * scheme.newton_tol)


def test_a_bed_resists_rotation():
    """A rigid block on a bed under a couple M turns by M / (k (w^2 + h^2) / 12)."""
    couple = [Load(lambda x: x[0] > 1 - 1e-9, (0.0, 5.0)), Load(lambda x: x[0] < 1e-9, (0.0, -5.0))]
    scene = Scene([block()], cell=CELL, loads=couple, springs=[Spring(everywhere, K)])
    state = step(scene, initial(scene, scheme=STATIC), 1.0, scheme=STATIC)
    turn = np.polyfit(scene.initial_positions[0], (state.x - scene.initial_positions)[1], 1)[0]
    assert turn == pytest.approx(5.0 / (K / 6.0), rel=2e-2)  # sin, and the elasticity of the block


def test_a_bed_in_one_direction_leaves_the_other_to_a_support():
    slide = Support(lambda x: x[1] < 1e-9, velocity=(None, 0.0))
    scene = Scene(
        [block()],
        cell=CELL,
        loads=[Load(everywhere, (2.0, 0.0))],
        springs=[Spring(everywhere, (K, 0.0))],
        supports=[slide],
    )
    tight = replace(STATIC, newton_tol=1e-6)
    state = step(scene, initial(scene, scheme=tight), 1.0, scheme=tight)
    assert moved(scene, state)[0] == pytest.approx(2.0 / K, rel=1e-6)
    free = replace(scene, supports=())
    loaded = replace(free, loads=[Load(everywhere, (0.0, 1.0))])
    with pytest.raises(StepFailed, match="it falls"):
        step(loaded, initial(loaded, scheme=STATIC), 1.0, scheme=STATIC)


def test_a_bed_whose_end_moves_pulls_a_block_and_its_work_is_counted():
    """Quasi-static: the block follows; with inertia: x = v (t - sin(omega t) / omega), energy as the work."""
    speed = 0.02
    scene = Scene([block()], cell=CELL, springs=[Spring(everywhere, K, rest=lambda t: (speed * t, 0.0))])
    state = run(scene, 2.0, 4, STATIC)
    np.testing.assert_allclose(moved(scene, state), [2.0 * speed, 0.0], atol=1e-8)
    until, omega = 0.3 * PERIOD, np.sqrt(K / 1000.0)
    state = run(scene, until, 100)
    assert moved(scene, state)[0] == pytest.approx(speed * (until - np.sin(omega * until) / omega), rel=1e-3)
    energy = state.report.energy
    assert energy.external == pytest.approx(total(energy), rel=1e-6)
    assert abs(energy.dissipated) < 1e-6 * energy.external


@pytest.mark.parametrize("steps", [10, 100])
@pytest.mark.parametrize("to", [None, (1.0, 0.5)], ids=["bed", "bar"])
def test_the_midpoint_rule_keeps_energy_while_ends_start_smoothly(to, steps):
    """Forces at rest((t0 + t1) / 2) gained half of all energy in the first step, and dt was blamed."""

    def rest(t):
        moved = 0.01 * (1.0 - np.cos(2.0 * np.pi * t / PERIOD))
        return (moved, 0.0) if to is None else 0.5 - moved

    scene = Scene([block()], cell=CELL, springs=[Spring(everywhere, K, to=to, rest=rest)])
    energy = run(scene, PERIOD, steps, replace(MIDPOINT, newton_tol=1e-10)).report.energy
    assert total(energy) > 1e-3 * K * 0.02**2
    assert energy.external == pytest.approx(total(energy), rel=1e-6)
    assert abs(energy.dissipated) < 1e-6 * energy.external


def test_backward_euler_dissipates_the_energy_of_a_bed_and_counts_it():
    scene = Scene([block(velocity=(1.0, 0.0))], cell=CELL, springs=[Spring(everywhere, K)])
    energy = run(scene, PERIOD, 50, Scheme()).report.energy
    assert total(energy) < 450.0
    assert total(energy) + energy.dissipated == pytest.approx(500.0, rel=1e-9)


@pytest.mark.parametrize("scheme", [Scheme(anchor=0.0), Scheme(anchor=0.01)], ids=["always", "often"])
def test_beds_and_bars_know_the_displacement_since_the_start_after_regridding(scheme):
    body = block(velocity=(1.0, 0.0), material=replace(STIFF, E=1e6))
    other = block(2.0, replace(STIFF, E=1e6))
    springs = [Spring(left, K), Spring(left, 2 * K, to=right)]
    scene = Scene([body, other], cell=CELL, springs=springs)
    kept, anew = (run(scene, 0.2, 20, s) for s in (Scheme(), scheme))
    np.testing.assert_allclose(moved(scene, anew), moved(scene, kept), rtol=1e-3, atol=1e-9)
    np.testing.assert_allclose(spring_forces(scene, anew), spring_forces(scene, kept), rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_block_on_a_floor_is_held_sideways_by_its_bed_alone(friction):
    """Without inertia, under its weight: F / k without friction, less with it."""
    floor = Wall((0.0, 0.0), (0.0, 1.0), friction=friction)
    push = Load(lambda x: x[1] < 0.3, (1000.0, 0.0))
    bed = Spring(lambda x: x[1] < 0.3, (100 * K, 0.0))
    scene = Scene([block()], cell=CELL, walls=[floor], loads=[push], springs=[bed], gravity=(0.0, -9.81))
    state = step(scene, initial(scene, scheme=STATIC), 1.0, scheme=STATIC)
    assert state.wall_force[0, 1] == pytest.approx(-9810.0, rel=1e-6)
    (pull, _), (dragged, _) = spring_forces(scene, state)[0], state.wall_force[0]
    assert pull - dragged == pytest.approx(-1000.0, rel=1e-5)  # the tolerance of the contact law
    assert state.report.unbalanced < 1e-4
    if friction == 0.0:
        assert moved(scene, state)[0] == pytest.approx(1000.0 / (100 * K), rel=1e-3)
    else:
        assert dragged > 0.0


# Bars.


def pair(material=STIFF, gap=1.0, **springs):
    bodies = [block(0.0, material, velocity=(1.0, 0.0)), block(1.0 + gap, material)]
    return Scene(bodies, cell=CELL, springs=[Spring(left, K, to=right, **springs)])


def test_two_blocks_on_a_bar_swing_with_the_reduced_mass():
    """Period 2 pi (m / 2 k)^(1/2); momentum to round-off, energy to that of the midpoint rule."""
    period = 2.0 * np.pi * np.sqrt(500.0 / K)
    scene = pair()
    state = run(scene, period, 100)
    own = state.body == 0
    span = state.x[0, ~own].mean() - state.x[0, own].mean()
    late = (2 * np.pi) ** 3 / 100**2 / 12
    assert (span - 2.0) * np.sqrt(K / 500.0) == pytest.approx(late, rel=0.05)
    np.testing.assert_allclose(state.v @ state.mass, [1000.0, 0.0], atol=1e-9)
    assert total(state.report.energy) == pytest.approx(500.0, rel=1e-7)


def test_a_bar_turns_with_its_ends():
    """Angular momentum of two blocks that circle each other: kept, to second order, though the bar turns by 1 rad."""
    bodies = [block(0.0, velocity=(0.0, 1.0)), block(2.0, velocity=(0.0, -1.0))]
    scene = Scene(bodies, cell=CELL, springs=[Spring(left, 100 * K, to=right)])
    drift = []
    for steps in (50, 100):
        state = run(scene, 1.0, steps)
        start = initial(scene)
        moments = [s.mass @ (s.x[0] * s.v[1] - s.x[1] * s.v[0]) for s in (start, state)]
        drift.append(abs(moments[1] / moments[0] - 1.0))
        span = state.x[:, state.body == 0].mean(axis=1) - state.x[:, state.body == 1].mean(axis=1)
        assert abs(np.arctan2(span[1], span[0])) < 2.2  # from pi
        np.testing.assert_allclose(state.v @ state.mass, 0.0, atol=1e-9)
    assert drift[1] < 2e-3


def test_a_bar_holds_a_body_at_its_rest_length():
    """A block pulled by a bar to a fixed point: at rest at F / k beyond its length, along the load."""
    guide = Spring(everywhere, (0.0, 10.0 * K))
    pull = [Load(everywhere, (7.0, 0.0))]
    hang = Spring(everywhere, K, to=(-1.0, 0.5), rest=1.5)
    clamp = Support(lambda x: x[0] < 1e-9, velocity=(None, 0.0))
    scene = Scene([block()], cell=CELL, loads=pull, springs=[hang, guide], supports=[clamp])
    state = step(scene, initial(scene, scheme=STATIC), 1.0, scheme=STATIC)
    assert state.x[0].mean() == pytest.approx(0.5 + 7.0 / K, abs=1e-5)
    damped = Body(box((0.0, 0.0), (1.0, 1.0), spacing=CELL / 2), STIFF)
    state = run(replace(scene, bodies=[damped]), 60.0, 60, Scheme())  # backward Euler damps it
    assert state.x[0].mean() == pytest.approx(0.5 + 7.0 / K, abs=1e-5)


def test_a_bar_between_two_held_bodies_without_inertia():
    """Each on a bed k; the bar k, shorter by 0.03 m: both move by 0.01 m towards each other."""
    springs = [Spring(everywhere, 2 * K), Spring(left, K, to=right, rest=2.0 - 0.03)]
    scene = Scene([block(0.0), block(2.0)], cell=CELL, springs=springs)
    state = step(scene, initial(scene, scheme=STATIC), 1.0, scheme=STATIC)
    shift = [(state.x - scene.initial_positions)[0, state.body == b].mean() for b in (0, 1)]
    np.testing.assert_allclose(shift, [0.01, -0.01], rtol=1e-6)
    assert state.report.newton <= 3 * state.report.solves
    np.testing.assert_allclose(spring_forces(scene, state), [[0.0, 0.0], [10.0, 0.0]], atol=1e-5)


def test_a_bar_presses_bodies_together_that_touch():
    """Contact and bar: at rest the contact carries the tension of the bar; Newton takes few iterations."""
    springs = [Spring(lambda x: x[0] < 0.3, 10 * K, to=lambda x: x[0] > 1.7, rest=1.0), Spring(left, (0.0, K))]
    soft = NeoHookean(1e5, 0.3, 1000.0)
    bodies = [block(0.0, soft), block(1.0, soft)]
    scene = Scene(bodies, cell=CELL, springs=springs, friction=0.3)
    state = run(scene, 8.0, 40, Scheme())
    tension = np.hypot(*spring_forces(scene, state)[0])
    assert tension > 0.5 * 10 * K * (1.7 - 1.0)
    assert state.body_force[0, 1] == pytest.approx(tension, rel=1e-6)
    assert state.report.newton <= 6


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_newtons_method_knows_stiff_bars_with_and_without_contact(friction):
    """A bar a thousand times as stiff as inertia allows in a step: two to four iterations, not a failure."""
    bar = Spring(lambda x: x[0] < 0.3, 1e8, to=lambda x: x[0] > 1.7, rest=1.65)
    soft = NeoHookean(1e6, 0.3, 1000.0)
    apart = Scene(
        [block(0.0, soft), block(1.2, soft)], cell=CELL, springs=[replace(bar, rest=1.75)], friction=friction
    )
    touching = replace(apart, bodies=[block(0.0, soft), block(1.0, soft)], springs=[bar])
    for scene in (apart, touching):
        state = run(scene, 0.1, 5, Scheme())
        assert state.report.newton <= 4 and state.report.retries == 0
        length = np.hypot(*scene.sprung[0].span(state.x))
        assert length == pytest.approx(scene.springs[0].rest, abs=2e-3)
    assert state.contacts.force[0].sum() > 1e4


@pytest.mark.parametrize("solver", [linear.banded, linear.direct, linear.amg])
def test_the_joined_inverse_and_its_delassus_operator_are_those_of_the_sum(solver):
    rng, scene = np.random.default_rng(0), pair()
    state = initial(scene)
    (springs,), assembly = springs_of(scene, state, (0.0, 1.0), 0.0), state.derived.assembly
    grid = assembly.grid
    C = STIFF.tangent(np.repeat(np.eye(2)[:, :, None], state.x.shape[1], axis=2))
    A = assembly.matrix(assembly.stiffness(C), 1e-4)
    B, stiffness = springs.coupling(bulk_of(scene, state, Scheme()).at(np.zeros(2 * grid.nodes)))
    coupled = joined(solver(A, grid.blocks, grid.rigid_motions), B, 1e4 * stiffness, grid.blocks)
    whole = A.toarray() + B.T @ (1e4 * block_diag(*stiffness) @ B.toarray())
    b = rng.normal(size=2 * grid.nodes)
    exact = np.linalg.solve(whole, b)
    np.testing.assert_allclose(coupled(b), exact, atol=1e-6 * np.abs(exact).max())
    rows = sp.csr_array(sp.kron(grid.interpolation[[3, 400, 700]], np.eye(2), format="csr"))
    W = rows @ np.linalg.solve(whole, rows.toarray().T)
    np.testing.assert_allclose(coupled.delassus(rows).toarray(), W, atol=1e-6 * np.abs(W).max())


def wall_of_blocks(n, friction, **options):
    """Rows of n blocks in a box whose lid comes down, with a bar between each and the next in its row."""
    soft, size = NeoHookean(1e6, 0.3, 1000.0), float(n)
    bodies = [block(float(i), soft, float(j)) for j in range(n) for i in range(n)]

    def at(i, j):
        return lambda x: (
            (np.floor(x[0] + 0.5) == i) & (np.abs(x[0] - i - 0.25) < 0.2) & (np.abs(x[1] - j - 0.5) < 0.3)
        )

    bars = [Spring(at(i, j), 1e5, to=at(i + 1, j)) for j in range(n) for i in range(n - 1)]
    walls = [Wall((0, 0), (0, 1)), Wall((0, size), (0, -1), velocity=(0.0, -1.0)), Wall((0, 0), (1, 0)),
             Wall((size, 0), (-1, 0))]  # fmt: skip
    return Scene(bodies, cell=0.25, walls=walls, springs=bars, friction=friction, **options)


@pytest.mark.parametrize("solver", [linear.banded, linear.direct])
def test_bars_of_different_bodies_share_a_solve(solver):
    """Nine blocks and six bars: the inverse of the sum, by as few columns as the bars on one block."""
    scene = wall_of_blocks(3, 0.0)
    state = initial(scene)
    (springs,), assembly = springs_of(scene, state, (0.0, 1.0), 0.0), state.derived.assembly
    grid = assembly.grid
    C = scene.bodies[0].material.tangent(np.repeat(np.eye(2)[:, :, None], state.x.shape[1], axis=2))
    A = assembly.matrix(assembly.stiffness(C), 1e-4)
    inner, columns = solver(A, grid.blocks, grid.rigid_motions), []

    def counted(b):
        columns.append(b.shape[1] if b.ndim == 2 else 1)
        return inner(b)

    moved = 0.01 * np.random.default_rng(1).normal(size=2 * grid.nodes)
    B, stretched = springs.coupling(bulk_of(scene, state, Scheme()).at(moved))
    coupled = joined(counted, B, 1e4 * stretched, grid.blocks)
    assert columns[0] <= 4  # two directions of the two bars on a block
    whole = A.toarray() + B.T @ (1e4 * block_diag(*stretched) @ B.toarray())
    b = np.random.default_rng(2).normal(size=2 * grid.nodes)
    exact = np.linalg.solve(whole, b)
    np.testing.assert_allclose(coupled(b), exact, atol=1e-7 * np.abs(exact).max())


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_large_problem_with_bars_stays_sparse(friction, filled, monkeypatch):
    """Bars join rows of blocks to one body each: eliminated, they would fill the rows of W, with the same result."""
    scene = wall_of_blocks(4, friction)

    def three_steps():
        *_, state = simulate(scene, dt=1e-4, until=3e-4, scheme=Scheme(newton_tol=1e-8))
        return state

    sparse, (entries, rows) = three_steps(), filled[-1]
    assert rows > coulomb.MAX_DENSE_ROWS
    monkeypatch.setattr(coulomb, "MAX_DENSE_ROWS", 10 * rows)
    dense, (more, rows) = three_steps(), filled[-1]
    assert entries < 0.6 * more
    assert np.abs(sparse.x - dense.x).max() < 1e-8 * scene.cell
    assert sparse.wall_force[1, 1] > 1e3
    if friction == 0.0:  # between the sides of blocks friction is not unique
        assert sparse.wall_force[1, 1] == pytest.approx(dense.wall_force[1, 1], rel=1e-6)


def test_forces_and_stiffness_of_springs_are_derivatives_of_their_energy():
    rng = np.random.default_rng(3)
    springs = [Spring(lambda x: x[0] < 0.2, (K, 3 * K)), Spring(left, K, to=right, rest=1.7)]
    scene = replace(pair(), springs=springs)
    state = initial(scene)
    beds, bars = springs_of(scene, state, (0.0, 1.0), 0.0)
    assembly, nodes = state.derived.assembly, state.derived.assembly.grid.nodes
    U, d = 0.05 * rng.normal(size=2 * nodes), 1e-6 * rng.normal(size=2 * nodes)
    at, ahead, behind = map(bulk_of(scene, state, Scheme()).at, (U, U + d, U - d))
    B, K_bars = bars.coupling(at)
    stiffness = (
        assembly.matrix(beds.stiffness(at), 1.0, np.zeros((nodes, 2, 2))) @ d,
        B.T @ (block_diag(*K_bars) @ (B @ d)),
    )
    for springs, moved in zip((beds, bars), stiffness, strict=True):
        slope = (springs.energy(ahead) - springs.energy(behind)) / 2
        assert springs.force(at) @ d == pytest.approx(slope, rel=1e-6)
        change = (springs.force(ahead) - springs.force(behind)) / 2
        np.testing.assert_allclose(moved, change, atol=1e-6 * np.abs(change).max())


# Runs.


@pytest.mark.parametrize(
    "scheme", [Scheme(), Scheme(anchor=0.05), Scheme.nezamabadi2017()], ids=["", "regrid", "nodes"]
)
def test_a_run_with_springs_restarts_bit_for_bit(scheme, tmp_path):
    springs = [Spring(left, K, rest=lambda t: (0.1 * t, 0.0)), Spring(left, K, to=right)]
    scene = replace(pair(LinearElastic(1e6, 0.3, 1000.0), gap=0.002), springs=springs)
    whole = run(scene, 0.06, 6, scheme)
    skmpm.save(tmp_path / "half", run(scene, 0.03, 3, scheme))
    *_, state = simulate(scene, dt=0.01, until=0.06, scheme=scheme, start=skmpm.load(tmp_path / "half"))
    for name in ("x", "v", "F", "stress"):
        assert np.array_equal(getattr(whole, name), getattr(state, name))
    assert whole.report.energy == state.report.energy


def test_springs_may_change_with_the_stage():
    scene = pair()
    state = run(scene, 0.1, 5)
    new = replace(scene, springs=[Spring(everywhere, K)])
    *_, after = simulate(new, dt=0.02, until=0.2, scheme=MIDPOINT, start=skmpm.continued(scene, state, new))
    place = new.sprung[0].first
    moved = (after.x - new.initial_positions)[:, place.points]
    assert after.report.energy.springs == pytest.approx(0.5 * K * (moved**2 @ place.share).sum())


@pytest.mark.parametrize("scheme", [Scheme(), MIDPOINT, STATIC], ids=["backward Euler", "midpoint", "static"])
def test_the_energy_budget_closes_over_stages_with_other_springs(scheme):
    """What a stretched spring brings or takes with it is no work: the remainder has it."""
    alone = Scene([block()], cell=CELL, supports=[Support(lambda x: x[0] < 0.01)])
    stretched = replace(alone, springs=[Spring(lambda x: x[0] > 0.9, K, to=(3.0, 0.0), rest=0.5)])
    looser = replace(alone, springs=[replace(stretched.springs[0], stiffness=0.5 * K)])
    before, state = alone, initial(alone, scheme=scheme)
    for stage in (alone, stretched, looser, alone):
        state = step(stage, skmpm.continued(before, state, stage), 1e-3, scheme=scheme)
        before, energy = stage, state.report.energy
        assert (energy.springs > 0.1 * K) is bool(stage.springs)
        spent = energy.dissipated + energy.viscous + energy.plastic
        assert total(energy) + spent == pytest.approx(energy.external, abs=1e-9 * K)


def test_what_a_linear_run_keeps_is_not_that_of_other_springs():
    soft = LinearElastic(1e5, 0.3, 1000.0)
    scenes = [Scene([block(material=soft, velocity=(1.0, 0.0))], cell=CELL)]
    scenes += [replace(scenes[0], springs=[Spring(left, 100 * K * k)]) for k in (1.0, 2.0)]
    for old in scenes:
        for new in scenes:
            start = run(old, 0.02, 2, Scheme())
            kept, anew = (step(new, s, 0.01) for s in (start, replace(start, derived=None)))
            assert np.array_equal(kept.x, anew.x)


def test_a_disc_on_a_spring_is_not_indifferent_to_rotation():
    scene = Scene([Body(disc((0, 0), 1.0, spacing=0.1), STIFF)], cell=0.2)
    assert scene.indifferent_to_rotation[0]
    assert not replace(scene, springs=[Spring(lambda x: x[0] > 0.9, K)]).indifferent_to_rotation[0]


def test_preflight_and_repr_count_springs():
    scene = pair()
    assert "springs 1" in str(skmpm.preflight(scene, 1e-3)) and "springs 1" in repr(scene)
    assert "springs" not in str(skmpm.preflight(replace(scene, springs=()), 1e-3))


# Errors.


@pytest.mark.parametrize(
    ("spring", "words"),
    [
        ("stiff", ("spring 0 is a str", "skmpm.Spring")),
        (Spring(everywhere, 0.0), ("spring 0: stiffness = 0.0", "N/m2")),
        (Spring(everywhere, (0.0, 0.0)), ("spring 0: stiffness", "not zero")),
        (Spring(everywhere, (1.0, -1.0)), ("spring 0: stiffness = -1",)),
        (Spring(everywhere, (1.0, 1.0, 1.0)), ("spring 0: stiffness", "one per direction")),
        (Spring(left, (1.0, 1.0), to=right), ("spring 0: stiffness",)),
        (Spring(lambda x: x[0] > 99, K), ("spring 0: where is true at no point",)),
        (Spring(left, K, to=lambda x: x[0] > 99), ("spring 0: to is true at no point",)),
        (Spring(left, K, to=everywhere), ("spring 0: where and to have points in common",)),
        (Spring(left, K, to=(1.0, 2.0, 3.0)), ("spring 0: to",)),
        (Spring(left, K, to=right, rest=-1.0), ("spring 0: rest = -1 m",)),
        (Spring(left, K, to=right, rest="short"), ("spring 0: rest",)),
        (Spring(left, K, rest=lambda t: 1.0), ("spring 0: rest at t = 0 s",)),
        (Spring(0.0, K), ("spring 0: where", "function of positions")),
    ],
)
def test_errors_name_the_spring_and_the_remedy(spring, words):
    with pytest.raises(SceneError) as error:
        replace(pair(), springs=[spring])
    for word in words:
        assert word in str(error.value)


def test_a_bar_without_length_at_the_start_is_refused():
    at = tuple(np.average(block().points.x, axis=1, weights=block().points.volume))
    with pytest.raises(SceneError, match="same position at t = 0"):
        Scene([block()], cell=CELL, springs=[Spring(everywhere, K, to=at)])


def test_a_bar_takes_its_length_between_bodies_that_nothing_else_holds():
    """Without inertia, too: both move by half of what it lacks."""
    scene = pair(rest=1.9)
    state = step(scene, initial(scene, scheme=STATIC), 1.0, scheme=STATIC)
    ends = [(state.x - scene.initial_positions)[0, state.body == b].mean() for b in (0, 1)]
    assert ends == pytest.approx([0.05, -0.05], abs=1e-4)
    assert np.abs(spring_forces(scene, state)).max() < 1e-3 * 0.1 * K


# Only what a scene requires.


def test_a_scene_without_springs_calls_none_of_them():
    def calls(scene):
        start = initial(scene)
        with Calls() as found:
            step(scene, start, 1e-2)
        return sum(
            found.below(name)
            for name in (
                *(f"skmpm.step.forces.{kind}" for kind in ("Springs", "Beds", "Bars")),
                "skmpm.linear.corrected",
            )
        )

    assert calls(replace(pair(), springs=())) == 0
    assert calls(pair()) > 0


# --- what messages advise


def bonded_cover(angle, supports):
    """A cover of radii 1 and 1.5 whose inner boundary points are turned by `angle` by t = 1, by a bed at each."""
    n, radii = 80, np.linspace(1.0, 1.5, 7)
    x = (radii[:, None] * np.exp(2j * np.pi / n * np.arange(n))).ravel()
    layer, along = n * np.arange(6)[:, None], np.arange(n)
    corners = (layer + along, layer + n + along, layer + n + (along + 1) % n, layer + (along + 1) % n)
    quads = np.stack([corner.ravel() for corner in corners], axis=1)
    cover = from_mesh(meshio.Mesh(np.stack([x.real, x.imag], axis=1), [("quad", quads)]))
    inner = cover.x[:, np.hypot(*cover.x) < 1.0 + 1e-6]

    def bed(place):
        z = complex(*place)

        def rest(t):
            moved = (np.exp(1j * angle * t) - 1.0) * z
            return moved.real, moved.imag

        return Spring(lambda x: np.hypot(x[0] - z.real, x[1] - z.imag) < 1e-6, 1e7, rest=rest)

    material, (c, s) = NeoHookean(1e6, 0.3, 1000.0), (np.cos(angle), np.sin(angle))
    turned = np.array([[c, -s], [s, c]]) @ inner
    scene = Scene([Body(cover, material)], cell=0.08, springs=[bed(place) for place in inner.T], supports=supports)
    *_, state = simulate(scene, dt=0.2, until=1.0, scheme=Scheme(inertia=False))
    fx, fy = spring_forces(scene, state).T
    torque = float((turned[0] * fy - turned[1] * fx).sum())
    return cover.x, state, torque


def test_beds_at_its_boundary_points_turn_a_bonded_cover():
    """Free outside, it turns by half a radian without stress."""
    x, state, torque = bonded_cover(0.5, ())
    z = np.exp(0.5j) * (x[0] + 1j * x[1])
    assert np.hypot(state.x[0] - z.real, state.x[1] - z.imag).max() < 1e-9
    assert np.abs(state.stress).max() < 1e-3 and abs(torque) < 1e-3


def test_beds_that_turn_a_bonded_cover_bear_its_torque():
    """Held outside: T = 4 pi G angle / (1 / a^2 - 1 / b^2) (Timoshenko & Goodier), to 2 % with six cells across."""
    _, _, torque = bonded_cover(0.01, [Support(lambda x: np.hypot(*x) > 1.5 - 1e-6)])
    exact = 4.0 * np.pi * 1e6 / 2.6 * 0.01 / (1.0 - 1.0 / 1.5**2)
    assert abs(torque) == pytest.approx(exact, rel=2e-2)


def test_beds_with_a_moving_rest_or_bars_are_bolts():
    """Two beds that each pull down one end of a flange: k (gap - drop of its end) on the gasket; two short bars.

    Then further, so that the gasket buckles beside a line that guides it.
    """
    k, gap = 2e6, 1e-3
    gasket = Body(box((-0.01, 0.0), (0.02, 5e-3), spacing=5e-4), NeoHookean(3e6, 0.45, 1100.0))
    flange = Body(box((-0.02, 5e-3), (0.04, 4e-3), spacing=5e-4), NeoHookean(2e9, 0.3, 2000.0))
    ends = [lambda x, s=s: (s * x[0] > 0.02 - 1e-6) & (x[1] > 5e-3 - 1e-9) for s in (-1, 1)]
    middle = Support(lambda x: (np.abs(x[0]) < 3e-4) & (x[1] > 9e-3 - 1e-9), velocity=(0.0, None))
    guide = Support(lambda x: (np.abs(x[0]) < 3e-4) & (np.abs(x[1] - 3e-3) < 2e-3 - 1e-9), velocity=(0.0, None))

    def clamped(springs, *guides, friction=0.3):
        scene = Scene(
            [gasket, flange],
            cell=1e-3,
            springs=springs,
            supports=[middle, *guides],
            walls=[Wall((0, 0), (0, 1))],
            friction=friction,
        )
        *_, state = simulate(scene, dt=0.2, until=1.0, scheme=Scheme(inertia=False))
        return scene, state

    bars = [Spring(end, k, to=(s * 0.02, -0.02), rest=0.026) for end, s in zip(ends, (-1, 1), strict=True)]
    scene, state = clamped(bars)
    span = [np.hypot(*(state.x[:, bar.where(scene.initial_positions)].mean(axis=1) - bar.to)) for bar in bars]
    assert np.hypot(*spring_forces(scene, state).T) == pytest.approx(k * (np.array(span) - 0.026), rel=1e-3)
    assert abs(state.wall_force[0, 1]) == pytest.approx(-spring_forces(scene, state)[:, 1].sum(), rel=1e-3)
    scene, state = clamped([Spring(end, (1e3, k), rest=lambda t: (0.0, -gap * t)) for end in ends])
    forces = spring_forces(scene, state)[:, 1]
    drop = [-(state.x - scene.initial_positions)[1, end(scene.initial_positions)].mean() for end in ends]
    assert -forces == pytest.approx(k * (gap - np.array(drop)), rel=1e-2)
    assert abs(state.wall_force[0, 1]) == pytest.approx(-forces.sum(), rel=1e-3)
    further = [Spring(end, (1e3, k), rest=lambda t: (0.0, -3.0 * gap * t)) for end in ends]
    scene, state = clamped(further, guide, friction=0.1)
    assert abs(state.wall_force[0, 1]) == pytest.approx(-spring_forces(scene, state)[:, 1].sum(), rel=1e-3)


def test_forces_at_a_state_of_another_scene_are_refused():
    scene = Scene([block()], cell=CELL, springs=[Spring(everywhere, K)])
    with pytest.raises(SceneError, match="spring_forces: expected a State, got None"):
        spring_forces(scene, None)


@pytest.mark.parametrize("stiffness", [1e6, 1e9])
def test_a_bar_bears_the_weight_of_a_disc_while_gravity_turns(stiffness):
    """However stiff it is: a translation by 1e-4 cells, to balance momentum, changed its force by five weights."""
    gum, centre = NeoHookean(E=1e5, nu=0.3, density=100.0), np.array([0.0, -5.0])
    body = Body(disc(tuple(centre), 1.0, spacing=0.13), gum)
    hub = Spring(lambda x: np.hypot(*(x - centre[:, None])) < 0.4, stiffness, to=(0.0, 0.0))

    def gravity(X, t):
        return 9.81 * np.array([[np.sin(0.1 * t)], [-np.cos(0.1 * t)]]) * np.ones_like(X)

    scene, static = Scene([body], cell=0.2, springs=[hub], gravity=gravity), Scheme(inertia=False)
    state = initial(scene, scheme=static)
    for _ in range(3):
        state = step(scene, state, 1.0, scheme=static)
        force, place = spring_forces(scene, state)[0], state.centres[:, 0]
        assert -force @ place / np.hypot(*place) == pytest.approx(9.81 * state.mass.sum(), rel=2e-3)
        assert np.arctan2(place[0], -place[1]) == pytest.approx(0.1 * state.t, abs=2e-3)
