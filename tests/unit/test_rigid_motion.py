"""Rigid bodies that turn as prescribed: kinematics, statics on a tilting plank, a drum that carries its fill."""

import numpy as np
import pytest

from skmpm import (
    Body,
    NeoHookean,
    Points,
    Rigid,
    Scene,
    SceneError,
    Scheme,
    StepFailed,
    box,
    disc,
    initial,
    observe,
    preflight,
    simulate,
    step,
)

R = 1e-2
GEL = NeoHookean(1e6, 0.3, 1000.0)
FAR = Body(disc((50 * R, 0.0), R, spacing=R / 4), GEL)


def centre_of(state, b):
    own = state.body == b
    return np.average(state.x[:, own], axis=1, weights=state.mass[own])


def test_a_rigid_body_turns_about_its_moving_centre():
    """Constant (vx, vy, spin): rotation and translation of every point, exactly, whatever the step."""
    bar = Body(box((R, 0.0), (4 * R, R), spacing=R / 4), Rigid(1000.0), motion=(0.1, -0.2, 3.0))
    scene = Scene([FAR, bar], cell=R / 3)
    start = initial(scene)
    *_, state = simulate(scene, dt=0.05, until=0.4)
    centre, own = centre_of(start, 1), start.body == 1
    c, s = np.cos(1.2), np.sin(1.2)
    arm = np.array([[c, -s], [s, c]]) @ (start.x[:, own] - centre[:, None])
    assert state.x[:, own] == pytest.approx(arm + (centre + np.array([0.04, -0.08]))[:, None], abs=1e-15)
    spin = np.stack([-arm[1], arm[0]]) * 3.0 + np.array([[0.1], [-0.2]])
    assert state.v[:, own] == pytest.approx(spin, abs=1e-14)


def test_a_function_of_time_is_taken_in_the_middle_of_each_step():
    bar = Body(box((R, 0.0), (4 * R, R), spacing=R / 4), Rigid(1000.0), motion=lambda t: (0.0, t, 2.0 * t))
    scene = Scene([FAR, bar], cell=R / 3)
    *_, state = simulate(scene, dt=0.1, until=0.4)
    first, last = (s.x[:, np.flatnonzero(s.body == 1)[[0, 20]]] for s in (initial(scene), state))
    angle = [np.arctan2(*(x[:, 1] - x[:, 0])[::-1]) for x in (first, last)]
    assert angle[1] - angle[0] == pytest.approx(0.4**2, rel=1e-12)
    assert centre_of(state, 1)[1] - centre_of(initial(scene), 1)[1] == pytest.approx(0.4**2 / 2.0, rel=1e-12)


def test_a_block_on_a_plank_that_tilts_stands_up_to_the_angle_of_friction():
    """Without inertia: along the plank it moves by less than 1e-3 of its side; beyond, there is no equilibrium."""
    mu, side = 0.3, 2 * R
    plank = Body(box((-6 * R, -R), (12 * R, R), spacing=R / 3), Rigid(1000.0), motion=(0.0, 0.0, 1.0))
    block = Body(box((-R, 0.0), (side, side), spacing=side / 7), GEL)
    scene, scheme = Scene([plank, block], cell=side / 5, friction=mu, gravity=(0.0, -9.81)), Scheme(inertia=False)
    states = [initial(scene), *simulate(scene, dt=0.02, until=0.95 * np.arctan(mu), scheme=scheme)]
    along = [np.array([np.cos(s.t), np.sin(s.t)]) for s in states]
    place = np.array([t @ (centre_of(s, 1) - centre_of(s, 0)) for t, s in zip(along, states, strict=True)])
    assert np.abs(place - place[0]).max() < 1e-3 * side
    n, f = np.array([-np.sin(states[-1].t), np.cos(states[-1].t)]), states[-1].body_force[:, 1]
    assert along[-1] @ f / (n @ f) == pytest.approx(np.tan(states[-1].t), rel=1e-2)
    with pytest.raises(StepFailed, match="no equilibrium"):
        step(scene, states[-1], 1.1 * np.arctan(mu) - states[-1].t, scheme=scheme)


def drum(radius, thickness, spacing, **options):
    """A rigid ring: its inner boundary is a hole."""
    counts = round(2 * np.pi * radius / spacing), round(2 * np.pi * (radius + thickness) / spacing)
    rings = [r * np.stack([np.cos(a), np.sin(a)]) for r, n in zip((radius, radius + thickness), counts, strict=True)
             for a in [2 * np.pi * np.arange(n) / n]]  # fmt: skip
    x = np.concatenate(rings, axis=1)
    inner = np.arange(counts[0])[::-1]
    area = np.pi * ((radius + thickness) ** 2 - radius**2)
    loops = (counts[0] + np.arange(counts[1]), inner)
    return Body(Points(x, np.full(x.shape[1], area / x.shape[1]), loops), Rigid(1000.0), **options)


