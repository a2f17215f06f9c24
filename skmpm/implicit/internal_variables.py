"""Internal variables of materials with memory at the end of a step, and what their change dissipates."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from skmpm.assembly import Selection
from skmpm.implicit.bulk import Bulk, Configuration
from skmpm.material import InStep, dilatation

Array = NDArray[np.float64]


def updated(bulk: Bulk, configuration: Configuration) -> Array | None:
    """Internal variables (k, n) after a step that ends with the configuration; None if no material has memory."""
    if bulk.internal is None:
        return None
    internal = bulk.internal.copy()
    for law, points, F, _ in _with_memory(bulk, configuration):
        internal[: law.state.shape[0], points] = law.update(F)
    return internal


def dissipated(bulk: Bulk, configuration: Configuration, after: Array | None) -> float:
    """Energy that changes of the internal variables to `after` (k, n) dissipate in a step that ends so [J/m]."""
    if after is None:
        return 0.0
    volume, total = bulk.assembly.volume, 0.0
    for law, points, F, rest in _with_memory(bulk, configuration):
        density = law.dissipated(F, after[: law.state.shape[0], points])
        total += float(volume[points] @ (rest * density))
    return total


def _with_memory(bulk: Bulk, configuration: Configuration) -> Iterator[tuple[InStep, Selection, Array, Array]]:
    """Materials with memory, their points, the total F in which they are evaluated, undeformed over anchor volume."""
    for g, mean in zip(bulk.groups, bulk.dilatations_by_group(configuration), strict=True):
        if isinstance(g.law.material, InStep):
            F = g.of(configuration.F)
            total = g.law.total(F) if mean is None else dilatation.seen(g.law, F, mean)
            yield g.law.material, g.points, total, g.law.rest(F.shape[-1])
