"""Dynamics against closed forms: an elastic bar, and a disc that spins freely.

Both have closed forms not only for the continuum but for what the time scheme does to it, so that a loss of energy or
of angular momentum is not only small: it is known whose it is.
"""

import numpy as np
import pytest
from ledger import Row, numbers, rate

from skmpm import linear
from skmpm.grid.transfer import nodal_velocity
from skmpm.material import Anchored, LinearElastic, NeoHookean
from skmpm.points import box, disc
from skmpm.scene import Body, Scene, Support
from skmpm.scheme import Scheme
from skmpm.simulation import run, simulate
from skmpm.step.initial_state import initial

SOLVERS = {"banded": linear.banded, "amg": linear.amg}

# The bar: fixed at x = 0, free at L, v = v0 cos(w t) sin(b x), period 10 s, energy rho L v0^2 / 4 (per unit height).
L, E, V0, PERIOD = 25.0, 100.0, 0.1, 10.0
b = np.pi / (2.0 * L)
FREQUENCY = 2.0 * np.pi / PERIOD


def bar(cell, offset=0.0):
    """The bar with its left end `offset` to the right of a grid line; nu = 0, its cross-section moves freely."""
    points = box((offset, 0.0), (L, 1.0), spacing=cell / 2)

    def velocity(x):
        return np.stack([V0 * np.sin(b * (x[0] - offset)), np.zeros_like(x[0])])

    body = Body(points, LinearElastic(E, 0.0, 1.0), velocity=velocity)
    return Scene([body], cell=cell, supports=[Support(lambda x: x[0] <= offset, velocity=(0.0, None))])


def vibration(scene, *, dt, periods, **options):
    """Time (n,) [s], amplitude (n,) [m] of the mode, elastic and kinetic energy at the nodes and at the points."""
    scheme = Scheme(**options)
    start = initial(scene, scheme=scheme)
    mass, X = start.mass, scene.initial_positions
    shape = np.sin(b * (X[0] - X[0].min()))
    rows = [(0.0, 0.0, 0.0, start.report.energy.kinetic, 0.5 * mass @ (start.v**2).sum(axis=0))]
    for state in simulate(scene, dt=dt, until=periods * PERIOD, scheme=scheme, start=start):
        amplitude = mass * shape @ (state.x - X)[0] / (mass @ shape**2)
        energy = state.report.energy
        at_points = 0.5 * mass @ (state.v**2).sum(axis=0)
        rows.append((state.t, amplitude, energy.elastic, energy.kinetic, at_points))
    return np.array(rows).T


def period(t, amplitude):
    """Mean time between the zeros at which the amplitude rises, by linear interpolation, from t = 0 on."""
    i = np.flatnonzero((amplitude[:-1] < 0.0) & (amplitude[1:] >= 0.0))
    zeros = t[i] - amplitude[i] * (t[i + 1] - t[i]) / (amplitude[i + 1] - amplitude[i])
    return float(zeros[-1] / zeros.size)


def drift(elastic, kinetic):
    """Largest change of the energy as a share of the first."""
    total = elastic + kinetic
    return float(np.abs(total / total[0] - 1.0).max())


def expected_period(cell, dt):
    """Relative error of the period, by lumped mass and midpoint rule."""
    w = 2.0 / cell * np.sin(0.5 * b * cell) * np.sqrt(E)
    return float(FREQUENCY / (2.0 / dt * np.arctan(0.5 * w * dt)) - 1.0)


def expected_energy(t, dt, theta):
    """Energy over the first: the loss of backward Euler."""
    return np.exp(-t * np.log1p((FREQUENCY * dt) ** 2) / dt) if theta == 1.0 else np.ones_like(t)


