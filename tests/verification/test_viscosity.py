r"""Viscous damping: single modes decay as closed forms say, to 1 %, in strips, stacks of boxes and packings of discs.

An undamped mode of frequency $\omega_0$ becomes $\ddot x + 2 \gamma \dot x + \omega_0^2 x = 0$ with the viscosity
$\eta$ of Kelvin and Voigt. Steps follow the midpoint rule, which by itself takes no energy; strains are below 1e-3.

- A strip between lateral supports has the modes $\sin(k x)$, $k = \pi / L$, with $\gamma = \eta k^2 / \rho$ along the
  strip and $\gamma = \eta k^2 / 2 \rho$ across it. Boxes pressed together in a row have the same mode as long as
  their contacts stay closed.
- The shapes of the modes of a disc packing are not known. For $\nu = 0$ the viscous stress $2 \eta d$ is
  $\tau = \eta / \mu$ times the rate of the elastic stress $2 \mu \varepsilon$, so the damping matrix is $\tau K$.
  Every mode obeys $\ddot q + \tau \omega^2 \dot q + \omega^2 q = 0$ as long as no contact opens, closes or slides
  with friction. Its kinetic energy decays at the rate $\tau \omega^2$. Only $\omega$ is measured, without viscosity.
"""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from ledger import Row, tabulated, texts

from skmpm import Body, LinearElastic, NeoHookean, Scene, Scheme, Support, Wall, box, disc, initial, simulate, step

E, RHO, ETA = 1e4, 1000.0, 1.0
MIDPOINT = Scheme(theta=0.5, newton_tol=1e-9)
LAWS = (LinearElastic, NeoHookean)


def strip(law, eta, axis, size=1e-3, nu=0.3, cells=24):
    """A strip of unit length whose points move along `axis` only, its ends held, with the velocity sin(pi x)."""
    cell = 1.0 / cells
    held = [(0.0, None), (None, 0.0)][1 - axis]
    ends = Support(lambda x: (x[0] < 1e-9) | (x[0] > 1 - 1e-9), velocity=[(0.0, None), (None, 0.0)][axis])
    everywhere = Support(lambda x: x[0] > -1.0, velocity=held)

    def wave(x):
        v = np.zeros_like(x)
        v[axis] = size * np.sin(np.pi * x[0])
        return v

    points = box((0.0, 0.0), (1.0, 2 * cell), spacing=cell / 2)
    body = Body(points, law(E, nu, RHO, viscosity=eta), velocity=wave)
    return Scene([body], cell=cell, supports=[ends, everywhere])


def expected(law, axis, eta, nu=0.3):
    """Decay rate and damped frequency of the first mode of the strip [1/s]."""
    lam, mu = law(E, nu, RHO).lame
    modulus, viscosity = (lam + 2 * mu, 2 * eta) if axis == 0 else (mu, eta)
    gamma = viscosity * np.pi**2 / (2 * RHO)
    return gamma, np.sqrt(modulus * np.pi**2 / RHO - gamma**2)


def oscillation(t, x):
    """Decay rate and frequency [1/s] of samples exp(-gamma t) cos(omega t + phase) at even times (Prony)."""
    a, b = np.linalg.lstsq(np.stack([x[1:-1], x[:-2]], axis=1), x[2:], rcond=None)[0]
    root = np.roots([1.0, -a, -b])[0]
    return -np.log(abs(root)) / (t[1] - t[0]), abs(np.angle(root)) / (t[1] - t[0])


def of_strip(law, axis, eta, steps=200):
    """Relative errors of decay rate and frequency, over one period; of the mean velocity along the axis."""
    gamma, omega = expected(law, axis, eta)
    dt = 2 * np.pi / omega / steps
    states = list(simulate(strip(law, eta, axis), dt=dt, until=steps * dt, scheme=MIDPOINT))
    mean = np.array([state.v[axis] @ state.mass / state.mass.sum() for state in states])
    found = oscillation(np.array([state.t for state in states]), mean)
    return found[0] / gamma - 1.0, found[1] / omega - 1.0


