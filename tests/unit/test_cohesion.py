"""Cohesion of contacts: lengths, strength in tension and shear, conservation, restart, nothing where it is off."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from skmpm import contact, preflight
from skmpm.contact import point_to_curve, shared_grid
from skmpm.io import load, save
from skmpm.material import LinearElastic, NeoHookean, Rigid
from skmpm.observe import observe
from skmpm.points import Points, box, disc
from skmpm.scene import Body, Scene, SceneError, StepFailed, Support, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.algorithm import step
from skmpm.step.contact_scale import contact_scale
from skmpm.step.initial_state import initial

CELL, WIDTH, HEIGHT, G, DENSITY, E = 0.1, 1.0, 0.6, 10.0, 1000.0, 1e6
WEIGHT = DENSITY * G * WIDTH * HEIGHT  # [N/m]
STRESS = WEIGHT / WIDTH  # at the top of a hanging block [Pa]
TILT, OFFSET = 0.4, np.array([0.3, 0.7]) * CELL
SOFT = NeoHookean(E, 0.0, DENSITY)  # nu = 0: a hanging block is in uniaxial stress


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def placed(points, tilt):
    """Points turned about the origin and moved off the grid lines; `tilt` of zero leaves them."""
    move = OFFSET if tilt else np.zeros(2)
    return Points(rotation(tilt) @ points.x + move[:, None], points.volume, points.outline)


def block(bottom, *, left=0.0, width=WIDTH, spacing=0.5 * CELL, tilt=0.0, material=SOFT, height=HEIGHT, **motion):
    return Body(placed(box((left, bottom), (width, height), spacing=spacing), tilt), material, **motion)


def ceiling(tilt=0.0, **law):
    return Wall(OFFSET if tilt else (0.0, 0.0), rotation(tilt) @ [0.0, -1.0], **law)


def growing(tilt, until, size=G):
    """Gravity that grows to `size` at `until` [s]."""
    down = rotation(tilt) @ [0.0, -size]
    return lambda X, t: np.repeat(down[:, None] * min(t / until, 1.0), X.shape[1], axis=1)


def hanging(c, below, *, tilt=0.0, spacing=0.5 * CELL, friction=0.5, material=SOFT):
    """A block under a wall, a held block or a rigid one, with gravity that grows over 0.1 s."""
    lower = block(-HEIGHT, tilt=tilt, spacing=spacing)
    options = {"cell": CELL, "gravity": growing(tilt, 0.1)}
    if below == "wall":
        return Scene([lower], walls=[ceiling(tilt, friction=friction, cohesion=c)], **options)
    if below == "rigid":
        upper = block(0.0, tilt=tilt, spacing=spacing, material=Rigid(DENSITY), motion=(0.0, 0.0, 0.0))
        return Scene([upper, lower], friction=friction, cohesion=c, **options)
    upper, normal = block(0.0, tilt=tilt, spacing=spacing), rotation(tilt) @ [0.0, 1.0]
    top = HEIGHT - 1e-9 + normal @ (OFFSET if tilt else np.zeros(2))
    return Scene(
        [upper, lower], supports=[Support(lambda X: normal @ X > top)], friction=friction, cohesion=c, **options
    )


def strengths(scene, state):
    """The constraints of a state, with their tensile strengths."""
    grid = state.grids.assembly.grid
    return point_to_curve(scene, state, grid, 1e-6)(np.zeros(2 * grid.nodes))


def last(scene, *, dt, until, **options):
    """The last state of a run."""
    *_, state = simulate(scene, dt=dt, until=until, scheme=Scheme(**options))
    return state


# Lengths


@pytest.mark.parametrize("tilt", [0.0, TILT])
@pytest.mark.parametrize("spacing", [0.5, 0.37])
@pytest.mark.parametrize(
    "left, width, covered",
    [(0.0, 1.0, 1.0), (0.21, 0.43, 0.43), (-0.4, 1.0, 0.6), (0.983, 1.0, 0.017)],
)
def test_contact_lengths_add_up_to_the_common_length(tilt, spacing, left, width, covered):
    """Two blocks, one on a part of the other: sum c l = c times the common length, whichever gives the points."""
    for fine in (0.5, 0.31):
        lower = block(-HEIGHT, tilt=tilt, spacing=fine * CELL)
        upper = block(0.0, left=left, width=width, tilt=tilt, spacing=spacing * CELL)
        for bodies in ([lower, upper], [upper, lower]):
            scene = Scene(bodies, cell=CELL, cohesion=3.0)
            found = strengths(scene, initial(scene))
            assert found.tensile_strength.sum() == pytest.approx(3.0 * covered, rel=1e-9)


@pytest.mark.parametrize("gap", [0.9, 1.0, 3.2])
def test_a_range_of_several_cells_acts_along_the_whole_gap(gap):
    """From a gap of one cell on, only the corners of the blocks attracted each other."""
    bodies = [block(-HEIGHT - gap * CELL), block(0.0)]
    scene = Scene(bodies, cell=CELL, cohesion=3.0, cohesion_range=1.1 * gap * CELL)
    assert strengths(scene, initial(scene)).tensile_strength.sum() == pytest.approx(3.0 * WIDTH, rel=1e-9)


def test_a_disc_on_a_wall_has_one_spacing_or_the_zone_in_range():
    """Without range the point that touches has its two half segments; with one, the zone of gaps below it.

    The zone of a disc of radius R ends where 1 - sqrt(1 - (b / R)^2) = range / R; gaps are linear between points.
    """
    points, touching = disc((0.0, 0.0), 1.0, spacing=0.05), Wall((1.0, 0.0), (-1.0, 0.0), cohesion=2.0)
    chord = 2.0 * np.sin(np.pi / points.outline[0].size)
    for range_, length in ((0.0, chord), (0.02, 2.0 * np.arccos(0.98)), (0.005, 2.0 * np.arccos(0.995))):
        scene = Scene([Body(points, SOFT)], cell=CELL, walls=[touching], cohesion_range=range_)
        found = strengths(scene, initial(scene))
        assert found.tensile_strength.sum() == pytest.approx(2.0 * length, rel=5e-3 if range_ else 1e-9)


def test_two_discs_have_the_zone_of_their_common_curvature():
    """Two discs with a range: half width where the gap 2 (1 - sqrt(1 - b^2)) R is in range."""
    bodies = [Body(disc((0.0, y), 1.0, spacing=0.05), SOFT) for y in (-1.0, 1.0)]
    scene = Scene(bodies, cell=CELL, cohesion=2.0, cohesion_range=0.02)
    found = strengths(scene, initial(scene))
    assert found.tensile_strength.sum() == pytest.approx(4.0 * np.arccos(0.99), rel=0.02)


def wet_pair(angle, gap):
    """Two discs of R/h = 4.4 whose centres lie at an angle, with a range of a tenth of the radius."""
    radius, cell = 5e-3, 1.125e-3
    along, gel = np.array([np.cos(angle), np.sin(angle)]), NeoHookean(1e5, 0.4, 1000.0, viscosity=4.0)
    centres = (side * (radius + 0.5 * gap) * along for side in (-1.0, 1.0))
    bodies = [Body(disc(tuple(x), radius, spacing=0.5 * cell), gel) for x in centres]
    return Scene(bodies, cell=cell, friction=0.3, cohesion=200.0, cohesion_range=0.1 * radius)


@pytest.mark.parametrize("motion", ["turns", "opens", "slides off"])
def test_tension_is_that_of_the_start_of_the_step_in_all_iterates(motion):
    """Contacts that bear tension, and their strengths, in iterates that turn, part or shift the second body.

    Discs had lengths by the normals of the iterate; contacts beyond detection or the end of a side lost theirs.
    """
    if motion == "slides off":
        scene = Scene([block(-HEIGHT - 0.1 * CELL), block(0.0)], cell=CELL, cohesion=3.0, cohesion_range=0.2 * CELL)
    else:
        scene = wet_pair(np.radians(0.9), 0.0)
    state, dt = initial(scene), 1e-3
    grid = state.grids.assembly.grid
    linearise, second = point_to_curve(scene, state, grid, dt), grid.node_body == 1
    arms = grid.position - grid.position[:, second].mean(axis=1, keepdims=True)
    velocity = {
        "turns": 0.05 * np.stack([-arms[1], arms[0]]) / np.abs(arms).max() * scene.cell,
        "opens": np.full(arms.shape, 3.0 * scene.cohesion_range),
        "slides off": np.stack([np.full(arms.shape[1], 0.3 * scene.cell), np.zeros(arms.shape[1])]),
    }[motion] / dt
    found = [linearise(np.where(second, factor * velocity, 0.0).T.ravel()) for factor in (0.0, -1.0, 1.0)]
    tension = [dict(zip(c.key[bears], c.tensile_strength[bears], strict=True)) for c in found
               for bears in [c.tensile_strength > 0.0]]  # fmt: skip
    assert tension[0]
    assert tension[0] == tension[1] == tension[2]


@pytest.mark.parametrize("angle, gap", [(0.015636587550950647, 0.0), (1.553038997973427, 1e-4)])
def test_steps_of_discs_with_a_range_converge_at_any_angle(angle, gap):
    """At these two of 200 angles a segment was in contact in every other iterate, and no step converged."""
    scene = wet_pair(angle, gap)
    assert step(scene, initial(scene), 1e-4).report.newton <= 4


def test_bodies_out_of_range_do_not_attract():
    scene = Scene([block(-HEIGHT - 2e-3 * CELL), block(0.0)], cell=CELL, cohesion=1e3)
    found = strengths(scene, initial(scene))
    assert found.size > 0
    assert not found.tensile_strength.any()


def test_bodies_in_range_attract_from_any_gap_in_it():
    """Blocks 0.12 cells apart with a range of 0.2 cells: c L pulls both, with inertia, and does the work c L gap."""
    scene = Scene([block(-HEIGHT - 0.12 * CELL), block(0.0)], cell=CELL, cohesion=1e2, cohesion_range=0.2 * CELL)
    state = step(scene, initial(scene), 1e-3)
    assert state.contacts.force[0].sum() == pytest.approx(-1e2 * WIDTH, rel=1e-6)
    closed = 0.12 * CELL - np.average(state.contacts.gap, weights=-state.contacts.force[0])
    assert state.report.energy.cohesion == pytest.approx(1e2 * WIDTH * closed, rel=1e-6)


# Strength


@pytest.mark.parametrize("below", ["wall", "body", "rigid"])
@pytest.mark.parametrize("tilt", [0.0, TILT])
def test_a_block_hangs_by_a_cohesion_of_its_weight_and_falls_by_less(below, tilt):
    """Quasi-static: c L = 1.01 W carries the block, exactly its weight; 0.99 W does not, by limit analysis.

    Aligned to a wall or a rigid block it falls in a run, which repeats its last step with shorter ones, else in one
    step alone.
    """
    state = last(hanging(1.01 * STRESS, below, tilt=tilt), dt=0.02, until=0.16, inertia=False)
    assert state.contacts.force[0].sum() == pytest.approx(-WEIGHT, rel=1e-3)
    assert state.contacts.force[0].max() < 0.02 * WEIGHT
    weak = hanging(0.99 * STRESS, below, tilt=tilt)
    alone = tilt or below == "body"
    before = last(weak, dt=0.02, until=0.08, inertia=False) if alone else None
    with pytest.raises(StepFailed, match=r"no equilibrium was found: it (separates|falls)"):
        if alone:
            step(weak, before, 0.02, scheme=Scheme(inertia=False))
        else:
            last(weak, dt=0.02, until=0.16, inertia=False)


@pytest.mark.parametrize("theta", [1.0, 0.5])
@pytest.mark.parametrize("below", ["wall", "body"])
def test_with_inertia_a_block_hangs_or_falls_freely(below, theta):
    """Gravity grows in two thirds of the column's period: 1.6 W carries the block, with 0.8 W it falls with g."""
    for factor, hangs in ((1.6, True), (0.8, False)):
        scene = hanging(factor * STRESS, below)
        states = list(simulate(scene, dt=0.005, until=0.3, scheme=Scheme(theta=theta)))
        lower = states[-1].body == len(scene.bodies) - 1
        fallen = states[-1].x[1, lower].mean() - scene.initial_positions[1, lower].mean()
        v = np.array([s.v[1, lower] @ s.mass[lower] / s.mass[lower].sum() for s in states])
        if hangs:
            assert abs(fallen) < 0.2 * CELL
            assert np.mean([s.contacts.force[0].sum() for s in states[30:]]) == pytest.approx(-WEIGHT, rel=0.05)
        else:
            assert fallen < -1.0 * CELL
            assert (v[-1] - v[-11]) / 0.05 == pytest.approx(-G, rel=1e-6)


