"""What is known exactly or from a converged solution: functions of x (2, n) to u (2, n) and stress (2, 2, n)."""

from functools import cache

import numpy as np
from fem import MATERIAL, MU, solve_fem
from numpy.polynomial.polynomial import polyval
from skfem import ElementTriP2, MeshTri

KAPPA = 3.0 - 4.0 * MATERIAL.nu  # plane strain
LENGTH, DEPTH, SHEAR = 4.0, 1.0, 1e2  # of the cantilever [m], [m], [N/m]
TENSION = 1e3  # on the plate far from its hole [Pa]
PRESSURE, HALF_ARC = 1e3, np.pi / 6  # largest on the disc [Pa], half of each loaded arc
ANGULAR = 2 * np.arange(301)  # orders of the series of the disc
COOK = (4.8, 4.4, 1.6)  # width, left and right height [m]
COOK_SHEAR = 1e3  # on the right end [Pa]


def potentials(z, phi, dphi, ddphi, psi, dpsi):
    """Displacement and stress from two analytic functions and their derivatives.

    2 mu (u + i v) = kappa phi - z conj(phi') - conj(psi); s_xx + s_yy = 4 Re phi'; s_yy - s_xx + 2 i s_xy =
    2 (conj(z) phi'' + psi') (Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity, 1953).
    """
    w = (KAPPA * phi - z * np.conj(dphi) - np.conj(psi)) / (2.0 * MU)
    mean, d = 2.0 * dphi.real, np.conj(z) * ddphi + dpsi
    return np.array([w.real, w.imag]), np.array([[mean - d.real, d.imag], [d.imag, mean + d.real]])


def hole(x):
    """A plate with a hole of radius 1 at the origin under tension in x (Kirsch, VDI-Z 42, 1898)."""
    z, quarter = x[0] + 1j * x[1], TENSION / 4
    phi, dphi, ddphi = quarter * (z + 2 / z), quarter * (1 - 2 / z**2), 4 * quarter / z**3
    psi, dpsi = -2 * quarter * (z + 1 / z - z**-3), -2 * quarter * (1 - z**-2 + 3 * z**-4)
    return potentials(z, phi, dphi, ddphi, psi, dpsi)


def pressure(x):
    """Pressure (...) on the boundary of the disc: cos^2 over an arc around the top and one around the bottom."""
    angle = np.arctan2(x[0], np.abs(x[1]))
    inside = np.abs(angle) < HALF_ARC
    return np.where(inside, PRESSURE * np.cos(np.pi * angle / (2 * HALF_ARC)) ** 2, 0.0)


@cache
def _harmonics():
    """Coefficients of - pressure = sum A_m cos(m angle), m even."""
    k, m = np.pi / HALF_ARC, np.where(ANGULAR > 0, ANGULAR, 1e-12)
    resonant = np.isclose(m, k)
    safe = np.where(resonant, k + 1.0, m)
    integral = np.where(resonant, HALF_ARC / 2, np.sin(safe * HALF_ARC) / safe * k**2 / (k**2 - safe**2))
    A = -PRESSURE * 2.0 / np.pi * integral
    A[0] /= 2.0
    return A


def disc(x):
    """A disc of radius 1 under `pressure`: phi' = 1/2 sum A_m z^m, psi' = -1/2 sum m A_m z^(m - 2).

    They satisfy the boundary condition N - i T = 2 Re phi' - e^(2 i theta) (conj(z) phi'' + psi') term by term
    (Muskhelishvili 1953, paragraph 55; the load of Hondros, Aust. J. Appl. Sci. 10, 1959, made smooth).
    """
    A, m, z = _harmonics(), ANGULAR, (x[0] + 1j * x[1]) / 1j  # real along the load
    q = z**2
    slope = polyval(q, (m * A / 2)[1:])
    psi = -z * polyval(q, (m * A / 2)[1:] / (m[1:] - 1))
    u, s = potentials(z, z * polyval(q, A / 2 / (m + 1)), polyval(q, A / 2), z * slope, psi, -slope)
    turned = s[::-1, ::-1] * np.array([[1, -1], [-1, 1]])[:, :, None]
    return np.array([-u[1], u[0]]), turned


