"""Explicit steps (`Scheme.explicit`): against closed forms of the scheme, implicit steps, and its limit of stability.

An explicit step is symplectic Euler with lumped mass: forces of the start, the new velocity moves the points. Nodes
that are nearly empty are as heavy as a twentieth of a full one, so one limit of the time step holds wherever a body
lies on the grid.
"""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from ledger import Row, numbers, rate
from scipy.sparse.linalg import eigsh
from test_dynamics import PERIOD, L, angular_momentum, b, bar, period, vibration

from skmpm import explicit_mass
from skmpm.material import NeoHookean
from skmpm.points import disc
from skmpm.run import simulate
from skmpm.scene import Body, Scene, StepFailed, Support, Wall, fitted_motions
from skmpm.scheme import Scheme
from skmpm.simulate import initial, step
from skmpm.simulate.regrid import assembly_of, bulk_of

GEL = NeoHookean(10e6, 0.45, 990.0)
WAVE = np.sqrt((GEL.lame[0] + 2.0 * GEL.lame[1]) / GEL.density)
RADIUS, CELL = 1e-3, 0.2e-3
POSITIONS = [(0.0, 0.0), (0.137, 0.291), (0.5, 0.5), (0.99, 0.01), (0.81, 0.91)]  # of the centre from a node [cells]
STABLE = 0.7  # h/c


def swinging(position, speed=1.0):
    """A disc whose boundary first moves by speed [m/s] outwards along x and inwards along y."""
    centre = CELL * np.array(position)

    def velocity(x):
        return speed / RADIUS * np.stack([x[0] - centre[0], centre[1] - x[1]])

    return Scene([Body(disc(centre, RADIUS, spacing=0.74 * CELL), GEL, velocity=velocity)], cell=CELL)


def largest_energy(position, courant, steps=300, **options):
    """Energy of a free swing over the first, the largest; inf if a step fails.

    Velocities belong to the middles of steps: the energy that symplectic Euler keeps of linear motions is the elastic
    one plus half the product of momenta before and velocities after (Hairer, Lubich & Wanner, Acta Numer. 12, 2003).
    """
    scene, scheme = swinging(position), Scheme(explicit=True, **options)
    state, dt, energies = initial(scene, scheme=scheme), courant * CELL / WAVE, []
    for _ in range(steps):
        try:
            after = step(scene, state, dt, scheme=scheme)
        except StepFailed:
            return np.inf
        if state.nodal_velocity.size:
            mass, elastic = assembly_of(state).explicit_mass, state.report.energy.elastic
            energies.append(elastic + 0.5 * state.nodal_velocity @ (mass * after.nodal_velocity))
        state = after
    return max(energies) / energies[0]


def slowed(cell, dt):
    """Period of the bar's first mode with lumped mass and symplectic Euler, over that of the continuum, less 1."""
    w = 2.0 / cell * np.sin(0.5 * b * cell) * np.sqrt(100.0)
    return float(2.0 * np.pi / (2.0 / dt * np.arcsin(0.5 * w * dt)) / PERIOD - 1.0)


def measured_period(dt):
    """The same, measured over four periods, and how far kinetic and elastic energy swing, over the first."""
    t, amplitude, elastic, kinetic, _ = vibration(bar(1.0), dt=dt, periods=4, explicit=True)
    return period(t, amplitude) / PERIOD - 1.0, float(np.ptp(elastic + kinetic) / kinetic[0])


@pytest.mark.parametrize("dt", [0.02, 0.05])
def test_the_bars_period_is_that_of_symplectic_euler(dt):
    """Fixed-free bar, 25 cells, four periods. Closed form of lumped mass and scheme, to 1e-6.

    The energy swings by w dt in all, as symplectic Euler's does, and does not grow.
    """
    found, swing = measured_period(dt)
    assert found == pytest.approx(slowed(1.0, dt), abs=1e-6)
    assert swing == pytest.approx(2.0 * np.pi / PERIOD * dt, rel=1e-2)