@pytest.mark.parametrize(
    ("solver", "offset"), [("banded", 0.0), pytest.param("amg", 0.15, marks=pytest.mark.nightly)]
)
def test_bar_keeps_its_period_to_a_thousandth_and_its_energy_over_ten_periods(solver, offset):
    """Fixed-free bar, nu = 0, h = 1/2, dt = 0.1 s (c dt = 2 h), midpoint rule, against separation of variables.

    The goals: period within 0.1 %; energy within 1e-3 over ten periods. The error of the period is what lumped mass
    and midpoint rule have in closed form, to a hundredth. The energy of the report, with the kinetic energy of the
    nodes, is kept to 1e-11. The kinetic energy of the points is 3/16 (b h)^2 = 1.9e-4 below that of the nodes.
    """
    t, amplitude, elastic, nodes, points = vibration(
        bar(0.5, offset), dt=0.1, periods=10, theta=0.5, linear=SOLVERS[solver]
    )
    error = period(t, amplitude) / PERIOD - 1.0
    assert nodes[0] == pytest.approx(0.0625, rel=1e-3)
    assert abs(error) <= 1e-3
    assert error == pytest.approx(expected_period(0.5, 0.1), rel=0.01)
    assert drift(elastic, nodes) <= 1e-11
    assert drift(elastic, points) <= 2e-4


@pytest.mark.parametrize("theta", [0.5, 1.0])
def test_the_bar_loses_what_backward_euler_loses_and_no_more(theta):
    """Two periods, h = 1, dt = 0.1 s: the energy left, over the first, is the closed form's.

    Backward Euler: 1 / (1 + (w dt)^2) a step, to 2e-4. Midpoint rule: all, to 1e-11; 4e-12 are lost with the first
    velocity, which is not quite zero at the support.
    """
    t, _, elastic, nodes, _ = vibration(bar(1.0), dt=0.1, periods=2, theta=theta)
    left = (elastic + nodes) / nodes[0]
    assert np.abs(left - expected_energy(t, 0.1, theta)).max() <= (1e-11 if theta == 0.5 else 2e-4)


# The disc: radius 1 m, density 1 kg/m3, turning at 1 rad/s; its modulus is in units of rho omega^2 R^2.


def spinning(modulus, *, cells, material=NeoHookean):
    """A disc beside the origin of the grid, so that nothing is symmetric, with two points a cell's side."""
    points = disc((0.13 / cells, 0.07 / cells), 1.0, spacing=0.5 / cells)
    return Scene([Body(points, material(modulus, 0.3, 1.0), spin=1.0)], cell=1.0 / cells)


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def angular_momentum(state):
    """Of the nodes about the origin [kg m2/s per m]."""
    assembly = state.grids.assembly
    v = nodal_velocity(assembly, state.mass, state.v, state.C, known=state.nodal_velocity).reshape(-1, 2).T
    return float(assembly.lumped[::2] @ cross(assembly.grid.position + state.displacement.reshape(-1, 2).T, v))


def spin(modulus, *, cells, dt, angle, **options):
    """Angular momentum (steps + 1,) and the last state; Newton to round-off."""
    scene = spinning(modulus, cells=cells)
    start = initial(scene)
    states = [start, *simulate(scene, dt=dt, until=angle, scheme=Scheme(newton_tol=1e-12, **options), start=start)]
    return np.array([angular_momentum(state) for state in states]), states[-1]


@pytest.mark.parametrize("solver", SOLVERS)
def test_midpoint_keeps_the_angular_momentum_of_a_spinning_disc(solver):
    """NeoHookean disc, E = 1e4 rho omega^2 R^2, R/h = 10, by one radian in 100 steps (amg: 0.2 rad): to 1e-10."""
    angle = {"banded": 1.0, "amg": 0.2}[solver]
    kept, state = spin(1e4, cells=10, dt=0.01, angle=angle, theta=0.5, linear=SOLVERS[solver])
    assert np.abs(kept / kept[0] - 1.0).max() <= 1e-10
    assert abs(np.median(np.arctan2(state.F[1, 0], state.F[0, 0])) - angle) < 1e-3  # it did turn


@pytest.mark.parametrize("rebuilt", [False, True])
def test_only_new_body_grids_take_angular_momentum_from_a_soft_disc(rebuilt):
    """E = 100 rho omega^2 R^2 at R/h = 5, two radians in 100 steps: 1e-12 on one grid, 1e-3 with a new one each step.

    There points carry the motion, which keep no xi eta part of it.
    """
    kept, _ = spin(100.0, cells=5, dt=0.02, angle=2.0, theta=0.5, anchor=0.0 if rebuilt else np.inf)
    lost = np.abs(kept / kept[0] - 1.0).max()
    assert (1e-6 < lost < 1e-2) if rebuilt else lost < 1e-12