def cantilever(x):
    """A beam held at x = 0, sheared by parabolic tractions at x = LENGTH (Timoshenko & Goodier, paragraph 21)."""
    E, nu = MATERIAL.E / (1 - MATERIAL.nu**2), MATERIAL.nu / (1 - MATERIAL.nu)
    (X, y), left, inertia = x, LENGTH - x[0], DEPTH**3 / 12
    factor = SHEAR / (6 * E * inertia)
    ux = -factor * y * ((6 * LENGTH - 3 * X) * X + (2 + nu) * (y**2 - DEPTH**2 / 4))
    uy = factor * (3 * nu * y**2 * left + (4 + 5 * nu) * DEPTH**2 * X / 4 + (3 * LENGTH - X) * X**2)
    sxx, sxy = -SHEAR * left * y / inertia, SHEAR / (2 * inertia) * (DEPTH**2 / 4 - y**2)
    return np.array([ux, uy]), np.array([[sxx, sxy], [sxy, np.zeros_like(X)]])


def cook_map(p):
    """Cook's membrane (2, n) of the unit square."""
    width, left, right = COOK
    return np.array([width * p[0], left * p[0] + p[1] * (left + (right - left) * p[0])])


def cook_traction(x, normal):
    """Shear on the right end."""
    return np.array([np.zeros_like(x[0]), COOK_SHEAR * (x[0] > COOK[0] - 1e-9)])


class Cook:
    """Cook's membrane by P2 triangles of 2 x nx x ny, graded towards the clamp and the long sides.

    The mesh is a mapped tensor grid, so a point's triangle is found by inverting the map in closed form.
    """

    def __init__(self, nx=100, ny=76):
        self.xi = np.linspace(0, 1, nx + 1) ** 2
        t = np.linspace(-1, 1, ny + 1)
        self.eta = 0.5 + 0.5 * np.sign(t) * (1 - (1 - np.abs(t)) ** 2)
        k = np.arange((nx + 1) * (ny + 1)).reshape(nx + 1, ny + 1)
        a, b, c, d = (i.ravel() for i in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]))
        nodes = cook_map(np.stack([v.ravel() for v in np.meshgrid(self.xi, self.eta, indexing="ij")]))
        cells = np.concatenate([[a, b, c], [a, c, d]], axis=1)
        mesh = MeshTri(np.ascontiguousarray(nodes), np.ascontiguousarray(cells), sort_t=False)
        self.solution = solve_fem(mesh, cook_traction, [(0, (0.0, 0.0))], ElementTriP2())

    def __call__(self, x):
        """Displacement and stress at x (2, n)."""
        width, left, right = COOK
        xi = x[0] / width
        eta = (x[1] - left * xi) / (left + (right - left) * xi)
        last = self.xi.size - 2, self.eta.size - 2
        i = np.clip(np.searchsorted(self.xi, xi, side="right") - 1, 0, last[0])
        j = np.clip(np.searchsorted(self.eta, eta, side="right") - 1, 0, last[1])
        cell, invert = i * (last[1] + 1) + j, self.solution.basis.mapping.invF
        first = invert(x[:, :, None], tind=cell)[:, :, 0]
        beyond = np.minimum(first.min(axis=0), 1 - first.sum(axis=0)) < -1e-12
        cell = np.where(beyond, cell + (last[0] + 1) * (last[1] + 1), cell)
        return self.solution.at(invert(x[:, :, None], tind=cell)[:, :, 0], cell)


@cache
def _cook():
    return Cook()


def cook(x):
    """The converged solution of Cook's membrane."""
    return _cook()(x)
