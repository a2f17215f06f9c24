"""Energy and its first derivatives in one compiled pass, for the materials of the library that most scenes have.

The functions of `dilatation` and of `Anchored` are what is computed; they serve any material.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skmpm.compiled import compiled_in_order
from skmpm.material.anchored import Anchored
from skmpm.material.linear import LinearElastic
from skmpm.material.neohookean import NeoHookean

Array = NDArray[np.float64]


class Response(NamedTuple):
    """W(F, theta) and its derivatives, per anchor volume; without mean dilatation W(F) and zero for the last."""

    energy: Array  # (n,) [Pa], inf where a point or its cell is turned inside out
    by_F: Array  # (2, 2, n) [Pa]
    by_theta: Array  # (n,) [Pa]


def response(law: Anchored, F: Array, theta: Array | None) -> Response | None:
    """The response at F (2, 2, n) and mean dilatations `theta` (n,), None for pointwise ones; None for other laws."""
    n = F.shape[-1]
    kind: Any = type(law.material)
    if kind not in _LOOPS:
        return None
    out = Response(np.empty(n), np.empty((2, 2, n)), np.empty(n))
    lam, mu = law.material.lame
    anchor = law.stress_anchor if kind is LinearElastic else law.F_anchor
    flat = np.zeros((4, 0)) if anchor is None else anchor.reshape(4, n)
    mean, by_F, loop = np.zeros(0) if theta is None else theta, out.by_F.reshape(4, n), _LOOPS[kind]
    loop(lam, mu, F.reshape(4, n), flat, mean, out.energy, by_F, out.by_theta)
    return out


@compiled_in_order
def _linear_elastic(
    lam: float, mu: float, F: Array, stress: Array, theta: Array, W: Array, by_F: Array, by_theta: Array
) -> None:
    """Small strain, `stress` (4, n) that of the anchor; F-bar has the trace theta, the point resists its own."""
    for p in range(W.size):
        x, y, shear = F[0, p] - 1.0, F[3, p] - 1.0, 0.5 * (F[1, p] + F[2, p])
        own = x + y
        mean = theta[p] if theta.size else own
        difference = 0.5 * (x - y)
        W[p] = mu * (2.0 * difference**2 + 2.0 * shear**2 + 0.5 * own**2) + 0.5 * lam * mean**2
        by_F[0, p], by_F[3, p] = mu * (2.0 * difference + own), mu * (own - 2.0 * difference)
        by_F[1, p] = by_F[2, p] = 2.0 * mu * shear
        by_theta[p] = lam * mean
        if not theta.size:
            by_F[0, p] += lam * mean
            by_F[3, p] += lam * mean
            by_theta[p] = 0.0
        if stress.size:
            W[p] += stress[0, p] * x + stress[1, p] * F[1, p] + stress[2, p] * F[2, p] + stress[3, p] * y
            for i in range(4):
                by_F[i, p] += stress[i, p]


@compiled_in_order
def _neo_hookean(
    lam: float, mu: float, F: Array, anchor: Array, theta: Array, W: Array, by_F: Array, by_theta: Array
) -> None:
    """At F-bar = s F of undeformed volumes 1 / det G, G = `anchor` (4, n), ln J-bar is ln theta.

    So W = (mu / 2 shear(F-bar G) + mu (J - 1 - ln J) + lambda / 2 (ln theta)^2) / det G, J that of the point.
    """
    for p in range(W.size):
        a, b, c, d = F[0, p], F[1, p], F[2, p], F[3, p]
        t, u, v, w = a, b, c, d
        rest, J = 1.0, a * d - b * c
        if anchor.size:
            e, f, g, h = anchor[0, p], anchor[1, p], anchor[2, p], anchor[3, p]
            t, u, v, w = a * e + b * g, a * f + b * h, c * e + d * g, c * f + d * h
            rest = 1.0 / (e * h - f * g)
        mean = theta[p] if theta.size else J / rest
        if not (J > 0.0 and mean > 0.0):
            W[p], by_theta[p] = np.inf, np.nan
            for i in range(4):
                by_F[i, p] = np.nan
            continue
        s = np.sqrt(mean * rest / J) if theta.size else 1.0
        change = J / rest - 1.0
        log_mean = np.log1p(mean - 1.0)
        log_J = np.log1p(change) if theta.size else log_mean
        shear = s**2 * ((t - w) ** 2 + (u + v) ** 2)
        W[p] = rest * (0.5 * mu * shear + mu * (change - log_J) + 0.5 * lam * log_mean**2)
        slope = (lam * log_mean - mu) / mean
        t, u, v, w = s * t, s * u, s * v, s * w
        xx, xy, yx, yy = mu * t + slope * w, mu * u - slope * v, mu * v - slope * u, mu * w + slope * t
        if anchor.size:
            xx, xy = rest * (xx * e + xy * f), rest * (xx * g + xy * h)
            yx, yy = rest * (yx * e + yy * f), rest * (yx * g + yy * h)
        by_F[0, p], by_F[1, p], by_F[2, p], by_F[3, p], by_theta[p] = xx, xy, yx, yy, 0.0
        if theta.size:
            q = s * (xx * a + xy * b + yx * c + yy * d)
            own = (mu * (J - rest) - 0.5 * q) / J
            by_F[0, p], by_F[1, p] = s * xx + own * d, s * xy - own * c
            by_F[2, p], by_F[3, p] = s * yx - own * b, s * yy + own * a
            by_theta[p] = (0.5 * q - mu * rest * (mean - 1.0)) / mean


_LOOPS = {LinearElastic: _linear_elastic, NeoHookean: _neo_hookean}
