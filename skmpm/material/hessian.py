"""Hessians of energies mu/2 |F|^2 + g(J), exact and projected on positive semi-definite ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def cofactor(F: Array) -> Array:
    """The derivative of det F by F, (2, 2, n)."""
    return np.stack([np.stack([F[1, 1], -F[1, 0]]), np.stack([-F[0, 1], F[0, 0]])])


def hessian(F: Array, mu: float, slope: Array, curvature: Array) -> Array:
    """Hessian of mu/2 |F|^2 + g(J) by F, (2, 2, 2, 2, n); slope g', curvature g''.

    H = mu I + g'' c c' + g' E with c = dJ/dF and E = d2J/dF2.
    """
    c = cofactor(F).reshape(4, -1)
    H = curvature * c[:, None] * c[None, :]
    H += mu * np.eye(4)[:, :, None]
    H += slope * np.array([[0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0]])[:, :, None]
    return H.reshape(2, 2, 2, 2, -1)


def projected_hessian(F: Array, mu: float, slope: Array, curvature: Array) -> Array:
    """Positive semi-definite Hessian of mu/2 |F|^2 + g(J) by F, (2, 2, 2, 2, n); slope g', curvature g''.

    With H, c and E as in `hessian`: the eigenvalues of E are +1 and -1, twice each. In the
    basis of E's eigenvectors c has a part of length p in the first plane and m in the second; H then has the
    eigenvalues mu + g' and mu - g' (across c in either plane) and those of a 2 x 2 block (along c). Each negative
    one is subtracted with its eigenvector (Smith, de Goes & Kim, ACM ToG 2019, for this idea).
    """
    n = F.shape[-1]
    c = cofactor(F).reshape(4, n)
    plane = np.array([[1, 0, 0, 1], [0, 1, -1, 0], [1, 0, 0, -1], [0, 1, 1, 0]]) / np.sqrt(2.0)
    a = plane @ c  # components of c: two in the +1 plane, two in the -1 plane
    p, m = np.hypot(a[0], a[1]), np.hypot(a[2], a[3])
    plus = plane[:2].T @ (a[:2] / p)
    plus_across = plane[:2].T @ (np.stack([-a[1], a[0]]) / p)
    flat = m < 1e-12 * p
    unit = np.where(flat, np.array([[1.0], [0.0]]), a[2:] / np.where(flat, 1.0, m))
    minus = plane[2:].T @ unit
    minus_across = plane[2:].T @ np.stack([-unit[1], unit[0]])

    top, low, off = mu + slope + curvature * p**2, mu - slope + curvature * m**2, curvature * p * m
    half = 0.5 * (top - low)
    root = np.hypot(half, off)
    # The eigenvector of the smaller eigenvalue, from the better conditioned row.
    along, across = np.where(half >= 0.0, -off, root - half), np.where(half >= 0.0, half + root, -off)
    length = np.hypot(along, across)
    round_ = length < 1e-300
    along, across = np.where(round_, 0.0, along), np.where(round_, 1.0, across)
    length = np.where(round_, 1.0, length)
    small = (along * plus + across * minus) / length
    large = (across * plus - along * minus) / length

    H = hessian(F, mu, slope, curvature).reshape(4, 4, n)
    mean = 0.5 * (top + low)
    for value, vector in (
        (mu + slope, plus_across),
        (mu - slope, minus_across),
        (mean - root, small),
        (mean + root, large),
    ):
        if np.any(value < 0.0):
            H -= np.minimum(value, 0.0) * vector[:, None] * vector[None, :]
    return H.reshape(2, 2, 2, 2, n)
