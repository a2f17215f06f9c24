"""Figures of the effects of the grid: the gap of shared nodes, and stress that is forgotten at cell crossings."""

from __future__ import annotations

import numpy as np

from .claims import JAMMED, apparent, change, resisting
from .curves import PHI, Member, Study
from .drawing import FRACTION, Axes, Figure, plt
from .members import CELLS


def artefact(found: Study) -> Figure | None:
    """Interior pressure against interior solid fraction with shared-grid contact, and with the gap corrected."""
    shared = {c: m for c in CELLS if (m := found.get(f"shared_grid_mu0_r{c}"))}
    ours = {
        rf"$\mu$ = {mu:g}, {what}": m
        for what, kind in (("2 m/s", "fast"), ("quasi-static", "quasistatic"))
        for mu in (0.0, 0.5)
        if (m := found.packing(kind, mu))
    }
    if not shared:
        return None
    usual, _ = resisting(found, "fast", 0.0)
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), sharey=True, layout="constrained")
    for i, (cells, member) in enumerate(shared.items()):
        for full, style in ((JAMMED, "--"), (usual, ":")):
            if np.isfinite(full):
                left.axvline(apparent(cells, full), color=f"C{i}", linewidth=0.8, linestyle=style)
        resistance(left, member, f"C{i}", f"R/h = {cells}")
    if member := found.get("shared_grid_mu0.5_r6"):
        resistance(left, member, "0.5", r"R/h = 6, $\mu$ = 0.5")
    for i, (label, member) in enumerate(ours.items()):
        resistance(right, member, f"C{i}", label)
    right.axvspan(0.83, 0.86, color="0.9", label="jamming without friction")
    for axis, title in ((left, "mode of Nezamabadi et al. (2017)"), (right, "contact at outlines")):
        axis.axhline(1e-3, color="k", linewidth=0.5)
        axis.set(yscale="log", ylim=(1e-5, 0.2), xlabel="solid fraction of the interior", title=title)
        axis.legend(fontsize=8)
    left.set_ylabel("pressure of the interior / E*")
    return figure


def resistance(axis: Axes, member: Member, colour: str, label: str) -> None:
    """The interior of one member, and its first change."""
    p = member.steady("interior_pressure") / member.plane
    axis.plot(member.steady("interior_fraction"), np.maximum(p, 1e-9), colour, linewidth=1.0, label=label)
    axis.plot(change(member), 1e-3, "o", color=colour, markersize=4)


def forgetting(found: Study) -> Figure | None:
    """The same packing with and without its stress kept at cell crossings."""
    both = {"kept": found.packing("fast", 0.5), "body grids rebuilt at every step": found.packing("regridded", 0.5)}
    if None in both.values():
        return None
    figure, axis = plt.subplots(figsize=(6.5, 4), layout="constrained")
    for label, member in both.items():
        if member is not None:
            axis.plot(PHI, member.pressure(), linewidth=1.4, label=label)
    axis.set(xlabel=FRACTION, ylabel="pressure / E*")
    axis.legend(fontsize=8)
    return figure
