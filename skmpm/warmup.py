"""Compile loops beforehand: `python -m skmpm.warmup`, after an installation or in an image for a cluster.

Loops are compiled for the types and the memory layout of their arguments. Scenes that differ much from the ones here
may need others, which takes a second each when they are first called.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np
import scipy.sparse as sp

from skmpm import (
    Body,
    ElastoPlastic,
    LinearElastic,
    NeoHookean,
    Periodic,
    Scene,
    Scheme,
    Support,
    Wall,
    box,
    coulomb,
    disc,
    ellipse,
    observe,
    packing,
    preflight,
    simulate,
)

MATERIALS = NeoHookean(1e6, 0.45, 1000.0), LinearElastic(1e6, 0.3, 1000.0)
PLASTIC = ElastoPlastic(1e6, 0.3, 1000.0, yield_stress=10.0)
RADIUS, SPACING, CELL = 1e-3, 0.2e-3, 0.25e-3
DT = 5e-6


def warm_up() -> float:
    """Take a few steps of small scenes of all kinds, solve sparse contact problems; return the time taken [s]."""
    began = time.perf_counter()
    for scene, options in _scenes():
        preflight(scene, **options)
        *_, state = islice(simulate(scene, until=1.0, warn=False, **options), 4)
        observe(scene, state)
    packing([ellipse((0.0, 0.0), (1e-3, 0.7e-3), spacing=SPACING)] * 4, width=5e-3, solid_fraction=0.6, friction=0.5)
    for index in (np.int32, np.int64):
        W = sp.diags_array([-1.0, 4.0, -1.0], offsets=[-2, 0, 2], shape=(400, 400), format="csr")
        W.indptr, W.indices = W.indptr.astype(index), W.indices.astype(index)
        coulomb.solve(W, np.where(np.arange(400) % 2, 0.1, -1.0), np.full(200, 0.5))
    return time.perf_counter() - began


def _scenes() -> Iterator[tuple[Scene, dict[str, Any]]]:
    """Squeezed discs of both laws with and without friction in all kinds of steps, and held bars."""
    packed = packing([RADIUS] * 12, width=6.5 * RADIUS, solid_fraction=0.7, seed=0)
    sides = [Wall((0.0, 0.0), (0.0, 1.0)), Wall((0.0, 0.0), (1.0, 0.0)), Wall((packed.width, 0.0), (-1.0, 0.0))]
    walls = [*sides, Wall((0.0, packed.height), (0.0, -1.0), velocity=(0.0, -0.1))]
    periodic = Periodic(packed.width, packed.height, rate=((0.0, 0.0), (0.0, -10.0)))
    held = [Support(lambda x: x[0] < 2.0 * CELL)]
    for law in (*MATERIALS, PLASTIC):
        bar = Body(box((0.0, 0.0), (12 * CELL, 4 * CELL), spacing=SPACING), law)
        yield Scene([bar], cell=CELL, supports=held, gravity=(0.0, -10.0)), {"dt": 1e-4}
    for law in MATERIALS:
        bodies = [Body(disc(x, RADIUS, spacing=SPACING), law) for x in packed.centres.T]
        fitted = [Body(disc((x, 0.0), RADIUS, spacing=SPACING), law) for x in (0.0, 2.0 * RADIUS - 0.2 * CELL)]
        yield Scene(fitted, cell=CELL, overlap=0.2 * CELL), {"dt": DT}
        for friction in (0.0, 0.5):
            scene = Scene(bodies, cell=CELL, walls=walls, friction=friction)
            yield scene, {"dt": DT}
            if law is MATERIALS[0]:  # no law has loops of its own in chosen steps, in which discs turn
                yield scene, {"dt": None}
            yield scene, {"dt": 0.1 * DT, "scheme": Scheme.nezamabadi2017()}
            yield scene, {"dt": 1e-4, "scheme": Scheme(inertia=False)}
            yield Scene(bodies, cell=CELL, periodic=periodic, friction=friction), {"dt": DT}


if __name__ == "__main__":
    print(f"skmpm: the loops of common scenes are compiled; that and a few steps took {warm_up():.1f} s")  # noqa: T201
