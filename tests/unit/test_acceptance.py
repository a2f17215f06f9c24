"""Acceptance checks of a solved step."""

import sys
from dataclasses import replace
from functools import partial, wraps
from pathlib import Path

import numpy as np
import pytest

from skmpm import (
    Body,
    NeoHookean,
    Rigid,
    Scene,
    Scheme,
    StepFailed,
    Support,
    Wall,
    box,
    disc,
    initial,
    observe,
    simulate,
    step,
)
from skmpm.contact import point_to_curve, shared_grid
from skmpm.step.acceptance import _exchanged_at_contacts, check_step
from skmpm.step.errors import StepRejected
from skmpm.step.terms import Budget

sys.path.append(str(Path(__file__).parents[1] / "verification"))
from sectors import sector

GUM = NeoHookean(1e6, 0.3, 1000.0)


def ring(gap=0.5, thickness=0.2):
    """A ring of mean radius 1 m that is open to the right."""
    half = 0.5 * thickness
    return sector(1.0 - half, 1.0 + half, 0.5 * gap, 2.0 * np.pi - 0.5 * gap, spacing=thickness / 4)


def between_bodies(*arguments):
    """Point-to-curve contact without that of a body with itself."""
    linearise = point_to_curve(*arguments)

    def others(w):
        found = linearise(w)
        return found.among(found.bodies[0] != found.bodies[1])

    return others


@pytest.mark.parametrize("by", ["walls", "supports"])
def test_a_closing_ring_that_passes_through_itself_is_an_error(by):
    """With a contact law between bodies only; the arms once did so with an overlap of zero."""
    if by == "walls":
        walls = [Wall((0, -1.1), (0, 1)), Wall((0, 1.1), (0, -1), velocity=(0, -2.0))]
        scene = Scene([Body(ring(), GUM)], cell=0.09, walls=walls)
    else:

        def end(sign):
            return lambda x: (x[0] > 0.85) & (sign * x[1] > 0.0)

        held = [Support(end(s), velocity=(0.0, -s * 0.3)) for s in (1.0, -1.0)]
        scene = Scene([Body(ring(), GUM)], cell=0.09, supports=held)
    crossed = r"body 0: its outline crosses itself near .* m, 0\.2[5-9]\d* cells deep; use a smaller cell"
    last = None
    with pytest.raises(StepFailed, match=crossed) as failure:
        for state in simulate(scene, dt=4e-3, until=2.0, scheme=Scheme(contact=between_bodies)):
            last = state
    assert failure.value.state is last
    assert 0.2 < last.t < 1.9
    assert observe(scene, last).overlap == 0.0


def test_a_rigid_body_may_be_bent():
    """What does not deform is not looked at, whatever its shape."""
    hook = Body(ring(), Rigid(1000.0), motion=(0.1, 0.0, 0.0))
    disc = Body(sector(0.2, 0.3, 0.1, 3.0, spacing=0.03), GUM)
    *_, state = simulate(Scene([hook, disc], cell=0.05), dt=1e-3, until=5e-3)
    assert state.t == 5e-3


# What every step fulfils that changes no energy.
NO_GAIN = Budget(elastic=np.array([1.0, 1.0]))


def stored(elastic):
    """The energies of a step that ends with other elastic energy than 1."""
    return replace(NO_GAIN, elastic=np.array([1.0, elastic]))


def test_an_overlap_is_not_removed_at_any_price():
    """By more than all energy and work: refused at once, as shorter steps push harder; round-off is exempt."""
    scene = Scene([Body(disc((x, 0.0), 1.0, spacing=0.3), GUM) for x in (0.0, 2.1)], cell=0.4)
    state = initial(scene)
    pushed = replace(NO_GAIN, external=-0.5, overlap=2e-3 * scene.cell, overlapping=np.array([1, 0]))
    check_step(scene, Scheme(), state, state, replace(pushed, push_out=1.49))
    check_step(scene, Scheme(), state, state, replace(pushed, push_out=9.0, overlap=0.9e-3 * scene.cell))
    with pytest.raises(StepRejected, match=r"bodies 1 and 0: they overlap by 0.002 cells.* takes 2 times") as error:
        check_step(scene, Scheme(), state, state, replace(pushed, push_out=3.0))
    assert not error.value.retryable


