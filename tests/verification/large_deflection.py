"""Slender and thick cantilevers, a column under its own weight, a bar pulled to three times its length.

Each with its reference: the elastica, quadratic finite elements, and two closed forms.
"""

from functools import cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from skfem import Basis, BilinearForm, ElementQuad2, ElementVector, FacetBasis, LinearForm, MeshQuad, condense, solve
from skfem.helpers import ddot, det, eye, grad, inv, mul, trace, transpose

from skmpm import Body, Load, NeoHookean, Scene, Scheme, Support, box, linear, simulate

NEAR = 1e-9


@cache
def elastica_curve(k, places=61):
    """Angle, curvature, x and y (4, places) over L along a clamped elastica under a dead load k = P L^2 / EI.

    theta'' = -k cos(theta), theta(0) = 0, theta'(1) = 0, the curvature at the clamp by bisection.
    """

    def along(curvature):
        def slope(s, y):
            return [y[1], -k * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]

        at = np.linspace(0.0, 1.0, places)
        return solve_ivp(slope, (0.0, 1.0), [0.0, curvature, 0.0, 0.0], t_eval=at, rtol=1e-10, atol=1e-12).y

    return along(brentq(lambda c: along(c)[1, -1], 0.0, 1.9999 * np.sqrt(k), xtol=1e-13))


def elastica(k):
    """(deflection, shortening) over L and tip angle [rad]."""
    angle, _, x, y = elastica_curve(k)[:, -1]
    return np.array([y, 1.0 - x, angle])


def middle(x, y):
    """Deflection, shortening and angle of the end section from its points x (2, n), whose initial heights are y."""
    order = np.argsort(y)
    x, y = x[:, order], y[order]
    centre = [np.interp(0.0, y, component) for component in x]
    across = x[:, -1] - x[:, 0]
    return np.array([centre[1], centre[0], np.arctan2(-across[0], across[1])])


@cache
def cantilever(length, depth, across, per_cell, material, force, steps, **options):
    """(deflection, shortening) over L and tip angle after every step of a load (0, force t), (steps, 3).

    `across` cells over the depth, clamped at x = 0, loaded evenly over the end. And the centre lines, (steps, 2, m).
    """
    cell = depth / across
    points = box((0.0, -depth / 2), (length, depth), spacing=cell / per_cell)
    tip = points.x[0] > length - NEAR
    scene = Scene(
        [Body(points, material)],
        cell=cell,
        supports=[Support(lambda X: X[0] < NEAR)],
        loads=[Load(lambda X: X[0] > length - NEAR, lambda t: (0.0, force * t))],
    )
    found, lines, columns = [], [], np.unique(points.x[0]).size
    for state in simulate(scene, dt=1.0 / steps, until=1.0, scheme=Scheme(inertia=False, **options)):
        y, x, angle = middle(state.x[:, tip], points.x[1, tip])
        found.append([y / length, 1.0 - x / length, angle])
        lines.append(state.x.reshape(2, columns, -1).mean(axis=2))
    return np.array(found), np.array(lines)


SLENDER = 40  # length over depth
LOADS = (1, 2, 5, 10)  # k


def slender(across, k=10, steps=10, **options):
    """The slender cantilever under a load that grows to k: what `cantilever` gives; nu = 0, 2 x 2 points per cell."""
    material = NeoHookean(12e6, 0.0, 1000.0)
    force = k * material.E / (12.0 * SLENDER**3)
    return cantilever(1.0, 1.0 / SLENDER, across, 2, material, force, steps, **options)


def off_elastica(across):
    """Relative errors of the slender cantilever at k = 1, 2, 5, 10: (4, 3)."""
    return slender(across)[0][np.array(LOADS) - 1] / [elastica(k) for k in LOADS] - 1.0


AMPLE = NeoHookean(12e6, 0.2, 1000.0)
AMPLE_K = 1e5 * 10.0**2 * 12.0 * (1.0 - AMPLE.nu**2) / AMPLE.E  # 9.6


def ample(across, **options):
    """The AMPLE beam (Coombs & Augarde, Adv. Eng. Softw. 139, 2020) in 50 steps, (50, 3): positive downwards."""
    found, _ = cantilever(10.0, 1.0, across, 6, AMPLE, -1e5, 50, **options)
    return found * [-1.0, 1.0, -1.0]