@pytest.mark.parametrize("tilt", [0.0, TILT])
def test_cohesion_bears_shear_without_normal_force(tilt):
    """Weightless block on a wall with friction mu, pulled along it: it slips at mu c L.

    The wall moves along itself and drags the block, which a support holds at its far side; the force grows to the
    limit and stays there.
    """
    mu, c = 0.6, 2e3
    along, out = rotation(tilt).T
    along, out = rotation(tilt) @ [1.0, 0.0], rotation(tilt) @ [0.0, 1.0]
    origin = OFFSET if tilt else np.zeros(2)
    held = Support(lambda X: out @ (X - origin[:, None]) > HEIGHT - 1e-9)
    wall = Wall(origin, out, velocity=0.01 * along, friction=mu, cohesion=c)
    scene = Scene([block(0.0, tilt=tilt)], cell=CELL, walls=[wall], supports=[held])
    states = list(simulate(scene, dt=0.02, until=0.6, scheme=Scheme(inertia=False)))
    drag = np.array([-along @ s.wall_force[0] for s in states])
    assert drag[1] < 0.9 * mu * c * WIDTH
    assert drag[-5:] == pytest.approx(mu * c * WIDTH, rel=0.01)
    assert abs(out @ states[-1].wall_force[0]) < 0.02 * c * WIDTH