@pytest.mark.parametrize("axis", [0, 1], ids=["along", "across"])
@pytest.mark.parametrize("law", LAWS)
def test_a_mode_of_a_strip_decays_as_its_closed_form(law, axis):
    """Decay to 1 %, frequency to 0.5 %: 24 cells to half a wave, (kh)^2 / 12 = 0.14 %; 100 steps to a period."""
    eta = 8.0 if axis == 0 else 16.0
    decay, frequency = of_strip(law, axis, eta, steps=100)
    assert abs(decay) < 0.01
    assert abs(frequency) < 0.005


def stack(law, eta, speed=0.0, nu=0.3, cells=24, boxes=2):
    """Boxes in a row between walls at 0 and 1, which approach by 2 `speed`, and between lateral supports."""
    cell, width = 1.0 / cells, 1.0 / boxes
    rows = [box((i * width, 0.0), (width, 2 * cell), spacing=cell / 2) for i in range(boxes)]
    walls = [Wall((x, 0.0), (n, 0.0), velocity=(n * speed, 0.0)) for x, n in ((0.0, 1.0), (1.0, -1.0))]
    lateral = Support(lambda x: x[0] > -1.0, velocity=(None, 0.0))
    bodies = [Body(points, law(E, nu, RHO, viscosity=eta)) for points in rows]
    return Scene(bodies, cell=cell, walls=walls, supports=[lateral])


def of_stack(law, eta, steps=200, press=0.01):
    """As `of_strip` for boxes pressed together by 1 %, at rest, then moved by sin(pi x); the lowest contact force."""
    gamma, omega = expected(law, 0, eta)
    still = Scheme(inertia=False, newton_tol=1e-9)
    pressed = step(stack(law, 0.0, speed=press / 2), initial(stack(law, 0.0), scheme=still), 1.0, scheme=still)
    scene, dt = stack(law, eta), 2 * np.pi / omega / steps
    x, v, C = pressed.x_anchor[0], np.zeros_like(pressed.x), np.zeros_like(pressed.C)
    v[0], C[0, 0] = 1e-3 * np.sin(np.pi * x), 1e-3 * np.pi * np.cos(np.pi * x)
    state, mean, lowest = replace(pressed, v=v, C=C), [], np.inf
    for _ in range(steps):
        state = step(scene, state, dt, scheme=MIDPOINT)
        mean.append(state.v[0] @ state.mass / state.mass.sum())
        between = state.contacts.bodies[1] >= 0
        walls = state.wall_force[:, 0] @ np.diag((-1.0, 1.0))
        lowest = min(lowest, state.contacts.force[0, between].sum(), *walls)
    found = oscillation(dt * np.arange(steps), np.array(mean))
    return found[0] / gamma - 1.0, found[1] / omega - 1.0, lowest


@pytest.mark.parametrize("law", LAWS)
def test_a_packing_at_rest_under_pressure_loses_a_mode_as_its_closed_form(law):
    """Two boxes, whose contacts stay closed, move like the strip: to 1 %; at finite strain to 3 and 2 %.

    Pressed by 1 %, the finite-strain law is stiffer and denser by about as much.
    """
    decay, frequency, lowest = of_stack(law, 8.0, steps=100)
    assert lowest > 0.0
    assert abs(decay) < (0.01 if law is LinearElastic else 0.03)
    assert abs(frequency) < (0.01 if law is LinearElastic else 0.02)


BALANCED = {"newton_tol": 1e-9, "contact_tol": 1e-11, "gap_tol": 1e-10}
HEIGHT, WIDTH = 2.0 + 2.0 * np.sqrt(3.0), 6.0  # of eight discs of radius 1 m in rows of three, two and three


def packed(eta, cells=4, speed=0.0):
    """Eight frictionless discs (nu = 0) in a box whose sides shrink at the rate `speed` [1/s]."""
    rows = ((3, 1.0), (2, 2.0), (3, 1.0))
    centres = [(x + 2.0 * i, 1.0 + np.sqrt(3.0) * row) for row, (n, x) in enumerate(rows) for i in range(n)]
    law = LinearElastic(E, 0.0, RHO, viscosity=eta)
    walls = [Wall((0.0, 0.0), (0.0, 1.0)), Wall((0.0, HEIGHT), (0.0, -1.0), velocity=(0.0, -speed * HEIGHT))]
    walls += [Wall((0.0, 0.0), (1.0, 0.0)), Wall((WIDTH, 0.0), (-1.0, 0.0), velocity=(-speed * WIDTH, 0.0))]
    return Scene([Body(disc(c, 1.0, spacing=0.5 / cells), law) for c in centres], cell=1.0 / cells, walls=walls)


