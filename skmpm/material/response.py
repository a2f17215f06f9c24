"""Energy and its first derivatives in one compiled pass, for the materials of the library that most scenes have.

The functions of `dilatation` and of `Anchored` are what is computed; they serve any material.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from skmpm.arrays import Array
from skmpm.compiled import compiled, compiled_in_order
from skmpm.material.anchored import Anchored
from skmpm.material.elastic import LinearElastic, NeoHookean
from skmpm.parallel import over_points


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
    arguments = (lam, mu, F.reshape(4, n), flat, mean, out.energy, by_F, out.by_theta)
    over_points(lambda first, last: loop(first, last, *arguments), n)
    return out


@compiled_in_order
def _linear_elastic(
    first: int,
    last: int,
    lam: float,
    mu: float,
    F: Array,
    stress: Array,
    theta: Array,
    W: Array,
    by_F: Array,
    by_theta: Array,
) -> None:
    """Small strain, `stress` (4, n) that of the anchor; F-bar has the trace theta, the point resists its own."""
    for p in range(first, last):
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
    first: int,
    last: int,
    lam: float,
    mu: float,
    F: Array,
    anchor: Array,
    theta: Array,
    W: Array,
    by_F: Array,
    by_theta: Array,
) -> None:
    """At F-bar = s F of undeformed volumes 1 / det G, G = `anchor` (4, n), ln J-bar is ln theta.

    So W = (mu / 2 shear(F-bar G) + mu (J - 1 - ln J) + lambda / 2 (ln theta)^2) / det G, J that of the point.
    """
    for p in range(first, last):
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


def curvature(law: Anchored, F: Array, theta: Array, tension: Array) -> tuple[Array, Array, Array] | None:
    """W_FF (4, 4, n), W_Ftheta (4, n) and W_thetatheta (n,) [Pa] of NeoHookean, None for other laws.

    W_FF is that of W + `tension` J, (n,) [Pa].
    """
    kind: Any = type(law.material)
    if kind is not NeoHookean:
        return None
    n, (lam, mu) = theta.size, law.material.lame
    by_F, mixed, by_theta = np.empty((4, 4, n)), np.empty((4, n)), np.empty(n)
    anchor = np.zeros((4, 0)) if law.F_anchor is None else law.F_anchor.reshape(4, n)
    arguments = (lam, mu, F.reshape(4, n), anchor, theta, tension, by_F, mixed, by_theta)
    over_points(lambda first, last: _neo_hookean_curvature(first, last, *arguments), n)
    return by_F, mixed, by_theta


@compiled
def _neo_hookean_curvature(
    first: int,
    last: int,
    lam: float,
    mu: float,
    F: Array,
    anchor: Array,
    theta: Array,
    tension: Array,
    by_F: Array,
    mixed: Array,
    by_theta: Array,
) -> None:
    """Second derivatives of W = (mu (theta Q / 2 J - theta + J - 1 - ln J) + lambda / 2 (ln theta)^2) / det G.

    Q = |F G|^2 has the derivatives 2 F B and 2 B, B = G G^T.
    """
    for p in range(first, last):
        a, b, c, d = F[0, p], F[1, p], F[2, p], F[3, p]
        xx, xy, yy, rest = 1.0, 0.0, 1.0, 1.0  # of B
        if anchor.size:
            e, f, g, h = anchor[0, p], anchor[1, p], anchor[2, p], anchor[3, p]
            xx, xy, yy, rest = e * e + f * f, e * g + f * h, g * g + h * h, 1.0 / (e * h - f * g)
        inverse = rest / (a * d - b * c)  # 1 / J
        slope = (a * xx + b * xy, a * xy + b * yy, c * xx + d * xy, c * xy + d * yy)  # Q_F / 2
        turn = (d * inverse / rest, -c * inverse / rest, -b * inverse / rest, a * inverse / rest)  # J_F / J
        size = slope[0] * a + slope[1] * b + slope[2] * c + slope[3] * d
        factor = mu * rest * theta[p] * inverse
        square = factor * size + mu * rest
        for i in range(4):
            mixed[i, p] = mu * rest * inverse * (slope[i] - 0.5 * size * turn[i])
            for k in range(4):
                by_F[i, k, p] = square * turn[i] * turn[k] - factor * (slope[i] * turn[k] + turn[i] * slope[k])
        for i in (0, 2):
            by_F[i, i, p] += factor * xx
            by_F[i + 1, i + 1, p] += factor * yy
            by_F[i, i + 1, p] += factor * xy
            by_F[i + 1, i, p] += factor * xy
        second = tension[p] + mu * (1.0 - inverse) - 0.5 * factor * size * inverse / rest
        by_F[0, 3, p] += second
        by_F[3, 0, p] += second
        by_F[1, 2, p] -= second
        by_F[2, 1, p] -= second
        by_theta[p] = rest * lam * (1.0 - np.log(theta[p])) / theta[p] ** 2


_LOOPS = {LinearElastic: _linear_elastic, NeoHookean: _neo_hookean}