# Conservation, restart


def pair(theta=1.0, **law):
    """Two tilted blocks that are thrown apart, slower than their cohesion can stop."""
    law = {"friction": 0.5, "cohesion": 2e3} | law
    apart = rotation(TILT) @ [0.0, 0.05]
    bodies = [block(-HEIGHT, tilt=TILT, velocity=-apart), block(0.0, left=0.23, tilt=TILT, velocity=apart, spin=0.02)]
    return Scene(bodies, cell=CELL, **law)


@pytest.mark.parametrize("theta", [1.0, 0.5])
def test_momentum_is_conserved_and_the_energy_budget_closes(theta):
    """Momentum to rounding although contacts pull; backward Euler never gains energy beyond the work of cohesion."""
    scene, scheme = pair(), Scheme(theta=theta)
    start = initial(scene, scheme=scheme)
    momentum = start.v @ start.mass
    pulled = False
    for state in simulate(scene, dt=2e-3, until=0.1, scheme=scheme):
        assert np.abs(state.v @ state.mass - momentum).max() < 1e-11 * np.abs(start.v).max() * start.mass.sum()
        pulled |= bool((state.contacts.force[0] < 0.0).any())
    energy = state.report.energy
    supplied = energy.external + energy.push_out + energy.cohesion - energy.dissipated
    assert energy.kinetic + energy.elastic == pytest.approx(start.report.energy.kinetic + supplied, rel=1e-12)
    assert pulled
    if theta == 1.0:
        assert energy.dissipated > 0.0


