"""Pressures that follow the boundary: closed forms of disc, ring and column, resultants, work, what is refused."""

import numpy as np
import pytest
from test_only_what_is_required import Calls

import skmpm
from skmpm import outline
from skmpm.points import Points
from skmpm.step.derived import bulk_of
from skmpm.step.scene_forces import follower_pressure

R = 1e-3
GEL = skmpm.NeoHookean(E=1e6, nu=0.3, density=1000.0)
STATIC = skmpm.Scheme(inertia=False)


def everywhere(x):
    return np.ones(x.shape[1], dtype=bool)


def pressed_disc(value, where=everywhere, **options):
    body = skmpm.Body(skmpm.disc((0.1 * R, 0.2 * R), R, spacing=R / 10), options.pop("material", GEL))
    return skmpm.Scene([body], cell=R / 5, loads=[skmpm.Pressure(where, value)], **options)


def ring(inner, outer, spacing):
    """A ring: the points of a disc without those of the hole, with a second outline around it."""
    disc, hole = skmpm.disc((0.0, 0.0), outer, spacing=spacing), skmpm.disc((0.0, 0.0), inner, spacing=spacing)
    own, edge = np.hypot(*disc.x) > inner + 0.25 * spacing, hole.x[:, np.concatenate(hole.outline)]
    number = np.cumsum(own) - 1
    loops = [number[loop] for loop in disc.outline]
    inside = np.arange(own.sum(), own.sum() + edge.shape[1])[::-1]
    x = np.concatenate([disc.x[:, own], edge], axis=1)
    volume = np.concatenate([disc.volume[own], np.full(edge.shape[1], np.pi * inner * spacing / edge.shape[1])])
    volume *= np.pi * (outer**2 - inner**2) / volume.sum()
    return Points(x, volume, outline=(*loops, inside))


def test_the_force_is_the_derivative_of_minus_p_times_the_area():
    """By central differences in a deformed configuration; so it has neither a resultant nor a moment."""
    scene, p = pressed_disc(3e4), 3e4
    state = skmpm.initial(scene)
    pressure, rng = follower_pressure(scene, state, 0.0, 0.0), np.random.default_rng(1)
    u, direction = rng.normal(0.0, 0.03 * R, (2, state.displacement.size))

    def area(displacement):
        x = pressure.reference + (pressure.interpolation @ displacement.reshape(-1, 2)).T
        order = pressure.ends[0].argsort()
        along = x[:, pressure.ends[1, order]]
        return 0.5 * float(
            np.sum(x[0, pressure.ends[0, order]] * along[1] - x[1, pressure.ends[0, order]] * along[0])
        )

    numeric = -p * (area(u + 1e-4 * direction) - area(u - 1e-4 * direction)) / 2e-4
    at = bulk_of(scene, state, skmpm.Scheme()).at(u)
    assert pressure.force(at) @ -direction == pytest.approx(numeric, rel=1e-9)
    grid = state.derived.assembly.grid
    force = pressure.force(at).reshape(-1, 2).T
    x = grid.position + u.reshape(-1, 2).T
    assert np.abs(force.sum(axis=1)).max() < 1e-12 * np.abs(force).sum()
    assert abs(np.sum(x[0] * force[1] - x[1] * force[0])) < 1e-12 * np.abs(force).sum() * R


@pytest.mark.parametrize("value", [2e5, -1e5])
def test_a_disc_under_pressure_is_in_hydrostatic_stress(value):
    """Quasi-static: sigma = -p I, and the area is that for which the law gives this stress."""
    scene, steps = pressed_disc(lambda t: value * t), 4
    *_, state = skmpm.simulate(scene, dt=1.0 / steps, until=1.0, scheme=STATIC)
    mean = np.average(state.stress, axis=2, weights=state.weight)
    assert mean == pytest.approx(-value * np.eye(2), abs=2e-3 * abs(value))
    strain = np.sqrt(outline.area(scene.outlines, state.x[:, scene.outlines.point], 1)[0] / 2.0)
    start = np.sqrt(outline.area(scene.outlines, scene.initial_positions[:, scene.outlines.point], 1)[0] / 2.0)
    F = strain / start * np.eye(2)[:, :, None]
    stress = (GEL.stress(F) / F[0, 0])[0, 0, 0]
    assert stress == pytest.approx(-value, rel=0.01)


