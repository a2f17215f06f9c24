"""Functions of the ratio of both stretches in the plane, smooth where they are equal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Largest z, and z order^2, up to which the series is summed: its terms fall by z / 2, after they have grown with the
# order like (2 z order^2)^k / (2 k)!, which is 1e-13 of the largest one after so many.
NEAR, NEAR_OF_ORDER, TERMS = 0.1, 10.0, 15


def half_angles(order: float, z: Array) -> tuple[Array, Array, Array]:
    """T(1 + z) - 1, T' and T'' of T(y) = cosh(order arccosh y), the Chebyshev function of any order; z >= 0.

    (1 - y^2) T'' - y T' + order^2 T = 0 gives the series at y = 1 and T'' beyond.
    """
    limit = min(NEAR, NEAR_OF_ORDER / max(order**2, 1.0))
    near = z < limit
    y = np.where(near, 1.0 + limit, 1.0 + z)
    angle = np.arccosh(y)
    t0 = np.cosh(order * angle)
    t1 = order * np.sinh(order * angle) / np.sinh(angle)
    t2 = (order**2 * t0 - y * t1) / (y**2 - 1.0)
    return _with_series(near, z, _coefficients(order, order**2), (t0 - 1.0, t1, t2))


def squared_angle(z: Array) -> tuple[Array, Array, Array]:
    """D(1 + z), D' and D'' of D(y) = (arccosh y)^2, the square of ln(l1 / l2) of the stretches; z >= 0.

    (1 - y^2) D'' - y D' + 2 = 0: what `half_angles` tends to at small order, 2 (T - 1) / order^2.
    """
    near = z < NEAR
    y = np.where(near, 1.0 + NEAR, 1.0 + z)
    angle = np.arccosh(y)
    slope = 2.0 * angle / np.sinh(angle)
    return _with_series(near, z, _coefficients(0.0, 2.0), (angle**2, slope, (2.0 - y * slope) / (y**2 - 1.0)))


def _coefficients(order: float, first: float) -> list[float]:
    """Of z, z^2, ... in the solution of the equation, from that of z."""
    found = [first]
    for k in range(1, TERMS):
        found.append(found[-1] * (order**2 - k**2) / ((k + 1) * (2 * k + 1)))
    return found


def _with_series(
    near: NDArray[np.bool_], z: Array, coefficients: list[float], far: tuple[Array, Array, Array]
) -> tuple[Array, Array, Array]:
    """The series and its two derivatives where z is small, elsewhere the values `far`."""
    small = np.where(near, z, 0.0)
    series = [np.zeros_like(small) for _ in range(3)]
    for k, a in reversed(list(enumerate(coefficients, start=1))):
        series[0] = (series[0] + a) * small
        series[1] = series[1] * small + k * a
        series[2] = series[2] * small + k * (k - 1) * a if k > 1 else series[2]
    return tuple(np.where(near, s, value) for s, value in zip(series, far, strict=True))  # type: ignore[return-value]