def test_a_restart_is_bit_exact(tmp_path):
    scene = pair(cohesion_range=0.01 * CELL)
    states = list(simulate(scene, dt=2e-3, until=0.04))
    half = next(s for s in states if s.t > 0.019)
    save(tmp_path / "half.npz", half)
    *_, again = simulate(scene, dt=2e-3, until=0.04, start=load(tmp_path / "half.npz"))
    assert (states[-1].contacts.force[0] < 0.0).any()
    for name in ("x", "v", "F", "stress"):
        assert np.array_equal(getattr(states[-1], name), getattr(again, name))
    assert np.array_equal(states[-1].contacts.force, again.contacts.force)


def test_a_contact_that_has_opened_pulls_no_more():
    """Blocks thrown apart fast part in a few steps; then no force acts, although they stay within detection."""
    apart = np.array([0.0, 0.5])
    scene = Scene(
        [block(-HEIGHT, velocity=-apart), block(0.0, velocity=apart)], cell=CELL, cohesion=1e3, friction=0.5
    )
    states = list(simulate(scene, dt=2e-4, until=3e-3))
    assert (states[0].contacts.force[0] < 0.0).all()
    assert not states[-1].contacts.force.any()
    assert states[-1].contacts.gap.max() < 0.25 * CELL
    assert states[-1].report.energy.cohesion < 0.0


def test_residuals_are_relative_to_what_closes_and_what_tension_can_hold():
    """By hand, W = diag(2, 8): sizes min(u_n, W p) of opening contacts, and mu (p - u_n / W) in friction, scaled."""
    mu, p, dt = 0.5, np.array([0.0, 3.0, 3.0]), 0.1
    q = np.array([[-0.4, 5.0], [0.2, 5.0], [9.0, 5.0]])  # closes, is held, comes off
    contacts = SimpleNamespace(size=3, friction=np.full(3, mu), tensile_strength=p / dt, key=np.arange(3))
    scale = contact_scale(contacts, np.tile([2.0, 8.0], 3), q.ravel(), 0.0, dt)
    normal = np.array([0.4, 0.2, 2.0 * 3.0]) / np.sqrt(2.0)
    friction = np.minimum(5.0, mu * np.array([0.2, 3.0 - 0.1, 0.0]) * 8.0) / np.sqrt(8.0)
    assert scale.reference == pytest.approx(np.hypot(np.linalg.norm(normal), np.linalg.norm(friction)), rel=1e-12)