@pytest.mark.parametrize("position", POSITIONS)
def test_one_limit_of_the_step_wherever_the_disc_lies(position):
    """A swinging disc, R/h = 5, dt = 0.7 h/c, 300 steps: its energy stays below 1.002 of the first.

    With the mass of their points nearly empty nodes need a fifth of that (the next test).
    """
    assert largest_energy(position, STABLE) < 1.002


def test_nearly_empty_nodes_need_more_mass(monkeypatch):
    """Centre in the middle of a cell, where the boundary just crosses grid lines: unstable at 0.5 h/c without."""
    assert largest_energy((0.5, 0.5), 0.5) < 1.002
    monkeypatch.setattr(explicit_mass, "MIN_MASS", 1e-9)
    assert largest_energy((0.5, 0.5), 0.5) > 1.5


@pytest.mark.parametrize("nu", [0.3, 0.45])
@pytest.mark.parametrize("cells", [3.2, 5.0, 10.0])
def test_the_longest_stable_step_is_above_the_limit(cells, nu):
    """2 / sqrt(largest eigenvalue of M^-1 K), discs at nine positions on the grid: above 0.7 h/c, the limit."""
    gel, found = NeoHookean(10e6, nu, 990.0), []
    wave = np.sqrt((gel.lame[0] + 2.0 * gel.lame[1]) / gel.density)
    for position in [*POSITIONS, (0.25, 0.75), (0.4, 0.05), (0.65, 0.35), (0.02, 0.47)]:
        scene = Scene([Body(disc(position, cells, spacing=0.74), gel)], cell=1.0)
        state = initial(scene, scheme=Scheme(explicit=True))
        assembly, bulk = assembly_of(state), bulk_of(scene, state, Scheme())
        K = bulk.stiffness(bulk.at(state.displacement))
        K = sp.bsr_array((K, assembly.indices, assembly.indptr), shape=2 * (assembly.mass.size,)).tocsr()
        root = sp.diags_array(assembly.explicit_mass**-0.5)
        found.append(2.0 * wave / np.sqrt(eigsh(root @ K @ root, k=1, return_eigenvectors=False)[0]))
    assert min(found) > STABLE


def test_steps_beyond_the_limit_are_refused():
    """Twice the limit: the energy that grows from nothing ends the step, with the time and a remedy."""
    scene, scheme = swinging((0.137, 0.291)), Scheme(explicit=True)
    state, dt = initial(scene, scheme=scheme), 2.0 * STABLE * CELL / WAVE
    with pytest.raises(StepFailed, match=r"t = .*(gain|log|inverted).*smaller dt|failed"):
        for _ in range(300):
            state = step(scene, state, dt, scheme=scheme)


@pytest.mark.parametrize(
    ("speed", "courant", "options"), [(42.0, 0.7, {"explicit": True}), (30.0, 3.0, {"theta": 0.5})]
)
def test_a_run_that_gains_energy_little_by_little_is_ended(speed, courant, options):
    """Strains of 0.3: no single step gains 5 %, explicit ones of 0.7 h/c and the midpoint rule with 3 h/c do in all.

    With half of the step both keep their energy for as long.
    """
    scene, scheme, dt = swinging((0.137, 0.291), speed=speed), Scheme(**options), courant * CELL / WAVE
    with pytest.raises(
        StepFailed, match=r"since the start of the run the bodies have gained .* begin again"
    ) as failed:
        for _ in simulate(scene, dt=dt, until=1000 * dt, scheme=scheme):
            pass
    *_, end = simulate(scene, dt=0.5 * dt, until=failed.value.state.t, scheme=scheme)
    energy = end.report.energy
    assert abs(energy.dissipated) < 0.05 * (energy.kinetic + energy.elastic)


def colliding(friction=0.5):
    """Two discs that meet obliquely."""
    bodies = [
        Body(disc((0.137 * CELL, 0.291 * CELL), RADIUS, spacing=0.74 * CELL), GEL, velocity=(4.0, 0.0)),
        Body(disc((1.9 * RADIUS, 0.8 * RADIUS), RADIUS, spacing=0.74 * CELL), GEL, velocity=(-4.0, 0.0)),
    ]
    return Scene(bodies, cell=CELL, friction=friction)