def compacted(cells=4, press=0.02):
    """At rest after the box has shrunk by 2 % quasi-statically; every disc then has closed contacts on all sides."""
    scheme = Scheme(inertia=False, **BALANCED)
    *_, state = simulate(packed(0.0, cells, press), dt=0.2, until=1.0, scheme=scheme)
    return state


def swings(rest, motion, eta, cells=4, theta=0.5, dt=0.1, until=15.0):
    """The states after small velocities and gradients `motion` of a packing at rest, and whether contacts stayed."""
    state, scheme = replace(rest, v=motion[0], C=motion[1]), Scheme(theta=theta, **BALANCED)
    states = list(simulate(packed(eta, cells), dt=dt, until=state.t + until, start=state, scheme=scheme))
    closed = {(s.contacts.key[s.contacts.force[0] > 0.0]).tobytes() for s in states}
    return states, len(closed) == 1


def kinetic_decay(states):
    """Rate of decay of the maxima of the kinetic energy, and the frequency of the motion [1/s]."""
    t, y = (np.array(a) for a in zip(*((s.t, np.log(s.report.energy.kinetic)) for s in states), strict=True))
    i = 1 + np.flatnonzero((y[1:-1] >= y[:-2]) & (y[1:-1] > y[2:]))
    shift = 0.5 * (y[i - 1] - y[i + 1]) / (y[i - 1] - 2.0 * y[i] + y[i + 1])  # of the parabola's top [steps]
    at, top = t[i] + shift * (t[1] - t[0]), y[i] - 0.25 * (y[i - 1] - y[i + 1]) * shift
    return -np.polyfit(at, top, 1)[0], np.pi * (at.size - 1) / (at[-1] - at[0])


def one_mode(states, omega, size):
    """Velocities and gradients of the part of a motion that swings at `omega`: its Fourier coefficient (Hann)."""
    t = np.array([s.t for s in states])
    window = np.hanning(t.size) * np.exp(-1j * omega * t)
    v, C = (np.tensordot(window, np.array([getattr(s, a) for s in states]), axes=1) for a in ("v", "C"))
    real = np.exp(-0.5j * np.angle(np.sum(v**2 * states[0].mass)))
    scale = size / np.abs(v).max()
    return scale * (real * v).real, scale * (real * C).real


def of_packing(eta, cells=4, theta=0.5, size=1e-5, until=15.0):
    """Relative errors of the decay rate of the kinetic energy and of the frequency, and whether contacts stayed.

    The lowest mode of vertical motion: a velocity sin(pi y / H) excites it to 97 %, its Fourier coefficient alone.
    The decay of the same motion without viscosity (the transfer of velocities, and theta = 1) is subtracted.
    """
    rest = compacted(cells)
    k, v, C = np.pi / HEIGHT, np.zeros_like(rest.v), np.zeros_like(rest.C)
    v[1], C[1, 1] = size * np.sin(k * rest.x[1]), size * k * np.cos(k * rest.x[1])
    first, _ = swings(rest, (v, C), 0.0, cells, until=until)
    mode = one_mode(first, kinetic_decay(first)[1], size)
    plain, viscous = (swings(rest, mode, each, cells, theta, until=until) for each in (0.0, eta))
    (lost, omega), (found, slower) = kinetic_decay(plain[0]), kinetic_decay(viscous[0])
    rate = eta / packed(0.0).bodies[0].material.lame[1] * omega**2
    return (found - lost) / rate - 1.0, slower / np.sqrt(omega**2 - 0.25 * rate**2) - 1.0, plain[1] and viscous[1]