def rigid_loss(turn):
    """Share of the angular momentum that backward Euler takes from a rigid disc in a step that turns it by phi.

    No torque about where it ends, x1 x (x1 - 2 x0 + x_1) = 0, makes tan phi' = sin phi / (2 - cos phi) of the angles
    of successive steps; the angular momentum goes with sin phi. To first order the loss is phi^2.
    """
    return 1.0 - np.sin(np.arctan(np.sin(turn) / (2.0 - np.cos(turn)))) / np.sin(turn)


def backward_euler_losses(steps, count=20):
    """Turns per step (k,) [rad] and losses of angular momentum in the last of `count` steps, for time steps (k,)."""
    turns, lost = [], []
    for dt in steps:
        kept, _ = spin(1e4, cells=5, dt=dt, angle=count * dt)
        turns.append(np.arcsin(kept[-2] / kept[0] * dt))
        lost.append(1.0 - kept[-1] / kept[-2])
    return np.array(turns), np.array(lost)


@pytest.mark.parametrize("cells", [4, 5, 10])
def test_a_disc_has_the_moment_of_inertia_of_its_lumped_nodes(cells):
    """(2 / 3)(h / R)^2 more than m R^2 / 2: in the mean, shape functions add h^2 / 6 a direction to squared arms."""
    radius, spin = 1.0, 1e-3
    points = disc((0.13, 0.07), radius, spacing=0.5 / cells)
    body = Body(points, NeoHookean(1e6, 0.3, 1000.0), spin=spin)
    state = next(simulate(Scene([body], cell=1.0 / cells), dt=1e-6, until=1e-6, scheme=Scheme(theta=0.5)))
    exact = 0.25 * state.mass.sum() * (radius * spin) ** 2
    assert state.report.energy.kinetic / exact - 1.0 == pytest.approx(2.0 / 3.0 / cells**2, rel=0.1)


def test_backward_euler_loses_the_square_of_the_turn_per_step():
    """Omega dt = 0.1 to 0.0125: the closed form of a rigid disc within 1e-3; order 1 in (omega dt)^2 within 0.01.

    What is left is the elastic disc's own strain, 1e-4.
    """
    turns, lost = backward_euler_losses([0.1, 0.05, 0.025, 0.0125])
    assert np.abs(lost / rigid_loss(turns) - 1.0).max() < 1e-3
    assert lost[-1] == pytest.approx(turns[-1] ** 2, rel=1e-2)
    assert rate(turns**2, lost) == pytest.approx(1.0, abs=0.01)


def steady_stress(x, nu, speed):
    """Cauchy stress (2, 2, n) of a disc of radius 1 that turns steadily, plane strain, small strain.

    Timoshenko & Goodier, Theory of Elasticity, eq. 55, with nu / (1 - nu) for plane strain.
    """
    radial = x / np.hypot(*x)
    hoop = np.stack([-radial[1], radial[0]])
    outer, inner, square = 3.0 - 2.0 * nu, 1.0 + 2.0 * nu, (x**2).sum(axis=0)
    parts = ((outer * (1.0 - square), radial), (outer - inner * square, hoop))
    return sum(speed**2 / (8.0 * (1.0 - nu)) * size * np.einsum("in,jn->ijn", e, e) for size, e in parts)


def turning(material, angle, *, cells=5, modulus=1e3, dt=0.01, **options):
    """Per state: median angle of the points, largest stress, mean pressure over the closed form's, J, stress error.

    The time step damps the onset, for the disc starts to spin without stress; the spin is that of the state.
    """
    scene = spinning(modulus, cells=cells, material=material)
    rows, turned, before = [], 0.0, np.zeros(scene.offsets[-1])
    for state in simulate(scene, dt=dt, until=angle, scheme=Scheme(**options)):
        now = np.arctan2(state.F[1, 0] - state.F[0, 1], state.F[0, 0] + state.F[1, 1])
        turned, before = turned + np.median(np.angle(np.exp(1j * (now - before)))), now
        arm = state.x - (state.x @ state.mass / state.mass.sum())[:, None]
        speed = state.mass @ cross(arm, state.v) / (state.mass @ (arm**2).sum(axis=0))
        exact, volume = steady_stress(arm, 0.3, speed), state.weight
        pressure = volume @ np.trace(state.stress) / (volume @ np.trace(exact))
        error = np.sqrt(volume @ ((state.stress - exact) ** 2).sum((0, 1)) / (volume @ (exact**2).sum((0, 1))))
        J = state.volume.sum() / scene.initial_volumes.sum()
        rows.append((state.t, turned, np.abs(state.stress).max(), pressure, J, error))
    return np.array(rows).T


