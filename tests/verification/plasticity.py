"""Problems of plasticity: a bar, a tube, a notched bar and a disc under a plate, with what is known of them."""

from functools import cache

import meshio
import numpy as np
from fem import disc_mesh, mapped
from fem_plastic import VonMises, press
from scipy.optimize import brentq

from skmpm import Body, ElastoPlastic, Pressure, Scene, Scheme, Support, Wall, box, points, simulate

E, NU, YIELD, HARDENING = 1e6, 0.3, 1e4, 5e4  # [Pa]
LAW = ElastoPlastic(E, NU, 1000.0, yield_stress=YIELD, hardening=HARDENING)
CYCLE = ([0, 1, 2, 3], [0.0, 0.06, 0.0, 0.1])  # elongation of the bar over time [m]
LENGTH, WIDTH = 2.0, 1.0
SHEAR = 1 / np.sqrt(3)  # yield stress in shear over that in tension
INNER, OUTER = 1.0, 2.0
ZONES = (1.25, 1.5)  # radii of the plastic zone in the tube
NET, GROSS = 0.5, 2.0  # half widths of the notched bar
STROKES = np.concatenate([np.linspace(0.01, 0.1, 10), np.linspace(0.096, 0.08, 5)])


def on(axis, value=0.0):
    """Where a coordinate has a value."""
    return lambda x: np.abs(x[axis] - value) < 1e-9


# A bar in tension and compression.


def bar(turned=False, h=0.25, law=LAW):
    """A bar in plane strain whose end moves by `CYCLE`, along x or, turned by a right angle, along y."""

    def components(along, across):
        return (across, along) if turned else (along, across)

    size, along = components(LENGTH, WIDTH), int(turned)
    elongation = lambda t: components(np.interp(t, *CYCLE), None)  # noqa: E731
    supports = [
        Support(on(along), velocity=components(0.0, None)),
        Support(on(1 - along), velocity=components(None, 0.0)),
        Support(on(along, LENGTH), displacement=elongation),
    ]
    return Scene([Body(box((0.0, 0.0), size, spacing=h / 2), law)], cell=h, supports=supports)


def bar_in_steps(steps, **options):
    """The states of the bar, with so many steps for each leg of the cycle."""
    scheme = Scheme(inertia=False, newton_tol=1e-9)
    return list(simulate(bar(**options), dt=1 / steps, until=3.0, scheme=scheme))


def by_point(elongations):
    """Cauchy stress along the bar and equivalent plastic strain, (steps,), by the return mapping of `fem_plastic`.

    In each step the stretch across the bar is found for which nothing pulls there.
    """
    law, inverse_cp, hardened, found = VonMises(E, NU, YIELD, HARDENING), np.eye(3)[None], np.zeros(1), []
    for elongation in elongations:
        along, before = 1 + elongation / LENGTH, (inverse_cp, hardened)

        def respond(y, along=along, before=before):
            return law.respond(np.diag([along, y])[:, :, None], *before)

        across = brentq(lambda y, respond=respond: respond(y)[0][1, 1, 0], 0.8, 1.2, xtol=1e-15, rtol=1e-14)
        P, inverse_cp, hardened = respond(across)
        found.append((P[0, 0, 0] / across, hardened[0]))
    return np.array(found).T


# A tube under internal pressure.


def hill(zone):
    """Pressure over the yield stress, perfectly plastic, by the radius of the plastic zone.

    Hill, The Mathematical Theory of Plasticity, 1950, chapter V.
    """
    return SHEAR * (1 - zone**2 / OUTER**2 + 2 * np.log(zone / INNER))


def outer_displacement(zone, nu, yield_stress):
    """Radial displacement of the outer surface [m]: around the plastic zone the tube is Lame's."""
    return (1 - nu**2) / E * 2 * SHEAR * yield_stress * zone**2 / OUTER