def test_contacts_whose_response_is_negative_do_not_count():
    """Indefinite matrices of bodies give contacts of negative W_nn: the others set the size of the problem."""
    q = np.array([-3.0, -4.0, -5.0])
    contacts = SimpleNamespace(size=3, friction=np.zeros(3), tensile_strength=np.zeros(3), key=np.arange(3))
    with np.errstate(all="raise"):
        scale = contact_scale(contacts, np.array([1.0, 4.0, -9.0]), q, 0.0, 0.1)
    assert scale.reference == pytest.approx(np.hypot(3.0, 4.0 / 2.0), rel=1e-12)
    assert scale.diagonal.min() > 0.0


# Packings


def test_a_cohesive_packing_stays_a_clump():
    """Seven touching discs in a spin: with cohesion they stay together, without they fly apart.

    The centrifugal force on a disc, m w^2 2 R, is a quarter of the strength of its contacts.
    """
    radius, cell = 1.0, 0.25
    centres = [(0.0, 0.0), *(2.0 * radius * np.array([np.cos(a), np.sin(a)]) for a in np.arange(6) * np.pi / 3)]

    def field(x):
        return 0.3 * np.stack([-x[1], x[0]])

    def gone(c):
        bodies = [
            Body(disc(y, radius, spacing=0.5 * cell), NeoHookean(E, 0.3, 100.0), velocity=field) for y in centres
        ]
        scene = Scene(bodies, cell=cell, friction=0.5, cohesion=c, cohesion_range=0.02)
        state = last(scene, dt=0.02, until=3.0)
        centre = observe(scene, state).bodies.centre
        return np.hypot(*(centre - centre.mean(axis=1, keepdims=True))).max(), scene, state

    far, _, _ = gone(0.0)
    near, scene, state = gone(2e3)
    assert far > 2.4 * radius
    assert near < 2.02 * radius
    assert (state.contacts.force[0] < 0.0).any()
    assert (observe(scene, state).bodies.coordination >= 1.0).all()


# Off, refused, warned of


def test_without_cohesion_nothing_of_it_runs(monkeypatch):
    """Zero cohesion never asks for lengths or shifts a cone, a range without cohesion changes nothing."""
    lifted = contact.Constraints.lifted

    def fail(*_):
        raise AssertionError("called without cohesion")

    def unchanged(constraints, r, dt):
        return r if lifted(constraints, r, dt) is r else fail()

    def run(**law):
        scene = Scene([block(-HEIGHT), block(0.0, velocity=(0.0, -0.1))], cell=CELL, friction=0.5, **law)
        return last(scene, dt=2e-3, until=0.02)

    with monkeypatch.context() as patch:
        patch.setattr(contact.boundary, "tensile_strength", fail)
        patch.setattr(contact.Constraints, "lifted", unchanged)
        plain, ranged = run(), run(cohesion_range=0.3 * CELL)
        with pytest.raises(AssertionError, match="without cohesion"):
            run(cohesion=1.0)
    assert plain.contacts.force.any()
    assert np.array_equal(plain.x, ranged.x)


def test_errors_name_the_object_the_value_and_the_remedy():
    for options, message in (
        ({"cohesion": -1.0}, "cohesion between bodies = -1.0; give a stress in Pa of zero or more"),
        ({"cohesion_range": np.inf}, "cohesion_range = inf; give a length in metres of zero or more"),
        ({"walls": [ceiling(cohesion="much")]}, "wall 0: cohesion = 'much' is not a number"),
    ):
        with pytest.raises(SceneError, match=message):
            Scene([block(-HEIGHT)], cell=CELL, **options)


def test_contact_at_shared_grid_nodes_refuses_cohesion():
    scene, scheme = hanging(1.0, "wall"), Scheme.nezamabadi2017()
    assert scheme.contact is shared_grid
    plain = initial(replace(scene, walls=[ceiling()]), scheme=scheme)
    for call in (
        lambda: initial(scene, scheme=scheme),
        lambda: step(scene, plain, 1e-3, scheme=scheme),
        lambda: preflight(scene, 1e-3, scheme=scheme),
    ):
        with pytest.raises(
            SceneError, match="the scene has cohesion, which contact = shared_grid cannot; use Scheme"
        ):
            call()