@pytest.mark.slow
def test_the_kinetic_energy_of_a_packing_at_rest_decays_as_one_mode_of_its_frequency():
    """Damped by 5 % of critical: rate to 1 %, frequency to 0.1 %; all closed contacts stay closed.

    Geometric stiffness of the contacts belongs to omega^2 and is not damped: pressure over E, here 0.7 %. A material
    with nu = 0.3 is damped by 22 % less, since a volumetric stress has no viscous part.
    """
    decay, frequency, stayed = of_packing(400.0, until=9.0)
    assert stayed
    assert abs(decay) < 0.01
    assert abs(frequency) < 0.001


def of_budget(eta=400.0):
    """What the report says is viscous against 2 eta |d|^2 of the recorded strains, in a packing of three discs."""
    material = LinearElastic(E, 0.45, RHO, viscosity=eta)
    centres = ((0.0, 0.0), (2.0, 0.0), (1.0, 1.74))
    smooth = partial(Wall, friction=0.0)
    walls = [smooth((0.0, -1.0), (0.0, 1.0)), smooth((0.0, 2.74), (0.0, -1.0), velocity=(0.0, -0.05))]
    walls += [smooth((-1.0, 0.0), (1.0, 0.0)), smooth((3.0, 0.0), (-1.0, 0.0))]
    bodies = [Body(disc(c, 1.0, spacing=0.125), material) for c in centres]
    scene, scheme, dt = Scene(bodies, cell=0.25, walls=walls, friction=0.3), Scheme(), 0.02
    state, total = initial(scene, scheme=scheme), 0.0
    for _ in range(30):
        before, state = state, step(scene, state, dt, scheme=scheme)
        change = 0.5 * (state.F - before.F + (state.F - before.F).swapaxes(0, 1)) / dt
        total += dt * 2 * eta * float(state.derived.assembly.volume @ np.sum(change**2, axis=(0, 1)))
    return state.report.energy.viscous / total - 1.0, state


def test_the_report_counts_what_the_strains_of_a_packing_say():
    """To rounding; most of the work that the lid does in this fast press."""
    error, state = of_budget()
    assert abs(error) < 1e-10
    assert state.report.energy.viscous > 0.1 * state.report.energy.external


# The table.


def rows():
    ways, heads = {0: "along", 1: "across"}, ("decay rate", "frequency")
    out = [
        Row(
            problem=f"first mode of a strip, {ways[axis]} it, {eta:g} Pa s",
            reference="closed form",
            h="1/24",
            error=tabulated(heads, {law.__name__: texts(of_strip(law, axis, eta)) for law in LAWS}),
            rate="-",
            goal="1 % and 0.5 %: met",
            test="test_a_mode_of_a_strip_decays_as_its_closed_form",
        )
        for axis, eta in ((0, 8.0), (1, 16.0))
    ]
    out.append(
        Row(
            problem="first mode along two boxes pressed by 1 %",
            reference="closed form",
            h="1/24",
            error=tabulated(heads, {law.__name__: texts(of_stack(law, 8.0)[:2]) for law in LAWS}),
            rate="-",
            goal="1 % (small strain), 3 % (finite strain, stiffer under pressure): met",
            test="test_a_packing_at_rest_under_pressure_loses_a_mode_as_its_closed_form",
        )
    )
    of_discs = [of_packing(400.0, cells)[:2] for cells in (4, 5)]
    out.append(
        Row(
            problem="kinetic energy of one mode of eight discs",
            reference=r"$\eta \omega^2 / \mu$ with $\omega$ measured without viscosity",
            h="nu = 0, compacted by 2 %",
            error=tabulated(heads, {f"R/h = {n}": texts(errors) for n, errors in zip((4, 5), of_discs, strict=True)}),
            rate="-",
            goal="1 % (pressure over E: 0.7 %) and 0.1 %: met",
            test="test_the_kinetic_energy_of_a_packing_at_rest_decays_as_one_mode_of_its_frequency",
        )
    )
    out.append(
        Row(
            problem="dissipation of three pressed discs",
            reference="rates of strain of the recorded states",
            h="R/h = 4",
            error=tabulated(["error"], {"": texts([of_budget()[0]])}),
            rate="-",
            goal="rounding: met",
            test="test_the_report_counts_what_the_strains_of_a_packing_say",
        )
    )
    return out