@cache
def tube(h, nu=0.45, yield_stress=100.0, **options):
    """Errors of the outer displacement (zones,), relative, and radii of the plastic zone (zones,), by its area."""
    n, m = round((OUTER - INNER) / h), round(0.75 * np.pi * INNER / h)

    def shape(p):
        r, angle = INNER + (OUTER - INNER) * p[0], np.pi / 2 * p[1]
        return np.array([r * np.cos(angle), r * np.sin(angle)])

    mesh = mapped(n, m, shape)
    cloud = points.from_mesh(meshio.Mesh(mesh.p.T, [("quad", mesh.t.T)]))
    law = ElastoPlastic(E, nu, 1000.0, yield_stress=yield_stress)
    supports = [Support(on(0), velocity=(0.0, None)), Support(on(1), velocity=(None, 0.0))]
    values = [0.0, *(yield_stress * hill(zone) for zone in ZONES)]
    load = Pressure(lambda x: np.hypot(*x) < INNER + 1e-9, lambda t: float(np.interp(t, range(len(values)), values)))
    scene = Scene([Body(cloud, law)], cell=h, supports=supports, loads=[load])
    scheme, found = Scheme(inertia=False, newton_tol=1e-6, **options), []
    r = np.hypot(*cloud.x)
    rim = r > OUTER - 1e-9
    for state in simulate(scene, dt=0.25, until=float(len(ZONES)), scheme=scheme):
        if abs(state.t - round(state.t)) > 1e-9:
            continue
        zone = ZONES[round(state.t) - 1]
        moved = np.hypot(*state.x[:, rim]).mean() - OUTER
        area = cloud.volume[state.internal[0] > 0.0].sum()
        found.append((moved / outer_displacement(zone, nu, yield_stress) - 1, np.sqrt(INNER**2 + 4 * area / np.pi)))
    return np.array(found).T


# A bar with deep notches.

# Limit load over the ligament and the yield stress, for ligaments wider than 0.116 of the bar (Ewing & Hill 1967).
NOTCHED = 2 * SHEAR * (1 + np.log((1 + NET / GROSS) / (2 * NET / GROSS)))


@cache
def notched(h, yield_stress=100.0, steps=10, **options):
    """Nominal stress in the ligament over the yield stress at the last steps of a pull far beyond the limit load."""
    cloud = box((0.0, 0.0), (GROSS, 3.0), spacing=h / 2)
    law = ElastoPlastic(E, NU, 1000.0, yield_stress=yield_stress)
    pull = 30 * yield_stress / E
    supports = [
        Support(on(0), velocity=(0.0, None)),
        Support(lambda x: on(1)(x) & (x[0] < NET + 1e-9), velocity=(None, 0.0)),
        Support(on(1, 3.0), displacement=lambda t: (None, pull * t)),
    ]
    scene = Scene([Body(cloud, law)], cell=h, supports=supports)
    scheme = Scheme(inertia=False, newton_tol=1e-5, **options)
    states = simulate(scene, dt=1 / steps, until=1.0, scheme=scheme)
    return np.array([-state.support_force[2, 1] / NET / yield_stress for state in states])


# A disc between plates.


@cache
def reference():
    """A quarter of the disc by finite elements."""
    return press(VonMises(E, NU, YIELD, HARDENING), 1 / 16, STROKES)


def quarter(spacing):
    """The points of a quarter of a disc of radius 1."""
    mesh = disc_mesh(2 * spacing)
    centre = mesh.p[:, mesh.t].mean(axis=1)
    mesh = mesh.restrict(np.flatnonzero((centre > 0).all(axis=0)))
    return points.from_mesh(meshio.Mesh(mesh.p.T, [("quad", mesh.t.T)]))


@cache
def disc(h, across=3, offset=(0.13, 0.29), **options):
    """Forces of the plate (steps,), height of the top of the disc after unloading, last state, centre (2, 1).

    There are `across` points along the side of a cell; the centre lies `offset` cells from a grid line.
    """
    cloud, centre = quarter(h / across), h * np.array(offset)[:, None]
    moved, (x, y) = points.Points(cloud.x + centre, cloud.volume, cloud.outline), centre[:, 0]
    change = np.diff(STROKES, prepend=0.0)
    plate = Wall((0.0, y + 1.0), (0.0, -1.0), velocity=lambda t: (0.0, -change[int(t)]))
    supports = [Support(on(0, x), velocity=(0.0, None)), Support(on(1, y), velocity=(None, 0.0))]
    scene = Scene([Body(moved, LAW)], cell=h, walls=[plate], supports=supports)
    scheme = Scheme(inertia=False, newton_tol=1e-5, **options)
    states = list(simulate(scene, dt=1.0, until=float(STROKES.size), scheme=scheme))
    force = np.array([state.wall_force[0, 1] for state in states])
    return force, states[-1].x[1, np.argmax(cloud.x[1])] - y, states[-1], centre
