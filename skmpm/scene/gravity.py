"""Gravity, a constant or a field."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.scene.input import Input
from skmpm.scene.objects import field_values

Array = NDArray[np.float64]


def gravity_at(scene: Input, X: Array, t: float) -> Array:
    """Gravity at undeformed positions X (2, n) at time t, (2, n) [m/s2]; SceneError if a field of it is wrong."""
    if not callable(scene.gravity):
        return np.broadcast_to(np.asarray(scene.gravity, dtype=float)[:, None], X.shape)
    return field_values(f"gravity(X, t) at t = {t:.6g} s", scene.gravity(X.copy(), t), X)  # it may work in place