@pytest.mark.parametrize(("spacing", "most"), [(0.74, 0.04), (0.5, 0.01), (0.33, 0.005)])
def test_the_stress_at_points_under_a_uniform_pressure(spacing, most):
    """-p I, with errors of 0.031, 0.0075 and 0.0041 p (rms), which come from cells without points."""
    disc, p = skmpm.disc((0.01 * R, 0.023 * R), R, spacing=spacing * R / 10), 1e4
    scene = skmpm.Scene([skmpm.Body(disc, GEL)], cell=R / 10, loads=[skmpm.Pressure(everywhere, p)])
    (state,) = skmpm.simulate(scene, dt=1.0, until=1.0, scheme=STATIC)
    error = state.stress / p + np.eye(2)[:, :, None]
    rms = np.sqrt(np.average((error**2).sum(axis=(0, 1)) / 2.0, weights=state.weight))
    assert 0.5 * most < rms < most
    assert np.average(state.stress, axis=2, weights=state.weight) == pytest.approx(-p * np.eye(2), abs=1e-3 * p)


@pytest.mark.parametrize("inside", [True, False])
def test_ring_under_pressure_follows_lame(inside):
    """Displacements of both boundaries in plane strain (Lame), within 2 %: the ring is five cells thick."""
    a, b, p, E, nu = R, 2.0 * R, 1e2, 1e6, 0.3
    material = skmpm.LinearElastic(E=E, nu=nu, density=1000.0)

    def where(x):
        return (np.hypot(*x) < 1.001 * a) if inside else (np.hypot(*x) > 1.999 * a)

    scene = skmpm.Scene(
        [skmpm.Body(ring(a, b, R / 12), material)], cell=R / 6, loads=[skmpm.Pressure(where, lambda t: p * t)]
    )
    *_, state = skmpm.simulate(scene, dt=1.0, until=1.0, scheme=STATIC)
    start = scene.initial_positions
    radius = np.hypot(*start)
    moved = np.einsum("ik,ik->k", state.x - start, start) / radius
    inner, outer = (p, 0.0) if inside else (0.0, p)
    mean = (inner * a**2 - outer * b**2) / (b**2 - a**2)
    shear = (inner - outer) * a**2 * b**2 / (b**2 - a**2)
    for r in (a, b):
        exact = (1.0 + nu) / E * ((1.0 - 2.0 * nu) * mean * r + shear / r)
        assert np.mean(moved[np.abs(radius - r) < 1e-3 * R]) == pytest.approx(exact, rel=0.02)


def angular_momentum(state):
    """Of the nodes about the origin, which carry the motion [kg m2/s per m]."""
    mass, v = state.grids.assembly.lumped[::2], state.nodal_velocity.reshape(-1, 2)
    x = state.grids.assembly.grid.position.T + state.displacement.reshape(-1, 2)
    return float(mass @ (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0]))


def test_a_spinning_disc_keeps_its_angular_momentum_under_pressure():
    """The pressure turns with the boundary: midpoint steps keep the spin to 1e-11 in a tenth of a turn."""
    scene = pressed_disc(1e4)
    body = skmpm.Body(scene.bodies[0].points, GEL, spin=200.0)
    scene = skmpm.Scene([body], cell=scene.cell, loads=scene.loads)
    scheme = skmpm.Scheme(theta=0.5, newton_tol=1e-12)
    first, *_, last = skmpm.simulate(scene, dt=1e-4, until=3e-3, scheme=scheme)
    spin = angular_momentum(first)
    assert angular_momentum(last) == pytest.approx(spin, rel=1e-11)
    assert np.abs(last.v @ last.mass).max() < 1e-10 * abs(spin) / R


