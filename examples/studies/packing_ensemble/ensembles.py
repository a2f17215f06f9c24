"""Figures of curves: Figure 2 of Nezamabadi et al. (2017), pressures, coordination, rates, effects of the grid."""

from __future__ import annotations

import numpy as np

from .claims import JAMMED, apparent, bends, change, resisting
from .curves import NEAR_JAMMING, PHI, Member, Study, mean
from .drawing import COLOURS, FRACTION, Axes, Figure, any_of, band, fitted, label_of, legend, line, panels, plt
from .fits import Compaction
from .members import CELLS, LIDS, RATIOS
from .scenes import NU, PLANE, YOUNG
from .targets import fixed, inside, phi_jammed, z_inside

LABELS = {"contact_surface": "contact specific surface S", "anisotropy": "orientation anisotropy $A_m$",
          "aspect_ratio": r"aspect ratio $\alpha$"}  # fmt: skip
TICKS = (0.80, 0.85, 0.90, 0.95)
BARE = "coordination_without_rattlers"


def figure2(found: Study) -> Figure | None:
    """S, A_m and alpha against the solid fraction, at 2 m/s and quasi-static."""
    kinds = [kind for kind in ("fast", "quasistatic") if any_of(found, kind)]
    if not kinds:
        return None
    figure, axes = panels(len(kinds), 3, 3.7, 3.3, sharex=True, sharey="col")
    for row, kind in zip(axes, kinds, strict=True):
        for axis, (name, label) in zip(row, LABELS.items(), strict=True):
            for mu in COLOURS:
                band(axis, found, kind, mu, name, label=label_of(found, kind, mu))
                if kind == "quasistatic":
                    line(axis, found, "fine", mu, name, "--")
                if name != "anisotropy" and mu != 0.1 and (fits := bends(found.seeds(kind, mu), name)):
                    fitted(axis, found, kind, mu, [fit(PHI) for fit in fits])
            axis.set_ylabel(label)
        row[0].legend(fontsize=8, title={"fast": "2 m/s"}.get(kind, "quasi-static"))
    for axis in axes[-1]:
        axis.set_xlabel(FRACTION)
    return figure


def pressure(found: Study) -> Figure | None:
    """P / E* with the law of compaction, and near jamming."""
    if not any_of(found, "quasistatic", "periodic", "fast"):
        return None
    figure, ((left, right),) = panels(1, 2, 5.5, 4.0)
    for mu, colour in COLOURS.items():
        members = found.seeds("quasistatic", mu)
        band(left, found, "quasistatic", mu, "pressure", 1.0 / PLANE, label=label_of(found, "quasistatic", mu))
        line(left, found, "periodic", mu, "pressure", "--", 1.0 / PLANE)
        line(left, found, "fast", mu, "pressure", ":", 1.0 / PLANE)
        laws = [
            np.where(phi_jammed(m, box=True) < PHI, b * unit(PHI, m.over("coordination")), np.nan)
            for m in members
            if np.isfinite(b := fixed(m, "coordination"))
            for unit in [Compaction(1.0, 1.0, phi_jammed(m, box=True))]
        ]
        if laws:
            fitted(left, found, "quasistatic", mu, [YOUNG / PLANE * law for law in laws])
        both = [*((m, "-") for m in members), *((m, "--") for m in found.seeds("periodic", mu))]
        for m, style in both:
            p, jammed = inside(m, "interior_pressure", NEAR_JAMMING) / m.plane, phi_jammed(m)
            right.plot(NEAR_JAMMING, p, colour, linestyle=style, linewidth=0.9)
            top = np.interp(4e-3, *_rising(p), right=np.nan)
            right.plot([jammed, top], [0.0, 4e-3], "k", linewidth=0.5)
    left.set(xlabel=FRACTION, ylabel="pressure / E*")
    right.set(xlabel="solid fraction of the interior", ylabel="pressure of the interior / E*")
    right.set(ylim=(-2e-4, 8e-3), xlim=(0.76, 0.89))
    right.axhspan(3e-4, 4e-3, color="0.93", zorder=0)
    legend(left)
    return figure