def rebound(scene, courant, until, **options):
    """Velocities and spin of the first disc at the end, over 4 m/s, and the largest momentum on the way, over m v."""
    scheme, momentum = Scheme(**options), 0.0
    for state in simulate(scene, dt=courant * CELL / WAVE, until=until, scheme=scheme):
        momentum = max(momentum, float(np.abs(state.v @ state.mass).max()) / (4.0 * state.mass.sum()))
    vx, vy, spin = (motion[0] for motion in fitted_motions(state.x, state.v, state.mass, state.body))
    return np.array([vx, vy, spin * RADIUS]) / 4.0, momentum


def difference(courant, until=120e-6):
    """Explicit against implicit steps of the same length, largest difference of rebound velocities and spin."""
    pair = [rebound(colliding(), courant, until, explicit=explicit) for explicit in (True, False)]
    return float(np.abs(pair[0][0] - pair[1][0]).max()), max(m for _, m in pair)


@pytest.mark.slow
def test_explicit_and_implicit_collisions_meet():
    """Oblique collision, friction 0.5: the difference is of first order in dt.

    Both are first-order schemes with one limit, their errors of opposite sign: 5 % of the speed at 0.6 h/c. Momentum
    to round-off.
    """
    steps = (0.6, 0.3)
    found, momentum = zip(*(difference(courant) for courant in steps), strict=True)
    assert max(momentum) < 1e-13
    assert found[0] < 0.05
    assert rate(steps, found) > 0.9


def test_momentum_and_angular_momentum_are_those_of_the_points():
    """Oblique collision with friction, 150 steps of 0.5 h/c: momentum to round-off.

    Angular momentum to 2e-4, since forces of the start act at positions of the end, by dt^2 force times velocity;
    without the rigid motions of `with_momentum_of_points`, 5e-3.
    """
    scene, scheme, dt = colliding(), Scheme(explicit=True), 0.5 * CELL / WAVE
    state = initial(scene, scheme=scheme)
    start = None
    for _ in range(150):
        state = step(scene, state, dt, scheme=scheme)
        start = angular_momentum(state) if start is None else start
        assert np.abs(state.v @ state.mass).max() < 1e-13 * 4.0 * state.mass.sum()
        assert state.report.residual < scheme.gap_tol
    assert state.contacts.force.max(initial=0.0) == 0.0  # they have parted
    assert state.v[0, state.body == 0].mean() < 0.0
    assert angular_momentum(state) == pytest.approx(start, rel=2e-4)


def test_a_body_in_gravity_falls_as_a_point():
    """Uniform acceleration, 20 steps of 0.5 h/c: its momentum is m g t to round-off, it deforms by less than 1e-6."""
    scene = replace(swinging((0.137, 0.291), speed=0.0), gravity=(0.0, -9.81))
    scheme, dt = Scheme(explicit=True), 0.5 * CELL / WAVE
    state = initial(scene, scheme=scheme)
    for _ in range(20):
        state = step(scene, state, dt, scheme=scheme)
    np.testing.assert_allclose(state.v @ state.mass / state.mass.sum(), [0.0, -9.81 * state.t], atol=1e-15)
    assert np.abs(state.F - np.eye(2)[:, :, None]).max() < 1e-6


def test_a_body_beside_a_supported_one_keeps_its_momentum():
    """Bodies that supports do not hold balance their momentum in scenes with supports, too."""
    bodies = [*colliding().bodies[:1], Body(disc((0.0, 5 * RADIUS), RADIUS, spacing=0.74 * CELL), GEL)]
    held = Support(lambda x: x[1] > 5 * RADIUS)
    scene = Scene(bodies, cell=CELL, supports=[held], gravity=(0.0, -9.81))
    scheme, dt = Scheme(explicit=True), 0.5 * CELL / WAVE
    state = initial(scene, scheme=scheme)
    for _ in range(10):
        state = step(scene, state, dt, scheme=scheme)
    own = state.body == 0
    mean = state.v[:, own] @ state.mass[own] / state.mass[own].sum()
    np.testing.assert_allclose(mean, [4.0, -9.81 * state.t], rtol=1e-12)


