"""Motions with the body forces that drive them, and the material points that should follow.

A problem gives the motion x(X, t), its velocity and the body force per mass b(X, t), all (2, n) for X (2, n), such
that rho a = Div P + rho b with the stress of its material. Bodies start without strain, so each problem begins when
it passes through its initial shape.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from skmpm import NeoHookean, Points, Support, box

E, RHO = 1e6, 1000.0
C = np.sqrt(E / RHO)  # [m/s]
NEAR = 1e-9


@dataclass(frozen=True)
class Problem:
    """A manufactured solution; `points(cell, per_cell, corner)` lays its cloud, `supports(corner)` holds it."""

    material: NeoHookean
    until: float  # [s]
    position: Callable
    velocity: Callable
    force: Callable
    points: Callable
    supports: Callable


def on(X, axis, value):
    """Which points X (2, n) lie on the line X[axis] = value."""
    return np.abs(X[axis] - value) < NEAR


def bar(amplitude=0.05):
    """A bar of length 1 held at both ends: u = A sin(2 pi X) cos(c pi t), P = (E/2)(F - 1/F), c^2 = E/rho.

    It is one cell high; with nu = 0 nothing happens across. It starts at c t = 1/2, where u = 0.
    """

    def phase(t):
        return np.pi * (C * t + 0.5)

    def along(X, value):
        return np.stack([value, np.zeros_like(value)])

    def position(X, t):
        return X + along(X, amplitude * np.sin(2 * np.pi * X[0]) * np.cos(phase(t)))

    def velocity(X, t):
        return along(X, -np.pi * C * amplitude * np.sin(2 * np.pi * X[0]) * np.sin(phase(t)))

    def force(X, t):
        u = amplitude * np.sin(2 * np.pi * X[0]) * np.cos(phase(t))
        F = 1.0 + 2 * np.pi * amplitude * np.cos(2 * np.pi * X[0]) * np.cos(phase(t))
        return along(X, (np.pi * C) ** 2 * u * (1.0 + 2.0 / F**2))

    def points(cell, per_cell, corner):
        return box(corner, (1.0, cell), spacing=cell / per_cell)

    def supports(corner):
        return [Support(lambda X: on(X, 0, corner[0]) | on(X, 0, corner[0] + 1.0), velocity=(0.0, None))]

    return Problem(NeoHookean(E, 0.0, RHO), 0.02, position, velocity, force, points, supports)


def square(amplitude=0.05):
    """The unit square between sliding walls: u = A sin(2 pi X) sin(c pi t), v = A sin(2 pi Y) sin(c pi t + pi).

    Wallstedt & Guilkey, J. Comput. Phys. 227 (2008); P = lambda ln J F^-T + mu (F - F^-T), c^2 = E/rho.
    """
    material = NeoHookean(E, 0.3, RHO)
    lam, mu = material.lame
    shift = np.array([[0.0], [np.pi]])

    def position(X, t):
        return X + amplitude * np.sin(2 * np.pi * X) * np.sin(C * np.pi * t + shift)

    def velocity(X, t):
        return np.pi * C * amplitude * np.sin(2 * np.pi * X) * np.cos(C * np.pi * t + shift)

    def force(X, t):
        wave = amplitude * np.sin(C * np.pi * t + shift)
        u, F = wave * np.sin(2 * np.pi * X), 1.0 + 2 * np.pi * wave * np.cos(2 * np.pi * X)
        stiff = 4.0 * (lam * (np.log(F[0] * F[1]) - 1.0) - mu) / (RHO * F**2)
        return np.pi**2 * u * (4.0 * mu / RHO - C**2 - stiff)

    def points(cell, per_cell, corner):
        return box(corner, (1.0, 1.0), spacing=cell / per_cell)

    def supports(corner):
        return [
            Support(lambda X: on(X, 0, corner[0]) | on(X, 0, corner[0] + 1.0), velocity=(0.0, None)),
            Support(lambda X: on(X, 1, corner[1]) | on(X, 1, corner[1] + 1.0), velocity=(None, 0.0)),
        ]

    return Problem(material, 0.02, position, velocity, force, points, supports)


def vortex(sign=-1.0, until=0.02):
    """The generalised vortex (Kamojjala et al., Eng. Comput. 31, 2015): a ring that turns between fixed boundaries.

    The rotation is alpha = g(t) h(R), h = 1 - 32 (R - 1)^2 + 256 (R - 1)^4, g = pi sin(pi t), so J = 1 and nothing
    needs to be held. `sign` is that of the last term of b_T; a code in public prints +, which does not balance.
    At t = 0.02 s the middle has turned by 0.2 rad and the largest shear is 1.2; at t = 0.5 s they are pi and 19.
    """
    material = NeoHookean(E, 0.3, RHO)
    m = material.lame[1] / RHO

    def polar(X):
        R, s = np.hypot(*X), np.hypot(*X) - 1.0
        h = 1.0 - 32.0 * s**2 + 256.0 * s**4
        return R, np.arctan2(X[1], X[0]), h, -64.0 * s + 1024.0 * s**3, -64.0 + 3072.0 * s**2

    def position(X, t):
        R, angle, h, *_ = polar(X)
        turned = angle + np.pi * np.sin(np.pi * t) * h
        return R * np.stack([np.cos(turned), np.sin(turned)])

    def velocity(X, t):
        R, angle, h, *_ = polar(X)
        turned = angle + np.pi * np.sin(np.pi * t) * h
        return np.pi**2 * np.cos(np.pi * t) * h * R * np.stack([-np.sin(turned), np.cos(turned)])

    def force(X, t):
        R, angle, h, h1, h2 = polar(X)
        g, g1, g2 = np.pi * np.sin(np.pi * t), np.pi**2 * np.cos(np.pi * t), -(np.pi**3) * np.sin(np.pi * t)
        shear = m * (3.0 * g * h1 + R * g * h2) - R * g2 * h
        pull, turning = m * R * (g * h1) ** 2, R * (g1 * h) ** 2
        s, c = np.sin(g * h), np.cos(g * h)
        radial, tangential = shear * s + (pull - turning) * c, -shear * c + (pull + sign * turning) * s
        outward, around = np.stack([np.cos(angle), np.sin(angle)]), np.stack([-np.sin(angle), np.cos(angle)])
        return radial * outward + tangential * around

    def points(cell, per_cell, corner):
        return ring(0.75, 1.25, cell / per_cell)

    return Problem(material, until, position, velocity, force, points, lambda corner: [])


def ring(inner, outer, spacing):
    """Rings of points with Gauss's rule in R^2/2, Radau's at the boundaries; both boundaries are the outline.

    The second order of midpoints would be the largest error of all: nothing but inertia resists a rotation of the
    ring, and the torque of the large body forces must vanish.
    """
    n = round(0.5 * (outer - inner) / spacing)
    edges = np.linspace(inner, outer, n + 1) ** 2 / 2.0
    half = np.diff(edges) / 2.0
    gauss = (edges[1:] + edges[:-1])[1:-1, None] / 2.0 + half[1:-1, None] * np.array([-1.0, 1.0]) / np.sqrt(3.0)
    ends = 2.0 * half[[0, -1]] * np.array([2 / 3, -2 / 3])
    q = np.concatenate([edges[:1], edges[:1] + ends[0], gauss.ravel(), edges[-1:] + ends[1], edges[-1:]])
    share = np.concatenate(
        [half[0] * np.array([0.5, 1.5]), np.repeat(half[1:-1], 2), half[-1] * np.array([1.5, 0.5])]
    )
    R = np.sqrt(2.0 * q)
    count = np.rint(2.0 * np.pi * R / spacing).astype(int)
    first = np.cumsum(count) - count
    place = np.arange(count.sum()) - np.repeat(first, count) + np.repeat(np.arange(R.size) % 2 / 2, count)
    angle = 2.0 * np.pi * place / np.repeat(count, count)
    x = np.repeat(R, count) * np.stack([np.cos(angle), np.sin(angle)])
    volume = np.repeat(2.0 * np.pi * share / count, count)
    return Points(x, volume, (np.arange(first[-1], count.sum()), np.arange(count[0])[::-1]))


def neo_hookean_stress(material, F):
    """The stress mu (F - F^-T) + lambda ln J F^-T in the precision of F (2, 2, n)."""
    lam, mu = material.lame
    J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    inverse_transposed = np.array([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]]) / J
    return mu * F + (lam * np.log(J) - mu) * inverse_transposed


def imbalance(problem, X, t):
    """The residual of rho a = Div P + rho b over its largest term, by differences of eighth order in long double."""
    X, t = X.astype(np.longdouble), np.longdouble(t)
    weights, e = np.array([3, -32, 168, -672, 0, 672, -168, 32, -3], np.longdouble) / 840, np.longdouble(1e-3)

    def slope(f, step):
        return sum(w * f(k * step) for k, w in zip(range(-4, 5), weights, strict=True) if w) / step

    def gradient(f, Y):
        axes = np.eye(2, dtype=np.longdouble)[:, :, None]
        return np.stack([slope(lambda s, a=a: f(Y + s * a), e) for a in axes], axis=-2)

    def stress(Y):
        F = gradient(lambda Z: problem.position(Z, t), Y)
        P = neo_hookean_stress(problem.material, F)
        np.testing.assert_allclose(problem.material.stress(F.astype(float)), P.astype(float), atol=1e-12 * E)
        return P

    acceleration = slope(lambda s: problem.velocity(X, t + s), e)
    assert np.abs(slope(lambda s: problem.position(X, t + s), e) - problem.velocity(X, t)).max() < 1e-9
    divergence = np.einsum("ijjp->ip", gradient(stress, X).swapaxes(1, 2)) / RHO
    force = problem.force(X, t)
    return float(np.abs(acceleration - divergence - force).max() / np.abs(force).max())