def _rising(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pressures and solid fractions up to where the first reach 4e-3, for interpolation."""
    known = np.isfinite(p)
    p, phi = np.maximum.accumulate(p[known]), NEAR_JAMMING[known]
    return (p, phi) if p.size else (np.zeros(1), np.full(1, np.nan))


def coordination(found: Study) -> Figure | None:
    """Z with and without rattlers, and the root above jamming."""
    if not any_of(found, "quasistatic", "periodic"):
        return None
    figure, ((left, right),) = panels(1, 2, 5.5, 4.0)
    for mu in COLOURS:
        band(left, found, "quasistatic", mu, BARE, label=label_of(found, "quasistatic", mu))
        line(left, found, "periodic", mu, BARE, "--")
        line(left, found, "quasistatic", mu, "coordination", ":")
    x = np.geomspace(2e-3, 0.12, 40)
    for kind, style in (("quasistatic", "-"), ("periodic", "--")):
        for k, m in enumerate(found.seeds(kind, 0.0)):
            z = z_inside(m, phi_jammed(m) + x) - 4.0
            name = f"packing {k}" if style == "-" else None
            right.plot(x, np.where(z > 0.0, z, np.nan), f"C{k}", linestyle=style, linewidth=0.9, label=name)
    right.fill_between(x, 3.1 * np.sqrt(x), 4.1 * np.sqrt(x), color="0.85", linewidth=0.0)
    right.plot(x, 3.6 * np.sqrt(x), "k", linewidth=0.8)
    left.set(xlabel=FRACTION, ylabel="coordination Z")
    right.set(
        xscale="log", yscale="log", xlabel=r"$\Phi - \Phi_J$", ylabel="Z - 4 without rattlers", ylim=(0.05, 3.0)
    )
    legend(left), legend(right)
    return figure


def kinds(found: Study) -> Figure | None:
    """Ratios of mean pressures."""
    shown = {
        "isotropic / uniaxial": ("quasistatic", "periodic"),
        "2 m/s / quasi-static": ("quasistatic", "fast"),
        "R/h = 8 / R/h = 5": ("quasistatic", "fine"),
    }
    pairs = {(words, mu): found.pairs(*names, mu) for words, names in shown.items() for mu in COLOURS}
    if not any(pairs.values()):
        return None
    figure, (axes,) = panels(1, 3, 3.8, 3.3, sharey=True)
    for axis, words in zip(axes, shown, strict=True):
        for mu, colour in COLOURS.items():
            if pairs[words, mu]:
                sides = zip(*pairs[words, mu], strict=True)
                below, above = (np.mean([m.over("pressure") for m in side], axis=0) for side in sides)
                axis.plot(
                    PHI, above / below, colour, linewidth=1.2, label=rf"$\mu$ = {mu:g} ({len(pairs[words, mu])})"
                )
        axis.axhline(1.0, color="k", linewidth=0.5)
        axis.set(xlabel=FRACTION, title=f"P: {words}", ylim=(0.5, 1.5), xlim=(0.78, 0.98), xticks=TICKS)
        legend(axis)
    return figure


def materials(found: Study) -> Figure | None:
    """P / E* of three Poisson's ratios."""
    pairs = {nu: found.pairs("quasistatic", f"nu{nu:g}", 0.0) for nu in RATIOS}
    if not any(pairs.values()):
        return None
    figure, ((left, right),) = panels(1, 2, 5.5, 4.0)
    usual = found.seeds("quasistatic", 0.0)[: max(map(len, pairs.values()))]
    sides = {NU: usual, **{nu: [other for _, other in both] for nu, both in pairs.items() if both}}
    for k, (nu, members) in enumerate(sorted(sides.items())):
        for along, style in (("solid_fraction", "-"), ("solid_fraction_nominal", ":")):
            p, _ = mean(np.array([m.over("pressure", along=along) / m.plane for m in members]))
            left.plot(PHI, p, f"C{k}{style}", linewidth=1.2, label=rf"$\nu$ = {nu:g}" if style == "-" else None)
        if nu != NU:
            ratio = np.mean([[m.pressure() for m in pair] for pair in pairs[nu]], axis=0)
            right.plot(PHI, ratio[1] / ratio[0], f"C{k}", label=rf"$\nu$ = {nu:g} / {NU:g}")
    right.axhspan(0.95, 1.05, color="0.9", zorder=0)
    left.set(xlabel="solid fraction", ylabel="pressure / E*")
    right.set(xlabel=FRACTION, ylabel="ratio of P / E*", ylim=(0.7, 1.3), xlim=(0.84, 0.97))
    left.legend(fontsize=8), right.legend(fontsize=8)
    return figure


def rates(found: Study) -> Figure | None:
    """The first packing under three lids, relative to the mean of the packings."""
    there = [
        mu for mu in COLOURS if any(found.packing(f"lid{v:g}", mu) for v in LIDS) and found.seeds("quasistatic", mu)
    ]
    if not there:
        return None
    figure, axes = panels(2, len(there), 3.8, 2.8, sharex=True, sharey="row")
    for column, mu in enumerate(there):
        lids = [
            found.packing(f"lid{LIDS[0]:g}", mu),
            found.packing("quasistatic", mu),
            found.packing(f"lid{LIDS[1]:g}", mu),
        ]
        for axis, name, relative in ((axes[0][column], "pressure", True), (axes[1][column], BARE, False)):
            _deviations(axis, found, mu, [m for m in lids if m], name, relative=relative)
        axes[0][column].set(title=rf"$\mu$ = {mu:g}", ylim=(0.7, 1.3), xlim=(0.82, 0.98), xticks=TICKS[1:])
        axes[1][column].set(xlabel=FRACTION, ylim=(-0.4, 0.4))
    axes[0][0].set_ylabel("P / mean P")
    axes[1][0].set_ylabel("Z - mean Z")
    axes[0][0].legend(fontsize=8)
    return figure


def _deviations(axis: Axes, found: Study, mu: float, lids: list, name: str, *, relative: bool) -> None:
    """Curves of one packing, less the mean of all packings or over it."""
    samples = np.array([m.over(name) for m in found.seeds("quasistatic", mu)])
    middle, error = mean(samples)
    unit, zero = (middle, 1.0) if relative else (np.ones_like(middle), 0.0)
    spread = error * np.sqrt(len(samples)) / unit
    axis.fill_between(PHI, zero - spread, zero + spread, color="0.88", linewidth=0.0)
    for m in lids:
        values = m.over(name) / unit if relative else m.over(name) - middle
        axis.plot(PHI, values, linewidth=1.0, label=f"{1e3 * m.options.speed:g} mm/s")


def artefact(found: Study) -> Figure | None:
    """Interior pressure against interior solid fraction with contact at shared nodes, and at outlines."""
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