@wraps(point_to_curve)
def wrapped(*arguments):
    return point_to_curve(*arguments)


@pytest.mark.parametrize(
    "law",
    [point_to_curve, wrapped, partial(point_to_curve), lambda *arguments: point_to_curve(*arguments)],
    ids=["itself", "wrapped", "partial", "lambda"],
)
def test_gaps_are_checked_whatever_a_contact_law_is_wrapped_in(law):
    """Half a cell in one another fails a step, a tenth of a cell behind a wall with every law between outlines."""
    discs = [Body(disc((x, 0.0), 1.0, spacing=0.125), GUM) for x in (0.0, 2.01)]
    scene = Scene(discs, cell=0.25, walls=[Wall((0, -1.01), (0, 1))])
    *_, state = simulate(scene, dt=1e-4, until=1e-4, scheme=Scheme(contact=law))
    nodes = Scheme(contact=shared_grid, anchor=0.0)
    behind = replace(state, x=state.x + np.array([[0.0], [-0.035]]))
    with pytest.raises(StepRejected, match=r"body 0 and wall 0 near \(-?0.0\d*, -1.03\d+\) m: .* behind the wall"):
        check_step(scene, Scheme(contact=law), state, behind, NO_GAIN)
    check_step(scene, nodes, state, behind, NO_GAIN)
    together = np.where(state.body == 0, 0.5, -0.5) * 0.25 * np.array([[1.0], [0.0]])
    for scheme in (Scheme(contact=law), nodes):
        with pytest.raises(StepRejected, match=r"bodies 0 and 1.*overlap by"):
            check_step(scene, scheme, state, replace(state, x=state.x + together), NO_GAIN)


def rolled(angle, wall=(0.0, 0.0)):
    """A disc pressed on a floor by 3 N/m, before and after a step in which it rolls by an angle [rad]; both move."""
    scene = Scene([Body(disc((0.0, 1.0), 1.0, spacing=0.125), GUM)], cell=0.25, walls=[Wall((0, 0), (0, 1))])
    state = initial(scene)
    contacts = replace(
        state.contacts, bodies=np.array([[0], [-1]]), x=np.zeros((2, 1)), normal=np.array([[0.0], [1.0]]),
        force=np.array([[3.0], [0.0]]), gap=np.zeros(1), key=np.zeros(1, dtype=np.int64),
        point=np.zeros(1, dtype=np.int64), image=np.zeros((2, 1)),
    )  # fmt: skip
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    centre = np.array([[0.0], [1.0]])
    x = centre + turn @ (state.x - centre) + np.array([[angle], [0.0]]) + np.reshape(wall, (2, 1))
    contacts = replace(contacts, x=np.array([[angle], [0.0]]) + np.reshape(wall, (2, 1)))
    return scene, state, replace(state, x=x, walls=state.walls + wall, contacts=contacts)


def test_what_a_rolling_disc_exchanges_is_its_weight_times_the_path():
    """F R phi along the floor and as much by rotation, to 1 %; nothing where the floor carries it."""
    _, before, after = rolled(0.01)
    assert _exchanged_at_contacts(before, after) == pytest.approx(2.0 * 3.0 * 0.01, rel=1e-2)
    _, before, after = rolled(0.0, wall=(0.3, 0.2))
    assert abs(_exchanged_at_contacts(before, after)) < 1e-12
    _, before, carried = rolled(0.01, wall=(0.3, 0.2))
    assert _exchanged_at_contacts(before, carried) == pytest.approx(2.0 * 3.0 * 0.01, rel=1e-2)