def test_a_spinning_disc_under_pressure_needs_no_retries():
    """The work of a pressure in a rotation is none: the check of energies finds no gain, however long the steps."""
    scene = pressed_disc(1e4)
    scene = skmpm.Scene([skmpm.Body(scene.bodies[0].points, GEL, spin=200.0)], cell=scene.cell, loads=scene.loads)
    states = list(skmpm.simulate(scene, dt=1e-4, until=2e-3))
    assert len(states) == 20 and sum(state.report.retries for state in states) == 0


def test_work_of_a_pressure_is_p_times_the_change_of_area():
    """A constant pressure without inertia: the budget's work is -p dA to the trapezoidal rule, exact to 0.1 %."""
    p = 1e5
    scene = pressed_disc(p)
    start = skmpm.initial(scene, scheme=STATIC)
    *_, state = skmpm.simulate(scene, dt=1.0, until=1.0, scheme=STATIC)
    x = [s.x[:, scene.outlines.point] for s in (start, state)]
    change = float(np.diff([outline.area(scene.outlines, y, 1)[0] for y in x])[0])
    assert change < 0.0
    assert state.report.energy.external == pytest.approx(-p * change, rel=1e-6)


def test_suction_on_part_of_a_boundary_bends_a_beam_as_a_load_does():
    """A small pressure on the upper side of a cantilever: deflection p L^4 / (8 E I) in plane strain within 4 %."""
    length, height, p, E, nu = 10.0 * R, R, 1.0, 1e6, 0.0
    beam = skmpm.box((0.0, 0.0), (length, height), spacing=height / 10)
    scene = skmpm.Scene(
        [skmpm.Body(beam, skmpm.LinearElastic(E=E, nu=nu, density=1000.0))],
        cell=height / 5,
        supports=[skmpm.Support(lambda x: x[0] < 1e-9)],
        loads=[skmpm.Pressure(lambda x: x[1] > height - 1e-9, p)],
    )
    *_, state = skmpm.simulate(scene, dt=1.0, until=1.0, scheme=STATIC)
    end = scene.initial_positions[0] > length - 1e-9
    deflection = float(np.mean((state.x - scene.initial_positions)[1, end]))
    exact = -p * length**4 / (8.0 * E * height**3 / 12.0)
    assert deflection == pytest.approx(exact, rel=0.04)


@pytest.mark.parametrize(
    ("pressure", "message"),
    [
        (skmpm.Pressure(everywhere, np.nan), r"load 0: value = nan; give a finite number"),
        (skmpm.Pressure(everywhere, (1.0, 2.0)), r"load 0: value .* give a finite number"),
        (skmpm.Pressure(everywhere, "10 kPa"), r"load 0: value .*10 kPa.*give a finite number"),
        (skmpm.Pressure(lambda x: x[0] > 9.0, 1.0), r"load 0: where is true at no two neighbouring boundary points"),
        (skmpm.Pressure(lambda x: x[0] > 1.0999 * R, 1.0), r"load 0: where is true at no two neighbouring"),
        (skmpm.Pressure(1.0, 1.0), r"load 0: where"),
        (1.0, r"load 0 is a float; use skmpm.Load\(where, force\) or skmpm.Pressure\(where, value\)"),
    ],
)
def test_what_is_refused(pressure, message):
    with pytest.raises(skmpm.SceneError, match=message):
        skmpm.Scene([skmpm.Body(skmpm.disc((0.0, 0.0), R, spacing=R / 10), GEL)], cell=R / 5, loads=[pressure])


def test_a_value_that_is_not_finite_later_is_refused_then():
    scene = pressed_disc(lambda t: 1e3 if t < 1.5 else np.inf)
    with pytest.raises(skmpm.SceneError, match=r"load 0: value at t = 2 s = inf"):
        list(skmpm.simulate(scene, dt=1.0, until=3.0, scheme=STATIC))


