"""Whether the internal variables of a material fit its functions: a part of `check_material`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from skmpm.material.law import product
from skmpm.material.memory import InStep, virgin

Array = NDArray[np.float64]

SAME = 1e-8  # of the largest internal variable, for what should not change; a return mapping may iterate
SMALLEST, LARGEST = 1e-4, 1e-1  # deformations since the state was reached, on which laws still unload or flow again


def histories(material: Any, F: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Internal variables (k, n) of points that were deformed by F (2, 2, n), and deformations from there on."""
    state, n = virgin(material).update(F), F.shape[-1]  # type: ignore[attr-defined]
    size = np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST), n))
    return state, product(np.eye(2)[:, :, None] + size * rng.uniform(-1.0, 1.0, (2, 2, n)), F)


def check_update(name: str, material: Any, F: Array, state: Array, turn: Array) -> str:
    """Check that `update` is finite, keeps what it gave, turns with the body, and that no energy is won.

    Parameters
    ----------
    F : (2, 2, n) at the end of the step
    state : (k, n) at its start
    turn : (2, 2, n) rotations
    """
    after = np.asarray(material.update(F, state))
    if after.shape != state.shape or not np.isfinite(after).all():
        raise ValueError(f"{name}: update(F, state) is not finite numbers of shape {state.shape}")
    size, offs = float(np.abs(after).max()), []
    for what, again in (
        ("update(F, update(F, state))", np.asarray(material.update(F, after))),
        ("update(Q F, state)", np.asarray(material.update(product(turn, F), state))),
    ):
        offs.append(float(np.abs(again - after).max()) / size)
        if not offs[-1] <= SAME:
            raise ValueError(
                f"{name}: {what} and update(F, state) differ by {offs[-1]:.2e} of the largest (at most {SAME:g})"
            )
    scale = float(np.abs(material.energy(F, state)).max())
    before, then = (InStep(material, s).stress(F) for s in (state, after))
    off = float(np.abs(then - before).max() / np.abs(before).max())
    if not off <= SAME:
        raise ValueError(
            f"{name}: stress(F, update(F, state)) and stress(F, state) differ by {off:.2e} of the largest entry (at"
            f" most {SAME:g}); energy(F, state) is the minimum over the internal variables at the end of the step"
        )
    lost = InStep(material, state).dissipated(F, after)
    if not lost.min() >= -SAME * scale:
        raise ValueError(
            f"{name}: energy(F, state) - energy(F, update(F, state)) is {lost.min():.4g} Pa; a step dissipates energy"
        )
    changed = float((np.abs(after - state).max(axis=0) > SAME * size).mean())
    return (
        f"update keeps what it gave and turns with the body: to {max(offs):.1e}; {changed:.0%} of the states change"
    )