@cache
def ample_fem(across=4):
    """The same beam by quadratic finite elements, in ten steps of the load: (deflection, shortening, angle)."""
    lam, mu = AMPLE.lame
    mesh = MeshQuad.init_tensor(np.linspace(0, 10, 10 * across + 1), np.linspace(-0.5, 0.5, across + 1))
    basis = Basis(mesh, ElementVector(ElementQuad2()), intorder=4)
    boundary = FacetBasis(mesh, basis.elem, facets=mesh.facets_satisfying(lambda x: x[0] > 10.0 - NEAR))

    def kinematics(w):
        F = grad(w["u"]) + eye(1.0 + 0.0 * w.x[0], 2)
        return F, transpose(inv(F)), np.log(det(F))

    @LinearForm
    def internal(v, w):
        F, inverse, log = kinematics(w)
        return ddot(mu * (F - inverse) + lam * log * inverse, grad(v))

    @BilinearForm
    def tangent(du, v, w):
        _, inverse, log = kinematics(w)
        turned = mul(mul(inverse, transpose(grad(du))), inverse)
        change = trace(mul(transpose(inverse), grad(du)))
        return ddot(mu * grad(du) + (mu - lam * log) * turned + lam * change * inverse, grad(v))

    load = LinearForm(lambda v, w: -1e5 * v[1]).assemble(boundary)
    held = basis.get_dofs(lambda x: x[0] < NEAR).flatten()
    u = basis.zeros()
    for share in np.arange(1, 11) / 10:
        for _ in range(30):
            known = basis.interpolate(u)
            residual = share * load - internal.assemble(basis, u=known)
            du = solve(*condense(tangent.assemble(basis, u=known), residual, D=held))
            u = u + du
            if np.abs(du).max() < 1e-10:
                break
    place = basis.doflocs
    end = (place[0] > 10.0 - NEAR).nonzero()[0]
    dofs = end[np.argsort(place[1, end], kind="stable")].reshape(-1, 2)
    dofs.sort(axis=1)  # x before y
    y = place[1, dofs[:, 0]]
    y, x, angle = middle(place[:, dofs[:, 0]] + u[dofs.T], y)
    return np.array([-y / 10.0, 1.0 - x / 10.0, -angle])


COLUMN = {"E": 1e4, "density": 80.0, "gravity": 10.0, "height": 50.0}  # its foot is pressed to an eighth


@cache
def column(cells, per_cell, *, solver=linear.banded, **options):
    """Errors of the vertical stress of a column under its own weight: at the points, and recovered from the nodes.

    Exact is -rho0 g (l0 - Y) for any law, as the width stays; the errors are sums V0 |error| / (rho0 g l0 sum V0).
    The recovered stress is the nodes' mean of the points', interpolated back. Also heights and stresses.
    """
    height, weight = COLUMN["height"], COLUMN["density"] * COLUMN["gravity"]
    cell = height / cells
    points = box((0.0, 0.0), (cell, height), spacing=cell / per_cell)
    supports = [
        Support(lambda X: X[1] < NEAR, velocity=(None, 0.0)),
        Support(lambda X: (X[0] < NEAR) | (X[0] > cell - NEAR), velocity=(0.0, None)),
    ]
    scene = Scene(
        [Body(points, NeoHookean(COLUMN["E"], 0.0, COLUMN["density"]))],
        cell=cell,
        supports=supports,
        gravity=lambda X, t: np.stack([0.0 * X[0], 0.0 * X[1] - COLUMN["gravity"] * t]),
    )
    scheme = Scheme(inertia=False, linear=solver, **options)
    *_, state = simulate(scene, dt=1 / 40, until=1.0, scheme=scheme)
    volume, Y, stress = points.volume, points.x[1], state.stress[1, 1]
    exact = -weight * (height - Y)
    N = state.derived.assembly.grid.interpolation
    recovered = N @ ((N.T @ (volume * stress)) / (N.T @ volume))
    size = weight * height * volume.sum()
    return [volume @ np.abs(s - exact) / size for s in (stress, recovered)], Y, stress


STRETCH = 3.0
RUBBER = NeoHookean(1e6, 0.3, 1000.0)


def uniaxial(stretch):
    """Nominal stress [Pa] of the bar at a stretch, its sides free: lateral stretch s from P_yy = 0."""
    lam, mu = RUBBER.lame
    s = brentq(lambda s: mu * (s - 1.0 / s) + lam * np.log(stretch * s) / s, 0.1, 2.0, xtol=1e-14)
    return mu * (stretch - 1.0 / stretch) + lam * np.log(stretch * s) / stretch


@cache
def stretched(per_cell, anchor, *, solver=linear.banded, **options):
    """A bar of 8 x 4 cells pulled to three times its length in 40 steps: (stretch, force, exact) and re-anchorings.

    Its ends slide across; its lower side lies on a line of symmetry.
    """
    cell, width = 1 / 8, 1 / 2
    points = box((0.0, 0.0), (1.0, width), spacing=cell / per_cell)
    supports = [
        Support(lambda X: X[0] < NEAR, velocity=(0.0, None)),
        Support(lambda X: X[0] > 1.0 - NEAR, velocity=(STRETCH - 1.0, None)),
        Support(lambda X: X[1] < NEAR, velocity=(None, 0.0)),
    ]
    scene = Scene([Body(points, RUBBER)], cell=cell, supports=supports)
    scheme = Scheme(inertia=False, anchor=anchor, linear=solver, **options)
    found, laid = [], []
    for state in simulate(scene, dt=1 / 40, until=1.0, scheme=scheme):
        stretch = 1.0 + (STRETCH - 1.0) * state.t
        found.append([stretch, -state.support_force[1, 0] / width, uniaxial(stretch)])
        laid.append(state.x_anchor)
    return np.array(found).T, sum(a is not b for a, b in zip(laid[1:], laid, strict=False))