def test_a_neohookean_disc_turns_with_the_stress_of_its_spin_and_no_other():
    """E = 1000 rho omega^2 R^2, R/h = 5, two radians: stress of order rho omega^2 R^2, its mean the closed form's.

    Backward Euler, once the onset is damped (t > 1 s). The mean within 4 %, by which the lumped mass has a larger
    second moment (order 2, `rows`); the field within 10 %, the error of a Q1 stress at the points (order 1). A strain
    that saw the rotation would give a stress of 1000 times as much.
    """
    t, turned, largest, pressure, J, error = turning(NeoHookean, 2.0)
    settled = t > 1.0
    assert turned[-1] > 1.9
    assert largest[settled].max() < 0.6
    assert np.abs(pressure[settled] - 1.0).max() < 0.04
    assert error[settled].max() < 0.1
    assert np.abs(J - 1.0).max() < 1e-3


def test_a_linear_elastic_disc_sees_a_false_strain_and_flies_apart():
    """The angle's square over two: the strain of a rotation by theta is cos(theta) - 1, to round-off.

    A free disc obeys it: every point flies straight on, F = I + omega t S, of which the linear strain is zero, and
    its area grows by 1 + (omega t)^2 without any stress.
    """
    theta = np.array([0.01, 0.05, 0.3])
    false = false_strain(LinearElastic, theta)
    assert np.allclose(false, 1.0 - np.cos(theta), rtol=1e-9)
    assert np.allclose(false, 0.5 * theta**2, rtol=0.01)
    assert false_strain(NeoHookean, theta).max() < 1e-14
    t, _, largest, _, J, _ = turning(LinearElastic, 0.5)
    assert np.allclose(J, 1.0 + t**2, rtol=1e-10)
    assert largest.max() < 1e-9


def false_strain(kind, theta):
    """The volumetric strain that a material needs for the stress it shows when turned by angles (n,)."""
    material = kind(1.0, 0.3, 1.0)
    c, s = np.cos(theta), np.sin(theta)
    turned = np.array([[c, -s], [s, c]])
    stress = Anchored(material).cauchy(turned, material.stress(turned))
    lam, mu = material.lame
    return np.abs(stress[0, 0] + stress[1, 1]) / (4.0 * (lam + mu))


def midpoint_stress(steps, modulus=1e4):
    """Mean tension of a disc over what its spin needs, rho omega^2 R^2 / 4, at omega dt (k,), averaged over time."""
    tension = []
    for dt in steps:
        states = simulate(spinning(modulus, cells=5), dt=dt, until=2.0, scheme=Scheme(theta=0.5))
        seen = [0.5 * s.weight @ np.trace(s.stress) / s.weight.sum() for s in states if s.t > 0.3]
        tension.append(np.mean(seen) - 0.25)
    return np.array(tension)


def test_midpoint_swells_a_disc_by_an_eighth_of_the_square_of_its_turn():
    """What theta = 1/2 pays for the angular momentum: stress balances in the middle of the step.

    There a point is by (omega dt)^2 / 8 nearer to the centre than at the ends of its path, so that at the end of the
    step the disc is as much too wide: a mean tension (lambda + mu) (omega dt)^2 / 4 in `State.stress`, within 5 %. It
    is below the stress of the spin only for steps shorter than an elastic wave takes to cross the disc.
    """
    lam, mu = NeoHookean(1e4, 0.3, 1.0).lame
    assert midpoint_stress([0.04])[0] == pytest.approx((lam + mu) * 0.04**2 / 4.0, rel=0.05)


# The table and its figures.


def rows():
    """What docs/verification shows of this module."""
    return [*bar_rows(), *block_rows(), *spin_rows(), *stress_rows()]


