"""Least-squares fits to the curves of the study: where slopes change, and the laws of compaction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize, minimize_scalar

Array = np.ndarray

APART = 3  # samples between two breaks and from a break to an end


@dataclass(frozen=True)
class Broken:
    """A continuous line of three straight pieces."""

    breaks: Array  # (2,)
    slopes: Array  # (3,)
    level: float  # at x = 0, of the first piece

    def __call__(self, x: Array) -> Array:
        """Its values at x."""
        return _hinges(x, self.breaks) @ np.append(self.level, np.append(self.slopes[0], np.diff(self.slopes)))


def broken(x: Array, y: Array) -> Broken | None:
    """Fit a continuous line with two breaks to samples (n,); None if they are too few.

    All pairs of samples are tried as breaks, the best is improved by Nelder's and Mead's search.
    """
    finite = np.isfinite(x) & np.isfinite(y)
    x, y = x[finite], y[finite]
    if x.size < 4 * APART:
        return None
    lowest, highest = x[APART], x[-APART - 1]

    def misfit(breaks: Array) -> float:
        low, high = breaks
        return _fit(x, y, breaks)[1] if lowest <= low < high <= highest else np.inf

    best, width = _best_pair(x, y), x[1] - x[0]
    simplex = best + width * np.array([[0.0, 0.0], [0.5, 0.0], [0.0, -0.5]])
    options = {"initial_simplex": simplex, "xatol": 1e-6, "fatol": 0.0}
    found = minimize(misfit, best, method="Nelder-Mead", options=options).x
    level, slope, *turns = _fit(x, y, found)[0]
    return Broken(found, slope + np.append(0.0, np.cumsum(turns)), float(level))


def _hinges(x: Array, breaks: Array) -> Array:
    """Columns 1, x and max(x - break, 0), (n, 2 + breaks)."""
    return np.column_stack([np.ones_like(x), x, np.maximum(x[:, None] - breaks, 0.0)])


def _fit(x: Array, y: Array, breaks: Array) -> tuple[Array, float]:
    """Factors of the columns of `_hinges` and the sum of squared residuals."""
    columns = _hinges(x, breaks)
    factors = np.linalg.lstsq(columns, y, rcond=None)[0]
    return factors, float(((columns @ factors - y) ** 2).sum())


def _best_pair(x: Array, y: Array) -> Array:
    """Pair of samples that are the best breaks, (2,).

    What straight lines explain is taken off hinges and samples; then each pair of hinges is two normal equations.
    """
    places = x[APART:-APART]
    columns = _hinges(x, places)
    straight, _ = np.linalg.qr(columns[:, :2])
    H, r = (a - straight @ (straight.T @ a) for a in (columns[:, 2:], y))
    G, g = H.T @ H, H.T @ r
    i, j = np.triu_indices(places.size, k=APART)
    gained = g[i] ** 2 * G[j, j] - 2.0 * g[i] * g[j] * G[i, j] + g[j] ** 2 * G[i, i]
    best = np.argmax(gained / (G[i, i] * G[j, j] - G[i, j] ** 2))
    return np.array([places[i[best]], places[j[best]]])


@dataclass(frozen=True)
class Compaction:
    """P / E = -(b / 4) Phi Z ln[(Phi_max - Phi) / (Phi_max - Phi_0)] (Cardenas-Barrantes et al., 2020)."""

    b: float
    phi_max: float
    phi_0: float

    def __call__(self, phi: Array, Z: Array) -> Array:
        """P / E."""
        ratio = np.maximum(self.phi_max - phi, 1e-12) / (self.phi_max - self.phi_0)
        return -self.b / 4.0 * phi * Z * np.log(ratio)


def compaction_law(phi: Array, Z: Array, p: Array, least: float = 2e-3) -> Compaction | None:
    """Fit b, Phi_max and Phi_0 to p = P / E above `least`; None if there are too few samples.

    For a given Phi_max the law is linear in b and b ln(Phi_max - Phi_0): one unknown is left to search.
    """
    dense = np.isfinite(phi + Z + p)
    dense[dense] &= p[dense] > least
    phi, Z, p = phi[dense], Z[dense], p[dense]
    if phi.size < 6:
        return None

    def solve(log_distance: float) -> tuple[float, Array]:
        columns = phi * Z * np.stack([np.ones_like(phi), np.log(phi.max() + np.exp(log_distance) - phi)])
        found = np.linalg.lstsq(columns.T, p, rcond=None)[0]
        return float(((found @ columns - p) ** 2).sum()), found

    tried = np.linspace(np.log(1e-3), np.log(1.0), 60)
    near = tried[np.argmin([solve(d)[0] for d in tried])]
    bounds = (near - 0.2, near + 0.2)
    distance = minimize_scalar(lambda d: solve(d)[0], bounds=bounds, method="bounded", options={"xatol": 1e-8}).x
    level, slope = solve(distance)[1]
    phi_max = float(phi.max() + np.exp(distance))
    return Compaction(-4.0 * float(slope), phi_max, phi_max - float(np.exp(-level / slope)))


@dataclass(frozen=True)
class Power:
    """Z - Z_J = a (Phi - Phi_J)^beta."""

    phi_J: float
    Z_J: float
    a: float
    beta: float

    def __call__(self, phi: Array) -> Array:
        """Z, nan below Phi_J."""
        above = np.where(phi > self.phi_J, phi - self.phi_J, np.nan)
        return self.Z_J + self.a * above**self.beta


def power_law(
    phi: Array, Z: Array, Z_J: float, window: tuple[float, float] = (0.005, 0.10), phi_J: float | None = None
) -> Power | None:
    """Fit a and beta to log(Z - Z_J) for Phi - Phi_J in `window`; without Phi_J it is where Z passes Z_J for good."""
    phi_J = last_passage(phi, Z, Z_J) if phi_J is None else phi_J
    near = np.isfinite(phi) & np.isfinite(Z)
    near[near] &= (phi[near] - phi_J > window[0]) & (phi[near] - phi_J < window[1]) & (Z[near] > Z_J)
    if near.sum() < 4:
        return None
    beta, log_a = np.polyfit(np.log(phi[near] - phi_J), np.log(Z[near] - Z_J), 1)
    return Power(phi_J, Z_J, float(np.exp(log_a)), float(beta))


def last_passage(x: Array, y: Array, level: float) -> float:
    """Where y passes a level for the last time, upwards, between two samples; nan if it does not."""
    finite = np.isfinite(x) & np.isfinite(y)
    x, y = x[finite], y[finite]
    below = np.flatnonzero(y <= level)
    if below.size == 0 or below[-1] + 1 >= y.size:
        return float("nan")
    last = below[-1]
    return float(np.interp(level, y[last : last + 2], x[last : last + 2]))


def line_to_zero(phi: Array, p: Array, window: tuple[float, float] = (3e-4, 4e-3)) -> float:
    """Solid fraction at which the straight line through p = P / E* is zero; nan if there are too few samples.

    The line is a least-squares fit to the samples from where p passes the lower end of the window for good to where
    it first reaches the upper end after that.
    """
    begin, least = last_passage(phi, p, window[0]), 4
    after = np.isfinite(p) & (phi >= begin)
    phi, p = phi[after], p[after]
    over = np.flatnonzero(p >= window[1])
    if over.size == 0 or over[0] < least:
        return float("nan")
    slope, level = np.polyfit(phi[: over[0]], p[: over[0]], 1)
    return float(-level / slope)


def compaction_factor(
    phi: Array, Z: Array, p: Array, phi_0: float, phi_max: float = 1.0, least: float = 2e-3
) -> float:
    """Fit b alone of the law of `Compaction` to p = P / E above `least`; nan if there are too few samples."""
    dense = np.isfinite(phi + Z + p)
    dense[dense] &= (p[dense] > least) & (phi[dense] > phi_0) & (phi[dense] < phi_max)
    if dense.sum() < 6:
        return float("nan")
    law = Compaction(1.0, phi_max, phi_0)(phi[dense], Z[dense])
    return float(law @ p[dense] / (law @ law))