def test_the_stiffness_is_the_derivative_of_the_force_by_affine_motions():
    """By central differences, round a closed outline; the area inside the polygon is 2e-4 of that of the points less.

    Of linear materials there is none.
    """
    scene = pressed_disc(3e4)
    state = skmpm.initial(scene)
    pressure, assembly = follower_pressure(scene, state, 0.0, 0.0), state.derived.assembly
    bulk = bulk_of(scene, state, skmpm.Scheme())
    K = assembly.matrix(pressure.stiffness(None), 1.0) - assembly.matrix(np.zeros_like(assembly.ghost_data), 1.0)
    assert abs(K - K.T).max() < 1e-12 * abs(K).max()
    x, y = assembly.grid.position / R
    one = np.ones_like(x)
    for field in ((x, -y), (x, y), (-y, x), (y, x), (one, 0 * one), (x + 2 * y, 3 * x)):
        u = 1e-3 * R * np.stack(field, axis=1).ravel()
        change = 0.5 * (pressure.force(bulk.at(u)) - pressure.force(bulk.at(-u)))
        assert u @ (K @ u) == pytest.approx(float(u @ change), rel=1e-3, abs=1e-9 * 3e4 * 1e-6 * R**2)
        rows = np.linalg.norm(K @ u - change) / max(np.linalg.norm(change), 1e-9 * 3e4 * R)
        assert rows < 0.05
    linear = pressed_disc(3e4, material=skmpm.LinearElastic(1e6, 0.3, 1000.0))
    assert not follower_pressure(linear, skmpm.initial(linear), 0.0, 0.0).stiff


def test_a_ring_in_a_groove_bears_half_of_its_modulus():
    """Steps without inertia need the stiffness of the pressure from a fifth of the modulus on."""
    rubber = skmpm.NeoHookean(E=5e6, nu=0.48, density=1100.0)
    body = skmpm.Body(skmpm.disc((0.0, 0.0), R, spacing=R / 12), rubber)
    walls = [
        skmpm.Wall((0.0, -R), (0.0, 1.0)),
        skmpm.Wall((0.0, R), (0.0, -1.0), velocity=lambda t: (0.0, -0.3 * R if t < 1.0 else 0.0)),
        skmpm.Wall((1.25 * R, 0.0), (-1.0, 0.0)),
    ]
    fluid = skmpm.Pressure(lambda x: x[0] < -0.5 * R, lambda t: 2.5e6 * max(t - 1.0, 0.0))
    scene = skmpm.Scene([body], cell=R / 6, walls=walls, friction=0.1, loads=[fluid])
    state = skmpm.run(scene, dt=0.05, until=2.0, scheme=STATIC, warn=False)
    (points,) = skmpm.wetted(scene, state)
    height = np.ptp(state.x[1, points])
    friction = state.wall_force[:2, 0].sum()
    assert state.wall_force[2, 0] + friction == pytest.approx(2.5e6 * height, rel=2e-3)


def test_without_pressures_none_is_evaluated():
    """No segment is looked for, no force found, and a linear material is solved once."""
    scene = skmpm.Scene(pressed_disc(1e3).bodies, cell=R / 5, gravity=(0.0, -1.0))
    with Calls() as calls:
        list(skmpm.simulate(scene, dt=1e-5, until=3e-5))
    assert (
        calls.named("FollowerPressure.force")
        == calls.named("pressed_segments")
        == calls.named("wetted_segments")
        == 0
    )


def test_restart_is_exact():
    scene = pressed_disc(lambda t: 1e4 * np.sin(1e4 * t))
    states = list(skmpm.simulate(scene, dt=1e-5, until=8e-5))
    *_, again = skmpm.simulate(scene, dt=1e-5, until=8e-5, start=states[3])
    assert np.array_equal(states[-1].x, again.x)
    assert np.array_equal(states[-1].stress, again.stress)