def test_a_drum_takes_a_disc_along():
    """Friction spins it up until its surface moves with the drum; the moment on it is the rate of its spin."""
    inner, omega = 5 * R, 2.0
    fill = Body(disc((0.0, R - inner), R, spacing=R / 6), GEL)
    scene = Scene([drum(inner, R, R / 4, motion=(0.0, 0.0, omega)), fill],
                  cell=R / 4, friction=0.8, gravity=(0.0, -9.81))  # fmt: skip
    assert str(preflight(scene)).endswith("no warnings")
    moment = 0.0
    for state in simulate(scene, dt=2e-4, until=0.02):
        moment += state.report.dt * state.body_moment[1]
    own = state.body == 1
    arm, mass = state.x[:, own] - centre_of(state, 1)[:, None], state.mass[own]
    centre = np.average(state.v[:, own], axis=1, weights=mass)
    v, inertia = state.v[:, own] - centre[:, None], 0.5 * mass.sum() * R**2
    spin = np.sum(mass * (arm[0] * v[1] - arm[1] * v[0])) / np.sum(mass * (arm**2).sum(axis=0))
    assert spin == pytest.approx(moment / inertia, rel=0.06)  # points: without their C
    assert spin * R + centre[0] == pytest.approx(omega * inner, rel=0.02)
    assert centre[0] == pytest.approx(omega * inner / 3.0, rel=0.05)  # a disc on a moving plate: v = V / 3
    assert observe(scene, state).overlap < 1e-3


@pytest.mark.parametrize("mu", [0.1, 0.3, 0.6])
def test_the_fill_of_a_drum_slides_at_the_angle_of_friction(mu):
    """A block that touches a slow drum of radius D with two corners, 2 alpha apart, and follows it until it slides.

    It can only turn about the axis of the drum, d from its centre of mass. The moment about that axis,
    mu D (N1 + N2) = W d sin(angle), and both components of the forces give
    tan(angle) = mu D / ((1 + mu^2) d cos(alpha) - mu^2 D), which tends to mu for a small block (d = D, alpha = 0).
    """
    D, half, height, omega = 5 * R, 1.5 * R, 2 * R, 0.5
    alpha = np.arcsin(half / D)
    bottom = -D * np.cos(alpha)
    d = -bottom - height / 2.0
    angle = np.arctan(mu * D / ((1.0 + mu**2) * d * np.cos(alpha) - mu**2 * D))
    block = Body(box((-half, bottom), (2 * half, height), spacing=0.3 * R), GEL)
    scene = Scene([drum(D, R, R / 4, motion=(0.0, 0.0, omega)), block], cell=R / 3, friction=mu, gravity=(0.0, -9.81))
    ends, carried, slides = (2.0 * angle + 0.2) / omega, [], []
    for state in simulate(scene, dt=ends / 50, until=ends, scheme=Scheme(inertia=False)):
        x = centre_of(state, 1)
        turned, place = omega * state.t, np.arctan2(x[0], -x[1])
        if turned < 0.95 * angle:
            carried.append(place - turned)
        elif turned > 1.05 * angle + 0.1:
            slides.append(place)
    assert len(carried) > 5 and np.abs(carried).max() < np.deg2rad(0.02)
    assert len(slides) > 5 and np.abs(np.array(slides) - angle).max() < np.deg2rad(0.02)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (
            lambda: Body(FAR.points, GEL, motion=(0, 0, 1)),
            "body 0: motion of a deformable body; give",
        ),
        (
            lambda: Body(FAR.points, Rigid(1.0), motion=(0, 0, 1), velocity=(1, 0)),
            r"body 0: velocity = \(1, 0\) and motion; give one of them",
        ),
        (
            lambda: Body(FAR.points, Rigid(1.0), motion=(0, 1)),
            r"body 0: motion = \(0, 1\); give \(vx, vy, spin\), each a finite number or None",
        ),
        (
            lambda: Body(FAR.points, Rigid(1.0), motion=lambda t: (0, 0, np.nan)),
            "body 0: motion at t = 0 s = .*each a finite number or None",
        ),
    ],
)
def test_bad_motion_is_refused(body, message):
    with pytest.raises(SceneError, match=message):
        Scene([body(), Body(disc((0, 0), R, spacing=R / 4), GEL)], cell=R / 3)
