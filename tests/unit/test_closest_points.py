"""Contact points of light contacts, shifted to the closest points of smooth outlines, and of wide ones."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skmpm.contact import closest_points, point_to_curve
from skmpm.contact.shifts import MIN_SHIFT
from skmpm.material import NeoHookean, Rigid
from skmpm.points import Points, box, capsule, disc, polygon
from skmpm.scene import Body, Scene, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.initial_state import initial

R, CELL, DT = 1e-3, 0.2e-3, 1e-6
SPACING = R / 8
GEL = NeoHookean(1e6, 0.3, 1000.0)
SAGITTA = SPACING**2 / (8.0 * R)


def turned(centre, angle, radius=R, spacing=SPACING):
    """A disc turned by an angle about its centre."""
    points, rotation = disc((0.0, 0.0), radius, spacing=spacing), np.exp(1j * angle)
    z = rotation * (points.x[0] + 1j * points.x[1])
    return Points(np.stack([z.real + centre[0], z.imag + centre[1]]), points.volume, points.outline)


def contacts_of(scene, state=None):
    """The constraints of a scene at rest."""
    state = initial(scene) if state is None else state
    grid = state.derived.assembly.grid
    return point_to_curve(scene, state, grid, DT)(np.zeros(2 * grid.nodes))


@given(angle=st.floats(0.0, 6.28), gap=st.floats(-0.05, 0.05))
@settings(max_examples=20, deadline=None)
def test_the_contact_of_a_disc_and_a_wall_acts_at_its_lowest_point(angle, gap):
    """To the smallest shift, however the disc is turned; the cubic is off the circle by 0.003 sagittas."""
    scene = Scene([Body(turned((0.0, R + gap * SAGITTA), angle), GEL)], cell=CELL, walls=[Wall((0, 0), (0, 1))])
    found = contacts_of(scene)
    lowest = found.gap.argmin()
    assert abs(found.x[0, lowest]) < 1.01 * MIN_SHIFT * SPACING
    assert found.gap[lowest] == pytest.approx(gap * SAGITTA, abs=5e-3 * SAGITTA)
    assert np.count_nonzero(found.gap < gap * SAGITTA - 5e-3 * SAGITTA) == 0


@pytest.mark.parametrize("rigid", [False, True])
@given(angle=st.floats(0.0, 6.28), direction=st.floats(0.0, 6.28), ratio=st.floats(0.8, 2.0))
@settings(max_examples=15, deadline=None)
def test_the_contact_of_two_discs_acts_on_the_line_of_centres(rigid, angle, direction, ratio):
    radius = ratio * R
    centre = (R + radius) * np.array([np.cos(direction), np.sin(direction)])
    held = {"material": Rigid(1000.0), "motion": (0.0, 0.0, 0.0)} if rigid else {"material": GEL}
    other = Body(turned(centre, 1.7 * angle, radius), **held)
    found = contacts_of(Scene([Body(turned((0.0, 0.0), angle), GEL), other], cell=CELL))
    closest = found.gap.argmin()
    across = found.x[0, closest] * np.sin(direction) - found.x[1, closest] * np.cos(direction)
    assert abs(across) < 1.1 * MIN_SHIFT * SPACING
    assert abs(found.gap[closest]) < 1e-2 * SAGITTA


def test_a_contact_point_is_predicted_from_the_velocity():
    """A disc that rolls by a third of a spacing in the step touches where it will be lowest."""
    turn = SPACING / (3.0 * R)
    scene = Scene([Body(turned((0.0, R), 0.1), GEL, spin=-turn / DT)], cell=CELL, walls=[Wall((0, 0), (0, 1))])
    found = contacts_of(scene)
    i = np.hypot(*(found.x - initial(scene).x[:, found.point])).argmax()  # not the boundary point beside it
    assert abs(found.x[0, i] - R * turn) < 5e-3 * SPACING  # at the start of the step it is still ahead


def shift_of(found, state):
    """The largest distance of a contact point from its boundary point."""
    return np.hypot(*(found.x - state.x[:, found.point])).max()


@pytest.mark.parametrize("half_width", [0.0, 0.29, 0.45, 0.61])
def test_contact_points_of_wide_contacts_are_boundary_points(half_width):
    """Shifts decrease linearly from half-widths of 0.3 to 0.6 segments; a = sqrt(4 P R (1 - nu^2) / (pi E))."""
    scene = Scene([Body(turned((0.0, R), 0.4 * SPACING / R), GEL)], cell=CELL, walls=[Wall((0, 0), (0, 1))])
    state = initial(scene)
    length = 2.0 * R * np.sin(np.pi / round(2.0 * np.pi * R / SPACING))
    force = np.pi * (half_width * length) ** 2 * GEL.E / (4.0 * R * (1.0 - GEL.nu**2))
    free = shift_of(contacts_of(scene, state), state)
    pressed = replace(state.contacts, lasting_force=np.full_like(state.contacts.gap, force))
    found = shift_of(contacts_of(scene, replace(state, contacts=pressed)), state)
    assert free > 0.05 * length
    assert found / free == pytest.approx(np.clip((0.6 - half_width) / 0.3, 0.0, 1.0), abs=0.02)


@pytest.mark.parametrize("courant", [0.06, 0.3])
def test_forces_of_short_steps_do_not_alternate(courant):
    """A disc settles on a floor in steps in which waves cross a part of a cell: its force grows step by step.

    With contact points that follow the force of the last step, half of the steps were without force.
    """
    scene = Scene(
        [Body(disc((0.0, R), R, spacing=SPACING), GEL)], cell=CELL, walls=[Wall((0, 0), (0, 1))], gravity=(0, -1e4)
    )
    dt = courant * CELL / scene.fastest_wave
    states = simulate(scene, dt=dt, until=0.3 / courant * 80 * dt)
    force = np.array([-state.wall_force[0, 1] for state in states])
    force = force[force.size // 4 :]
    assert force.min() > 0.0
    assert np.abs(np.diff(force, 2)).mean() / 4.0 < 0.01 * force.mean()


def test_flat_sides_and_corners_have_no_closest_points():
    """A box on a wall, and a box with a corner on a disc, touch at boundary points."""
    floor, square = [Wall((0, 0), (0, 1))], box((0.0, 0.0), (8 * SPACING, 8 * SPACING), spacing=SPACING)
    tip = Points(np.array([[0.6, -0.8], [0.8, 0.6]]) @ square.x, square.volume, square.outline)
    for scene in (
        Scene([Body(square, GEL)], cell=CELL, walls=floor),
        Scene([Body(tip, GEL), Body(disc((0.0, -R), R, spacing=SPACING), GEL)], cell=CELL),
    ):
        state, found = initial(scene), contacts_of(scene)
        corner = found.point < square.volume.size
        assert np.array_equal(found.x[:, corner], state.x[:, found.point[corner]])


def test_a_disc_on_a_flat_side_touches_it_where_it_is_lowest(angle=0.13):
    """Whichever of the two gives the points."""
    for spacing in (0.8 * SPACING, 1.25 * SPACING):
        side = box((-4 * R, -2 * R), (8 * R, 2 * R), spacing=spacing)
        found = contacts_of(Scene([Body(turned((0.3 * SPACING, R), angle), GEL), Body(side, GEL)], cell=CELL))
        i = found.gap.argmin()
        assert found.bodies[0, i] == (spacing < SPACING)
        assert abs(found.x[0, i] - 0.3 * SPACING) < 5e-3 * SPACING


def test_gaps_are_derivatives_and_forces_balance_at_shifted_points():
    """H w is the rate of the gap, and the weights of both bodies sum to one."""
    scene = Scene(
        [Body(turned((0.0, 0.0), 0.07), GEL), Body(turned((1.3 * R, 1.53 * R), 0.2), GEL)], cell=CELL, friction=0.3
    )
    state = initial(scene)
    grid = state.derived.assembly.grid
    linearise, draw = point_to_curve(scene, state, grid, 1e-3), np.random.default_rng(0)
    w = 1e-3 * draw.normal(size=2 * grid.nodes)
    found, eps = linearise(w), 1e-7
    i = found.gap.argmin()
    assert np.hypot(*(found.x[:, i] - (state.x[:, found.point[i]]))) > 0.05 * SPACING
    change = draw.normal(size=w.size)
    ahead, behind = linearise(w + eps * change), linearise(w - eps * change)
    rate = (ahead.gap[i] - behind.gap[i]) / (2.0 * eps) / 1e-3
    assert (found.H @ change)[2 * i] == pytest.approx(rate, rel=1e-6)
    assert np.abs(found.difference.sum(axis=1)).max() < 1e-14


def test_without_contact_nothing_is_projected(monkeypatch):
    """Discs apart: no closest point is looked for between bodies."""
    calls = []
    monkeypatch.setattr(closest_points, "_on_bodies", lambda *a: calls.append(a))
    scene = Scene([Body(disc((x, 2 * R), R, spacing=SPACING), GEL) for x in (0.0, 4 * R)], cell=CELL)
    for _ in simulate(scene, dt=1e-5, until=3e-5):
        pass
    assert not calls


@pytest.mark.parametrize("shape", ["hexagon", "capsule"])
def test_the_impact_of_a_rigid_body_has_a_mirror_image(shape):
    """With the curvature at the foot of the first end of a segment alone, spins differed by 4 and 2 %."""
    spins = []
    for mirror in (np.eye(2), np.diag([-1.0, 1.0])):
        bodies = []
        for centre, angle, motion in (((0.03, 0.07), 0.1, {}), ((0.53, 2.02), 0.55, {"velocity": (0.0, -1.0)})):
            where, spacing = R * np.array(centre), 0.74 * CELL
            if shape == "hexagon":
                points = polygon(where, R, 6, rounding=0.2 * R, spacing=spacing, angle=angle)
            else:
                points = capsule(where * (1.0, 0.62), R, 0.5 * R, spacing=spacing, angle=0.4 * angle)
            loops = tuple(loop[::-1] if mirror[0, 0] < 0.0 else loop for loop in points.outline)
            material = Rigid(1000.0) if motion else NeoHookean(2e6, 0.45, 1000.0)
            bodies.append(Body(Points(mirror @ points.x, points.volume, loops), material, **motion))
        scheme = Scheme(newton_tol=1e-7, contact_tol=1e-9, gap_tol=1e-8)
        *_, state = simulate(Scene(bodies, cell=CELL, friction=0.3), dt=5e-6, until=2e-4, scheme=scheme)
        own = state.body == 0
        arm = state.x[:, own] - np.average(state.x[:, own], axis=1, weights=state.mass[own])[:, None]
        moment = state.mass[own] @ (arm[0] * state.v[1, own] - arm[1] * state.v[0, own])
        spins.append(np.linalg.det(mirror) * moment / (state.mass[own] @ (arm**2).sum(axis=0)))
    assert abs(spins[0]) > 1.0
    assert spins[1] == pytest.approx(spins[0], rel=1e-6)