def test_preflight_names_cohesion_and_warns_of_what_was_not_verified():
    round_one = Body(disc((0.0, -1.0), 1.0, spacing=0.05), LinearElastic(E, 0.3, DENSITY))
    for bodies, law, said in (
        ([block(-HEIGHT)], {"cohesion": 1e3}, ()),
        ([block(-HEIGHT)], {"cohesion": 2e5}, ("body 0: cohesion = 200000 Pa is 0.2 of E", "use 1e+05 Pa")),
        (
            [block(-HEIGHT)],
            {"cohesion": 1e4},
            ("body 0: range is 0.1 of cohesion / E cells", "cohesion_range = 0.0005"),
        ),
        ([block(-HEIGHT)], {"cohesion": 1e4, "cohesion_range": 5e-4}, ()),
        ([round_one], {"cohesion": 1e3}, ("body 0: range covers 0 boundary points a side",)),
        ([round_one], {"cohesion": 1e3, "cohesion_range": 0.02}, ()),
    ):
        range_ = law.pop("cohesion_range", 0.0)
        text = str(preflight(Scene(bodies, cell=CELL, walls=[ceiling(**law)], cohesion_range=range_), 1e-4))
        assert f"cohesion up to {law['cohesion']:g} Pa" in text
        assert all(line in text for line in said)
        assert any(warning in text for warning in ("range covers", "is 0.2 of E", "range is")) == bool(said)


def test_more_walls_than_bodies_may_be_cohesive():
    """Walls have negative numbers, which are no indices of bodies."""
    walls = [ceiling(cohesion=3.0), Wall((0.0, -9.0), (0.0, 1.0)), Wall((-9.0, 0.0), (1.0, 0.0))]
    scene = Scene([block(-HEIGHT)], cell=CELL, walls=walls)
    assert strengths(scene, initial(scene)).tensile_strength.sum() == pytest.approx(3.0 * WIDTH, rel=1e-9)


def test_a_cohesive_wall_may_be_any_of_the_walls():
    """One of more walls than bodies raised an IndexError, unless it came first."""
    forces = []
    for before in range(4):
        body = Body(disc((0.0, 0.5), 0.5, spacing=CELL / 1.5), SOFT)
        far = [Wall((0.0, 20.0 + i), (0.0, -1.0)) for i in range(before)]
        floor = Wall((0.0, 0.0), (0.0, 1.0), cohesion=10.0)
        *_, state = simulate(Scene([body], cell=CELL, walls=[*far, floor], gravity=(0, -G)), dt=1e-3, until=2e-3)
        forces.append(state.wall_force[before, 1])
    assert forces[0] < 0.0
    assert forces[1:] == pytest.approx([forces[0]] * 3, rel=1e-12)


@pytest.mark.parametrize("theta", [0.5, 0.75])
def test_tension_across_an_open_gap_pulls_with_the_midpoint_rule_too(theta):
    """Its impulse is the strength up to round-off, and where it was above, the block stopped: 0.6 of its speed."""
    c, block = 500.0, box((0.0, 0.02), (1.0, 1.0), spacing=0.125)
    wall = Wall((0, 0), (0, 1), cohesion=c)
    scene = Scene([Body(block, NeoHookean(1e6, 0.3, 1000.0))], cell=0.25, walls=[wall], cohesion_range=0.05)
    for state in simulate(scene, dt=1e-3, until=0.03, scheme=Scheme(theta=theta)):
        assert state.mass @ state.v[1] == pytest.approx(-c * state.t, rel=1e-3)


def test_cohesive_discs_that_turn_about_each_other_hold_together():
    """Two discs with a range of a tenth of a cell: no step fails."""
    r, h, spin = 1e-2, 2e-3, 5.0
    gel = NeoHookean(1e5, 0.3, 1000.0)
    turning = [
        Body(disc((x, 0.0), r, spacing=0.5 * h), gel, velocity=lambda X: spin * np.stack([-X[1], X[0] - r]))
        for x in (0.0, 2.0 * r)
    ]
    scene = Scene(turning, cell=h, friction=0.5, cohesion=3e3, cohesion_range=2e-4)
    states = list(simulate(scene, until=0.03))
    assert sum(state.report.retries for state in states) == 0
    centres = [states[-1].x[:, states[-1].body == b].mean(axis=1) for b in range(2)]
    assert np.hypot(*(centres[1] - centres[0])) == pytest.approx(2.0 * r, rel=0.01)