def test_a_step_needs_no_factorisation_and_no_contact_iteration_at_nodes():
    """A is diagonal; two bodies at shared nodes meet node by node, in closed form."""
    scheme = replace(Scheme.nezamabadi2017(), explicit=True)
    scene = colliding()
    state, most = initial(scene, scheme=scheme), 0
    for _ in range(40):
        state = step(scene, state, 0.1 * CELL / WAVE, scheme=scheme)
        most = max(most, state.contacts.gap.size)
        assert state.report.contact == 0
        assert state.report.residual < 1e-12
    assert most > 0
    assert state.derived.solver.name == "diagonal"


def test_the_diagonal_is_reused():
    """On body grids built once A is formed once in a run."""
    scene, scheme = colliding(), Scheme(explicit=True)
    state, factorised = initial(scene, scheme=scheme), 0
    for _ in range(30):
        state = step(scene, state, 0.5 * CELL / WAVE, scheme=scheme)
        factorised += state.report.factorisations
    assert factorised == 1
    assert state.contacts.gap.size > 0
    assert state.derived.solver.name == "diagonal"


def test_a_wall_stops_an_explicit_disc():
    """A disc against a wall, 0.5 h/c: it never lies behind it, and rebounds with the impulse that the wall gave."""
    scene = replace(swinging((0.137, 0.291), speed=0.0), walls=(Wall((0.0, -1.02 * RADIUS), (0.0, 1.0)),))
    scene = replace(scene, bodies=(replace(scene.bodies[0], velocity=(0.0, -2.0)),))
    given, dt = 0.0, 0.5 * CELL / WAVE
    for state in simulate(scene, dt=dt, until=200 * dt, scheme=Scheme(explicit=True)):
        given -= dt * state.wall_force[0, 1]
        assert state.x[1].min() > -1.02 * RADIUS - 1e-3 * CELL
    gained = state.mass @ (state.v[1] + 2.0)
    assert gained == pytest.approx(given, rel=1e-9)
    assert state.v[1] @ state.mass / state.mass.sum() > 1.0


def rows():
    """Lines of docs/verification."""
    steps = (0.6, 0.3, 0.15)
    found, _ = zip(*(difference(courant) for courant in steps), strict=True)
    periods = {dt: (measured_period(dt)[0], slowed(1.0, dt)) for dt in (0.02, 0.05)}
    stable = {
        courant: max(largest_energy(position, courant) for position in POSITIONS) for courant in (0.5, 0.7, 0.8)
    }
    return [
        Row(
            problem=f"fixed-free bar, explicit, 25 cells over {L:g} m, period over the continuum's",
            reference="lumped mass and symplectic Euler, closed form",
            h="1",
            error="; ".join(f"dt {dt:g}: {a:+.2e} for {e:+.2e}" for dt, (a, e) in periods.items()),
            rate="-",
            goal="1e-6: met",
            test="test_the_bars_period_is_that_of_symplectic_euler",
        ),
        Row(
            problem="swinging disc, explicit, 300 steps of 0.5, 0.7, 0.8 h/c, worst of five positions on the grid",
            reference="its first energy",
            h="R/h = 5",
            error=f"largest energy over it: {numbers(stable.values())}",
            rate="-",
            goal="stable to 0.7 h/c wherever it lies: met",
            test="test_one_limit_of_the_step_wherever_the_disc_lies",
        ),
        Row(
            problem="oblique collision with friction 0.5, explicit against implicit, 0.6, 0.3, 0.15 h/c",
            reference="implicit steps of the same length",
            h="R/h = 5",
            error=f"velocities and spin over the speed of a disc: {numbers(found)}",
            rate=f"{rate(steps, found):.2f}",
            goal="first order: met",
            test="test_explicit_and_implicit_collisions_meet",
        ),
    ]