def bar_rows():
    """Period and energy of the bar."""
    cells, rows, drifts = np.array([1.0, 0.5, 0.25]), [], {}
    test = "test_bar_keeps_its_period_to_a_thousandth_and_its_energy_over_ten_periods"
    grids = "h = 1, 1/2, 1/4, dt = h/5"
    for name, offset in (("on the grid", 0.0), ("fixed 0.3 h off the grid", 0.3)):
        runs = [vibration(bar(h, offset * h), dt=0.2 * h, periods=10, theta=0.5) for h in cells]
        error = [period(run[0], run[1]) / PERIOD - 1.0 for run in runs]
        drifts[name] = [drift(run[2], run[3]) for run in runs]
        problem, goal = f"axial bar, period, midpoint rule, {name}", "0.1 %: met from h = 1/2 on"
        shown = f"{numbers(error)} of the period"
        rows.append(Row(problem, "separation of variables", grids, shown, f"{rate(cells, error):.2f}", goal, test))
    t, _, elastic, nodes, _ = vibration(bar(1.0), dt=0.1, periods=10)
    left, expected = (elastic + nodes)[-1] / nodes[0], expected_energy(t, 0.1, 1.0)[-1]
    return [
        *rows,
        Row(
            "axial bar, energy over ten periods, midpoint rule",
            "conserved",
            grids,
            "; ".join(f"{name} {numbers(values)}" for name, values in drifts.items()),
            "-",
            "1e-3: met",
            test,
        ),
        Row(
            "axial bar, energy left after ten periods, backward Euler",
            "1 / (1 + (w dt)^2) a step",
            "h = 1, dt = 0.1 s",
            f"{left:.3g} ({expected:.3g} expected)",
            "-",
            "measured decay: shown",
            "test_the_bar_loses_what_backward_euler_loses_and_no_more",
        ),
    ]


def axial_energy(nu, cells, courant=0.3):
    """Energy left after three periods of the first axial mode of a free block 2 R x R; dt = courant h / c."""
    material = NeoHookean(E, nu, 1.0)
    wave = float(np.sqrt(E * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))))
    until = 12.0 / np.sqrt(E / (1.0 - nu**2))

    def velocity(x):
        return np.stack([-1e-3 * wave * np.cos(0.5 * np.pi * x[0]), np.zeros_like(x[0])])

    scene = Scene([Body(box((0, 0), (2.0, 1.0), spacing=0.5 / cells), material, velocity=velocity)], cell=1.0 / cells)
    start = initial(scene)
    *_, state = simulate(scene, dt=courant / cells / wave, until=until, scheme=Scheme(theta=0.5), start=start)
    return (state.report.energy.kinetic + state.report.energy.elastic) / start.report.energy.kinetic


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
def test_a_block_that_vibrates_keeps_its_energy(nu):
    """Midpoint rule, R/h = 5, whatever the block contracts across: the goal, 1e-3.

    If points carried the motion from step to step, a fifth would be lost with nu = 0.45, and more in shorter steps:
    they keep no xi eta part of the velocity.
    """
    assert axial_energy(nu, 5) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("nu", [0.3, 0.45])
def test_new_body_grids_add_no_energy_to_a_disc_that_vibrates(nu):
    """Midpoint rule, strains of 0.3, new grids where they exceed 0.1: energy falls.

    With the velocities that nodes keep on grids that stay it rises by a half with nu = 0.45.
    """
    body = Body(
        disc((0.03, 0.01), 1.0, spacing=0.1), NeoHookean(1.0, nu, 1.0), velocity=lambda x: 0.3 * x * [[1], [-1]]
    )
    start = initial(Scene([body], cell=0.2))
    scene, scheme, energies = Scene([body], cell=0.2), Scheme(theta=0.5, anchor=0.1), [start.report.energy.kinetic]
    for state in simulate(scene, dt=0.05, until=5.0, scheme=scheme):
        energies.append(state.report.energy.kinetic + state.report.energy.elastic)
    assert state.report.energy.regridding != 0.0
    assert max(energies) < 1.001 * energies[0]
    assert energies[-1] < 0.95 * energies[0]


