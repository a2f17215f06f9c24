"""Powers of the stretches in the plane, smooth where both are equal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

REFACTORISE_AT_ONCE = 0.1  # z up to which the series is summed; its terms fall by z / 2
TERMS = 15  # (NEAR / 2)^15 = 3e-20


def half_angles(order: float, z: Array) -> tuple[Array, Array, Array]:
    """T(1 + z) - 1, T' and T'' of T(y) = cosh(order arccosh y), the Chebyshev function of any order; z >= 0.

    (1 - y^2) T'' - y T' + order^2 T = 0 gives the series at y = 1 and T'' beyond.
    """
    near = z < REFACTORISE_AT_ONCE
    small, y = np.where(near, z, 0.0), np.where(near, 1.0 + REFACTORISE_AT_ONCE, 1.0 + z)
    series = [np.zeros_like(small) for _ in range(3)]
    for k, a in reversed(list(enumerate(_coefficients(order), start=1))):
        series[0] = (series[0] + a) * small
        series[1] = series[1] * small + k * a
        series[2] = series[2] * small + k * (k - 1) * a if k > 1 else series[2]
    angle = np.arccosh(y)
    t0 = np.cosh(order * angle)
    t1 = order * np.sinh(order * angle) / np.sinh(angle)
    t2 = (order**2 * t0 - y * t1) / (y**2 - 1.0)
    return tuple(np.where(near, s, far) for s, far in zip(series, (t0 - 1.0, t1, t2), strict=True))  # type: ignore[return-value]


def _coefficients(order: float) -> list[float]:
    """Of z, z^2, ... in T(1 + z) - 1."""
    found, a = [], 1.0
    for k in range(TERMS):
        a *= (order**2 - k**2) / ((k + 1) * (2 * k + 1))
        found.append(a)
    return found