def test_a_gain_is_a_share_of_what_is_exchanged_at_contacts():
    """Of 0.06 J/m a hundredth may be gained, where the works of all forces cancel, and not more."""
    scene, before, after = rolled(0.01)
    check_step(scene, Scheme(), before, after, stored(1.0 + 5e-4))
    with pytest.raises(StepRejected, match=r"gain energy without work, 1.2 % of the energy exchanged"):
        check_step(scene, Scheme(), before, after, stored(1.0 + 7e-4))


def test_gains_of_earlier_steps_count_where_the_scheme_dissipates_nothing():
    """4.9 % before and 0.2 % now are refused, for good; not 0.2 % alone, nor what is the swing of a vibration."""
    (scene, before, after), scheme = rolled(0.01), Scheme(theta=0.5)
    gained = replace(before.report, energy=replace(before.report.energy, gained=0.049))
    step = stored(1.002)
    with pytest.raises(StepRejected, match=r"have gained 5.1 % of their largest energy without work") as error:
        check_step(scene, scheme, replace(before, report=gained), after, step)
    assert not error.value.retryable
    check_step(scene, scheme, before, after, step)
    check_step(scene, scheme, replace(before, report=gained), after, replace(step, swing=0.002))


def test_a_disc_that_a_plate_sets_rolling_is_not_made_to_repeat_steps():
    """Rolling takes no work; a criterion of the work alone repeated 13 of 100 steps.

    Its speed is a third of the plate's: v + omega R = V, and m v R = I omega with I = m R^2 / 2.
    """
    gel = NeoHookean(1e6, 0.45, 1000.0)
    scene = Scene(
        [Body(disc((0.0, 1e-3), 1e-3, spacing=1e-3 / 6), gel)], cell=2e-4, friction=0.5, gravity=(0.0, -9.81),
        walls=[Wall((0, 0), (0, 1), velocity=(0.1, 0.0))],
    )  # fmt: skip
    states = list(simulate(scene, dt=1e-4, until=1e-2))
    assert sum(state.report.retries for state in states) == 0
    assert states[-1].v[0] @ states[-1].mass / states[-1].mass.sum() == pytest.approx(0.1 / 3.0, rel=0.02)


@pytest.mark.parametrize("dt", [1e-6, 1e-12, 2e-15])
def test_a_short_step_adds_no_energy(dt):
    """Of two discs that collide: an overlap of 1e-12 m that longer steps leave is not removed at 1e-12 m over dt.

    Implicit steps dissipate energy in proportion to dt, 3 % a wave's transit of a cell.
    """
    bodies = [
        Body(disc(centre, 0.01, spacing=0.0015), GUM, velocity=(0.0, speed))
        for centre, speed in (((0.0, 0.0), 0.5), ((0.003, 0.0202), -0.5))
    ]
    scene = Scene(bodies, cell=0.002, friction=0.3)
    *_, state = simulate(scene, dt=2e-5, until=1e-3)
    assert -1e-8 * scene.cell < state.contacts.gap.min() < 0.0
    assert state.contacts.force[0].max() > 50.0
    before, after = (s.report.energy for s in (state, step(scene, state, dt)))
    change = after.kinetic + after.elastic - before.kinetic - before.elastic
    size = before.kinetic + before.elastic
    assert -0.03 * dt * scene.fastest_wave / scene.cell * size - 1e-7 * size < change < 1e-7 * size


def test_a_held_rigid_body_may_pass_a_wall_that_it_does_not_touch():
    """At 1.5 cells a step, less than the thickness of all bodies allows; with the wall the step was rejected."""
    still = Body(disc((0.0, 30.0), 6.0, spacing=0.5), GUM)
    block = Body(box((-4.0, -12.0), (8.0, 8.0), spacing=0.5), Rigid(1.0), motion=(0.0, -1.5, 0.0))
    scene = Scene([still, block], cell=1.0, walls=[Wall((0.0, 0.0), (0.0, 1.0))])
    assert scene.max_motion > 1.5
    assert step(scene, initial(scene), 1.0).t == 1.0