@pytest.mark.parametrize(("nu", "anchor", "warned"), [(0.49, 0.1, 1), (0.3, 0.1, 0), (0.49, np.inf, 0)])
def test_energy_that_new_body_grids_add_is_warned_of_once(nu, anchor, warned, caplog):
    """A disc that spins and vibrates freely has half of its energy from regridding after 40 s, at nu = 0.49."""

    def velocity(x):
        return 0.01 * np.array([x[0] - 2.0 * x[1], 2.0 * x[0] - x[1]])

    body = Body(disc((0.3, 0.1), 5.2, spacing=0.66), NeoHookean(1.0, nu, 1.0), velocity=velocity)
    *_, state = simulate(Scene([body], cell=1.0), until=15.0, dt=0.5, scheme=Scheme(theta=0.5, anchor=anchor))
    found = [message for message in caplog.messages if "new body grids have added energy" in message]
    assert len(found) == warned
    assert (state.report.energy.regridding > 0.05 * state.report.energy.largest) == bool(warned)


@pytest.mark.parametrize(
    ("law", "anchor", "turn", "warned"),
    [
        (LinearElastic, np.inf, 0.06, 1),
        (LinearElastic, np.inf, 0.04, 0),
        (LinearElastic, 0.01, 0.06, 0),
        (NeoHookean, np.inf, 0.06, 0),
    ],
)
def test_a_linear_body_that_turns_is_warned_of_once(law, anchor, turn, warned, caplog):
    """Whatever turns it; in a fit without friction a bush lost its pressure by turning on the shaft."""
    body = Body(disc((0.3, 0.1), 5.2, spacing=0.66), law(1.0, 0.3, 1.0), spin=1e-3)
    run(Scene([body], cell=1.0), until=turn / 1e-3, dt=1.0, scheme=Scheme(theta=0.5, anchor=anchor), warn=False)
    found = [message for message in caplog.messages if "body 0" in message and "it has turned by 0.05" in message]
    assert len(found) == warned


def block_rows():
    """Energy of the block."""
    runs = (5, 0.3), (10, 0.3), (5, 0.15)
    lost = {nu: [1.0 - axial_energy(nu, *run) for run in runs] for nu in (0.0, 0.3, 0.45)}
    return [
        Row(
            "free block 2 R x R, first axial mode, midpoint rule: energy lost in three periods",
            "conserved",
            "R/h = 5, 10, dt c = 0.3 h; R/h = 5, dt c = 0.15 h",
            "; ".join(f"nu = {nu:g}: {numbers(values)}" for nu, values in lost.items()),
            "-",
            "1e-3: met",
            "test_a_block_that_vibrates_keeps_its_energy",
        )
    ]


def spin_rows():
    """Angular momentum of the disc."""
    kept, _ = spin(1e4, cells=10, dt=0.01, angle=2.0 * np.pi, theta=0.5)
    whole_turn = np.abs(kept / kept[0] - 1.0).max()
    sizes, lost_by_soft, rebuilt = (5, 10, 20), [], []
    for cells in sizes:
        for anchor, found in ((np.inf, lost_by_soft), (0.0, rebuilt)):
            kept, _ = spin(100.0, cells=cells, dt=0.02, angle=1.0, theta=0.5, anchor=anchor)
            found.append(np.abs(kept / kept[0] - 1.0).max())
    turns, lost = backward_euler_losses([0.1, 0.05, 0.025, 0.0125])
    return [
        Row(
            "free spin of a disc, midpoint rule: angular momentum over one turn",
            "conserved",
            "R/h = 10, E = 1e4 rho omega^2 R^2, omega dt = 0.01",
            f"{whole_turn:.1e}",
            "-",
            "1e-10: met for this disc",
            "test_midpoint_keeps_the_angular_momentum_of_a_spinning_disc",
        ),
        Row(
            "free spin of a soft disc, E = 100 rho omega^2 R^2: angular momentum over one radian",
            "conserved",
            "R/h = 5, 10, 20",
            f"{numbers(lost_by_soft)}; with new body grids in every step {numbers(rebuilt)}",
            "-",
            "1e-10: met on one grid; points, which carry the motion to the next, keep no xi eta part of it",
            "test_only_new_body_grids_take_angular_momentum_from_a_soft_disc",
        ),
        Row(
            "free spin of a disc, backward Euler: loss of angular momentum per step",
            "(omega dt)^2; rigid disc: tan phi' = sin phi / (2 - cos phi)",
            f"omega dt = {numbers(turns)}",
            f"{numbers(lost / turns**2, 4)} (omega dt)^2; {np.abs(lost / rigid_loss(turns) - 1.0).max():.0e} of the"
            " rigid disc's",
            f"{rate(turns**2, lost):.3f} in (omega dt)^2",
            "measured: shown",
            "test_backward_euler_loses_the_square_of_the_turn_per_step",
        ),
    ]


