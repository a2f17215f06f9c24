"""Compile all loops beforehand: `python -m skmpm.warmup`, after an installation or in an image for a cluster."""

from __future__ import annotations

import time

import numpy as np
import scipy.sparse as sp

from skmpm import Body, LinearElastic, NeoHookean, Scene, Wall, coulomb, disc, simulate

MATERIALS = NeoHookean(1e6, 0.45, 1000.0), LinearElastic(1e6, 0.45, 1000.0)


def warm_up() -> float:
    """Squeeze discs of both laws with friction, solve a sparse contact problem; return how long that takes [s]."""
    began = time.perf_counter()
    walls = [Wall((0.0, 0.0), (0.0, 1.0)), Wall((0.0, 4e-3), (0.0, -1.0), velocity=(0.0, -1.0))]
    for law in MATERIALS:
        bodies = [Body(disc((0.0, y), 1e-3, spacing=0.2e-3), law) for y in (1e-3, 3e-3)]
        for _ in simulate(Scene(bodies, cell=0.25e-3, walls=walls, friction=0.5), dt=5e-6, until=1e-5):
            pass
    W = sp.diags_array([-1.0, 4.0, -1.0], offsets=[-2, 0, 2], shape=(400, 400), format="csr")
    coulomb.solve(W, np.where(np.arange(400) % 2, 0.1, -1.0), np.full(200, 0.5), pairs=np.arange(200) // 4)
    return time.perf_counter() - began


if __name__ == "__main__":
    print(f"skmpm: all loops are compiled; that and four steps took {warm_up():.1f} s")  # noqa: T201
