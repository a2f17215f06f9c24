"""Observables of a run that users publish, to be compared between grids and time steps."""

from __future__ import annotations

import numpy as np
from scenes import SCENES, Case, crush

import skmpm


def ends(case: Case, state: skmpm.State, impulse: np.ndarray) -> dict[str, float]:
    """What users publish, without dimension: speeds over the closing speed, the lid's impulse over E R^2 / c."""
    if case.name not in SCENES | {"crush": crush}:
        return {}
    d = case.parameters
    c = d.closing * d.speed
    m, body = state.mass, state.body
    total = np.bincount(body, m)
    v = np.stack([np.bincount(body, m * component) for component in state.v]) / total
    turn = np.bincount(body, m * rotation_rate(state)) / total
    if case.name in ("squeeze", "crush"):
        found = {"impulse": float(np.linalg.norm(impulse)) * d.speed / (d.stress * d.length**2)}
        points = case.parameters.shape == "point"
        return found if points else found | {"elongation": float(elongation(state).mean()) - 1.0}
    values = {"velocity x": v[0, 0], "velocity y": v[1, 0], "spin": turn[0] * d.length}
    if len(total) > 1 and case.name == "collision":
        values |= {"velocity x of 2": v[0, 1], "velocity y of 2": v[1, 1], "spin of 2": turn[1] * d.length}
    return {name: float(value / c) for name, value in values.items()}


def rotation_rate(state: skmpm.State) -> np.ndarray:
    """Of the points, (n,) [1/s]: the skew part of C F_rel^-1, as C is by positions at the anchor."""
    F, A = np.moveaxis(state.F, -1, 0), np.moveaxis(state.F_anchor, -1, 0)
    L = np.moveaxis(state.C, -1, 0) @ A @ np.linalg.inv(F)
    return 0.5 * (L[:, 1, 0] - L[:, 0, 1])


def elongation(state: skmpm.State) -> np.ndarray:
    """Ratio of the principal radii of gyration of every body, (bodies,)."""
    w, total = state.volume, np.bincount(state.body, state.volume)
    centre = np.stack([np.bincount(state.body, w * x) for x in state.x]) / total
    d = state.x - centre[:, state.body]
    xx, yy, xy = (np.bincount(state.body, w * a * b) for a, b in ((d[0], d[0]), (d[1], d[1]), (d[0], d[1])))
    half, root = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    return np.sqrt((half + root) / np.maximum(half - root, 1e-300))


def difference(found: dict[str, float], fine: dict[str, float], name: str) -> float:
    """Error against a fine reference: of velocities over the closing speed; of impulse and elongation relative."""
    if not found or set(found) != set(fine):
        return float("nan")
    if name in ("squeeze", "crush"):
        return max(abs(found[k] - fine[k]) / max(abs(fine[k]), 1e-3) for k in fine)
    return max(abs(found[k] - fine[k]) for k in fine)