def stress_rows():
    """Stress of the rotating disc."""
    sizes, theta = (5, 10, 20), np.array([0.01, 0.05, 0.3])
    ends = [turning(NeoHookean, 1.5, cells=cells)[:, -1] for cells in sizes]
    _, turned, largest, _, _, _ = turning(NeoHookean, 6.4)
    error, pressure = [end[5] for end in ends], [abs(end[3] - 1.0) for end in ends]
    steps = np.array([0.04, 0.02, 0.01])
    swelling = midpoint_stress(steps) / ((sum(NeoHookean(1e4, 0.3, 1.0).lame)) * steps**2 / 4.0)
    return [
        Row(
            "a NeoHookean disc that rotates freely: Cauchy stress, backward Euler",
            "steadily rotating disc, plane strain",
            "R/h = 5, 10, 20",
            f"{numbers(error)} (L2); mean {numbers(pressure)}",
            f"{rate(1.0 / np.array(sizes), error):.2f}; {rate(1.0 / np.array(sizes), pressure):.1f}",
            f"no false stress: met, at most {largest[100:].max():.2f} rho omega^2 R^2 over {turned[-1]:.1f} rad",
            "test_a_neohookean_disc_turns_with_the_stress_of_its_spin_and_no_other",
        ),
        Row(
            "a LinearElastic disc turned by theta = 0.01, 0.05, 0.3: false strain",
            "1 - cos(theta)",
            "-",
            f"{numbers(false_strain(LinearElastic, theta), 3)} beside theta^2/2 = {numbers(0.5 * theta**2, 3)};"
            f" NeoHookean at most {false_strain(NeoHookean, theta).max():.0e}",
            "-",
            "shown: LinearElastic is for small rotations",
            "test_a_linear_elastic_disc_sees_a_false_strain_and_flies_apart",
        ),
        Row(
            "a NeoHookean disc that rotates freely, midpoint rule: mean false tension at the ends of steps",
            "(lambda + mu) (omega dt)^2 / 4",
            f"omega dt = {numbers(steps)}",
            f"{numbers(swelling, 3)} of it",
            "-",
            "none: stress balances in the middle of the step",
            "test_midpoint_swells_a_disc_by_an_eighth_of_the_square_of_its_turn",
        ),
    ]


def figures(folder):
    """Draw energies of the bar, losses of the spinning disc, and its stress."""
    import matplotlib

    matplotlib.use("Agg")
    draw_bar(folder / "dynamics_bar.png")
    draw_spin(folder / "dynamics_spin.png")
    draw_stress(folder / "dynamics_stress.png")
    return {
        "dynamics_bar.png": "Energy of the axial bar over ten periods by time scheme, h = 1/2, dt = 0.1 s; dotted,"
        " what backward Euler loses in closed form. Right, its distance from the first with the midpoint rule.",
        "dynamics_spin.png": "Angular momentum of a freely spinning disc. Left, the loss per step against (omega"
        " dt)^2 (line: a rigid disc under backward Euler). Right, with the midpoint rule, by stiffness; and with new"
        " body grids in every step, where points carry the motion.",
        "dynamics_stress.png": "A NeoHookean disc that rotates freely (R/h = 10). Left, its largest stress, and the"
        " one that a strain linear in the displacement would see in the rotation. Right, the stress at the points"
        " after 6.3 rad and, as lines, of a steadily rotating disc.",
    }


def draw_bar(path):
    """Energy of the bar over time."""
    from matplotlib import pyplot as plt

    fig, (left, right) = plt.subplots(1, 2, figsize=(9, 4), width_ratios=(3, 2))
    for theta, colour in ((0.5, "C0"), (1.0, "C1")):
        t, _, elastic, nodes, _ = vibration(bar(0.5), dt=0.1, periods=10, theta=theta)
        energy = (elastic + nodes) / nodes[0]
        left.plot(t / PERIOD, energy, color=colour, label=f"theta = {theta:g}")
        left.plot(t / PERIOD, expected_energy(t, 0.1, theta), ":", color="k", lw=0.8)
        if theta == 0.5:
            right.semilogy(t[1:] / PERIOD, np.abs(energy[1:] - 1.0) + 1e-16, color=colour)
    right.axhline(1e-3, color="k", lw=0.8, ls=":")
    left.set(xlabel="periods", ylabel="energy / first", ylim=(0.0, 1.05))
    right.set(xlabel="periods", ylabel="|energy / first - 1|, theta = 1/2", ylim=(1e-16, 1e-2))
    left.legend(fontsize=8)
    save(fig, path)


