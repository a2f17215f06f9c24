"""Packings with pressures and forces: Figure 4 of Nezamabadi et al. (2017)."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

import skmpm

from . import stages
from .curves import Study
from .scenes import PLANE

FRICTIONS = (0.0, 0.5)  # from above
STEPS = 12  # of the colours of pressure


class StatesGoneError(Exception):
    """The members are there, but not their states: those of another machine (`archive`)."""


def figure4(found: Study, kind: str) -> Figure | None:
    """Four stages of the first packing of a kind, with the force network."""
    members = [found.packing(kind, friction) for friction in FRICTIONS]
    if None in members:
        return None
    kept = [stages.states(member) for member in members]
    shown = [stage for stage in kept[0] if stage in kept[1]]
    if not shown:
        if all(map(stages.measured, members)):
            raise StatesGoneError
        return None
    figure, axes = plt.subplots(2, len(shown), figsize=(3.2 * len(shown), 5.6), layout="constrained", squeeze=False)
    drawn = []
    for line, member, states in zip(axes, members, kept, strict=True):
        scene = stages.scene(member)
        for axis, stage in zip(line, shown, strict=True):
            drawn.append(packing(axis, scene, states[stage]))
            axis.set_title(f"$\\mu$ = {member.options.friction:g}, nominal {stage:.2f}", fontsize=9)
    top = np.percentile(np.concatenate([np.asarray(discs.get_array()) for discs in drawn]), 99)
    for discs in drawn:
        discs.set_clim(0.0, top)
    figure.colorbar(drawn[0], ax=axes, label="pressure of a disc / E*", shrink=0.6)
    return figure


def packing(axis: Axes, scene: skmpm.Scene, state: skmpm.State) -> PolyCollection:
    """Discs by pressure, lines of force, and the box."""
    boundary, seen = scene.outlines, skmpm.observe(scene, state)
    loops = [1e3 * state.x[:, boundary.point[boundary.body == b]].T for b in range(len(scene.bodies))]
    discs = PolyCollection(
        loops, array=seen.bodies.pressure / PLANE, cmap=plt.get_cmap("YlOrRd", STEPS), edgecolor="0.5", linewidth=0.25
    )
    axis.add_collection(discs)
    net = stages.network(state)
    size = np.hypot(*net.force)
    width = 9.0 / np.sqrt(len(loops)) * size / size.mean() if size.any() else size
    lines = 1e3 * np.moveaxis(net.ends, 2, 0)  # (k, 2 ends, 2)
    axis.add_collection(LineCollection(lines, linewidths=np.minimum(width, 3.5), colors="0.1", capstyle="round"))
    (left, right), (low, high) = 1e3 * state.walls[2:, 0], 1e3 * state.walls[:2, 1]
    axis.plot([left, right, right, left, left], [low, low, high, high, low], "k", linewidth=0.8)
    axis.set(aspect="equal", xlim=(left - 0.3, right + 0.3), anchor="S")
    axis.axis("off")
    return discs