def draw_spin(path):
    """Loss of angular momentum."""
    from matplotlib import pyplot as plt

    fig, (left, right) = plt.subplots(1, 2, figsize=(9, 4))
    turns, lost = backward_euler_losses([0.2, 0.1, 0.05, 0.025, 0.0125])
    left.loglog(turns**2, lost, "o", label="theta = 1")
    left.loglog(turns**2, rigid_loss(turns), "k-", lw=0.8, label="theta = 1, rigid disc")
    steps = np.array([0.05, 0.025, 0.0125])  # with 0.1 the midpoint rule gains energy, and the run ends
    drifts = []
    for dt in steps:
        kept, _ = spin(1e4, cells=5, dt=dt, angle=20 * dt, theta=0.5)
        drifts.append(abs(1.0 - kept[-1] / kept[0]) / 20)
    left.loglog(steps**2, drifts, "s", label="theta = 1/2")
    left.set(xlabel="(omega dt)^2", ylabel="loss of angular momentum per step")
    for modulus in (1e2, 1e3, 1e4):
        kept, _ = spin(modulus, cells=5, dt=0.01, angle=3.0, theta=0.5)
        right.semilogy(np.abs(kept / kept[0] - 1.0) + 1e-16, label=f"E = {modulus:g} rho omega^2 R^2")
    kept, _ = spin(100.0, cells=5, dt=0.01, angle=3.0, theta=0.5, anchor=0.0)
    right.semilogy(np.abs(kept / kept[0] - 1.0) + 1e-16, color="k", label="E = 100, a new body grid in every step")
    right.set(xlabel="steps of 0.01 rad", ylabel="|angular momentum / first - 1|", ylim=(1e-17, 1e-2))
    left.legend(fontsize=8)
    right.legend(fontsize=8)
    save(fig, path)


def draw_stress(path):
    """Stress of the rotating disc."""
    from matplotlib import pyplot as plt

    fig, (left, right) = plt.subplots(1, 2, figsize=(9, 4))
    _, turned, largest, _, _, _ = turning(NeoHookean, 6.4, cells=10)
    left.semilogy(turned, largest, label="NeoHookean, rotating freely")
    false = 2.0 * sum(NeoHookean(1e3, 0.3, 1.0).lame) * (1.0 - np.cos(np.minimum(turned, np.pi)))
    left.semilogy(turned, np.maximum(false, 1e-3), "--", label="false stress of a linear strain")
    left.axhline((3.0 - 0.6) / (8.0 * 0.7), color="k", lw=0.8, label="steadily rotating disc")
    left.set(xlabel="angle [rad]", ylabel="largest stress / rho omega^2 R^2", ylim=(1e-1, 1e4))
    *_, state = simulate(spinning(1e3, cells=10), dt=0.01, until=6.4)
    arm = state.x - (state.x @ state.mass / state.mass.sum())[:, None]
    speed = state.mass @ cross(arm, state.v) / (state.mass @ (arm**2).sum(axis=0))
    r = np.hypot(*arm)
    order = np.argsort(r)
    for stress, style in ((state.stress, "."), (steady_stress(arm, 0.3, speed), "-")):
        for direction, colour, name in ((arm / r, "C0", "radial"), (np.stack([-arm[1], arm[0]]) / r, "C1", "hoop")):
            along = np.einsum("in,ijn,jn->n", direction, stress, direction) / speed**2
            right.plot(r[order], along[order], style, ms=3, color=colour, label=name if style == "." else None)
    right.set(xlabel="r / R", ylabel="stress / rho omega^2 R^2")
    left.legend(fontsize=8)
    right.legend(fontsize=8)
    save(fig, path)


def save(fig, path):
    """Write and close a figure."""
    from matplotlib import pyplot as plt

    fig.tight_layout()
    fig.savefig(path, dpi=120)
    plt.close(fig)
