"""The figures of docs/studies/packing_ensemble.md, drawn from the members of the study."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image

from .checks import compaction_fits, power_fits
from .claims import CELLS, JAMMED, apparent, bends, change, resisting
from .curves import PHI, PLANE, YOUNG, Array, Member, Study
from .snapshots import distant, figure4

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

COLOURS = {0.0: "C0", 0.5: "C3"}
DASHES = {0.0: "--", 0.5: ":"}  # of fits, black
LABELS = {"contact_surface": "contact specific surface S", "anisotropy": "orientation anisotropy $A_m$",
          "aspect_ratio": r"aspect ratio $\alpha$"}  # fmt: skip
FRACTION = r"solid fraction $\Phi$ by outlines"
DPI = 120, 110, 100, 90, 80, 70  # the first at which a picture is small enough
LARGEST = 120_000  # bytes
TONES = 64  # colours of a picture


def draw(found: Study, folder: Path) -> dict[str, str]:
    """Draw what the members allow; captions by file."""
    folder.mkdir(parents=True, exist_ok=True)
    captions = {}
    for name, (picture, caption) in PICTURES.items():
        figure = picture(found)
        if figure is None:
            (folder / name).unlink(missing_ok=True)  # one of an earlier study would be mistaken for this one's
            continue
        save(figure, folder / name)
        captions[name] = caption
    return captions


def save(figure: Figure, path: Path) -> None:
    """Write a small PNG."""
    for dpi in DPI:
        memory = io.BytesIO()
        figure.savefig(memory, dpi=dpi)
        image = Image.open(memory).convert("RGB")
        image.quantize(TONES, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(path, optimize=True)
        if path.stat().st_size < LARGEST:
            break
    plt.close(figure)


def figure2(found: Study) -> Figure | None:
    """S, A_m and alpha against the solid fraction."""
    if not any(found.seeds(friction) for friction in COLOURS):
        return None
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.6), layout="constrained")
    for axis, (name, label) in zip(axes, LABELS.items(), strict=True):
        for friction in COLOURS:
            band(axis, found, friction, name)
            thin(axis, found, friction, name)
            if name != "anisotropy" and (fits := bends(found.seeds(friction), name)):
                fitted(axis, found, friction, name, [fit(PHI) for fit in fits], 0.5)
        axis.set(xlabel=FRACTION, ylabel=label)
    axes[0].legend(fontsize=8)
    return figure


def band(axis: Axes, found: Study, friction: float, name: str, unit: float = 1.0) -> None:
    """Mean over the packings and its standard error."""
    value, error = found.curve(friction, name)
    count = len(found.seeds(friction))
    if count == 0:
        return
    value, error, colour = unit * value, unit * error, COLOURS[friction]
    axis.plot(PHI, value, colour, linewidth=1.6, label=rf"$\mu$ = {friction:g} ({count} packings)")
    axis.fill_between(PHI, value - error, value + error, color=colour, alpha=0.25, linewidth=0.0)


def thin(axis: Axes, found: Study, friction: float, name: str, unit: float = 1.0) -> None:
    """The runs on a finer grid and with a slower lid."""
    for kind, style in (("fine", "--"), ("slow", ":")):
        member = found.get(f"{kind}_mu{friction:g}")
        if member is not None:
            axis.plot(PHI, unit * member.over(name), COLOURS[friction], linestyle=style, linewidth=0.8)


def fitted(
    axis: Axes, found: Study, friction: float, name: str, curves: list[Array], width: float, label: str = ""
) -> None:
    """Mean of fitted curves, as far as the measured one goes."""
    there = np.isfinite(found.curve(friction, name)[0])
    line = np.where(there, np.mean(curves, axis=0), np.nan)
    axis.plot(PHI, line, "k", linestyle=DASHES[friction], linewidth=width, label=label or None)


def pressure(found: Study) -> Figure | None:
    """P / E* with the law of compaction."""
    return law(found, "pressure", 1.0 / PLANE, "pressure / E*", compaction)


def compaction(axis: Axes, found: Study, friction: float) -> None:
    """The mean of the packings' laws, and of their constants."""
    fits = compaction_fits(found, friction)
    if not fits:
        return
    b, phi_max, phi_0 = np.mean([(f.b, f.phi_max, f.phi_0) for _, f in fits], axis=0)
    curves = [np.where(f.phi_0 < PHI, f(PHI, member.over("coordination")), np.nan) for member, f in fits]
    label = rf"b {b:.3f}, $\Phi_{{max}}$ {phi_max:.3f}, $\Phi_0$ {phi_0:.3f}"
    fitted(axis, found, friction, "pressure", YOUNG / PLANE * np.array(curves), 1.0, label)


def coordination(found: Study) -> Figure | None:
    """Z with the power law."""
    return law(found, "coordination", 1.0, "coordination Z", powers)


def powers(axis: Axes, found: Study, friction: float) -> None:
    """The mean of the packings' laws, and of their constants."""
    fits = power_fits(found, friction)
    if not fits:
        return
    phi_J, a, beta = np.mean([(f.phi_J, f.a, f.beta) for f in fits], axis=0)
    label = rf"$Z_J$ {fits[0].Z_J:g}, $\Phi_J$ {phi_J:.3f}, a {a:.2f}, $\beta$ {beta:.2f}"
    fitted(axis, found, friction, "coordination", [fit(PHI) for fit in fits], 1.0, label)


def law(found: Study, name: str, unit: float, label: str, fit: Callable[[Axes, Study, float], None]) -> Figure | None:
    """One measure of both frictions with what is fitted to it."""
    if not any(found.seeds(friction) for friction in COLOURS):
        return None
    figure, axis = plt.subplots(figsize=(6.5, 4), layout="constrained")
    for friction in COLOURS:
        band(axis, found, friction, name, unit)
        thin(axis, found, friction, name, unit)
        fit(axis, found, friction)
    axis.set(xlabel=FRACTION, ylabel=label)
    axis.legend(fontsize=8)
    return figure


def artefact(found: Study) -> Figure | None:
    """Interior pressure against interior solid fraction with shared-grid contact, and with the gap corrected."""
    shared = {c: m for c in CELLS if (m := found.get(f"shared_grid_mu0_r{c}"))}
    ours = {f"$\\mu$ = {f:g}, {what}": m for what, name in (("2 m/s", "mu{:g}_seed0"), ("0.5 m/s", "slow_mu{:g}"))
            for f in COLOURS if (m := found.get(name.format(f)))}  # fmt: skip
    if not shared:
        return None
    usual, _ = resisting(found, 0.0)
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), sharey=True, layout="constrained")
    for i, (cells, member) in enumerate(shared.items()):
        for full, style in ((JAMMED, "--"), (usual, ":")):
            left.axvline(apparent(cells, full), color=f"C{i}", linewidth=0.8, linestyle=style)
        resistance(left, member, f"C{i}", f"R/h = {cells}")
    if member := found.get("shared_grid_mu0.5_r6"):
        resistance(left, member, "0.5", r"R/h = 6, $\mu$ = 0.5")
    for i, (label, member) in enumerate(ours.items()):
        resistance(right, member, f"C{i}", label)
    right.axvspan(0.83, 0.86, color="0.9", label="jamming without friction")
    for axis, title in ((left, "mode of Nezamabadi et al. (2017)"), (right, "gap corrected")):
        axis.axhline(1e-3, color="k", linewidth=0.5)
        axis.set(yscale="log", ylim=(1e-5, 0.2), xlabel="solid fraction of the interior", title=title)
        axis.legend(fontsize=8)
    left.set_ylabel("pressure of the interior / E*")
    return figure


def resistance(axis: Axes, member: Member, colour: str, label: str) -> None:
    """The interior of one member, and its first change."""
    p = member.steady("interior_pressure") / PLANE
    axis.plot(member.steady("interior_fraction"), np.maximum(p, 1e-9), colour, linewidth=1.0, label=label)
    axis.plot(change(member), 1e-3, "o", color=colour, markersize=4)


def forgetting(found: Study) -> Figure | None:
    """The same packing with and without its stress kept at cell crossings."""
    both = {"kept": found.get("mu0.5_seed0"), "body grids rebuilt at every step": found.get("regridded_mu0.5")}
    if None in both.values():
        return None
    figure, axis = plt.subplots(figsize=(6.5, 4), layout="constrained")
    for label, member in both.items():
        axis.plot(PHI, member.over("pressure") / PLANE, linewidth=1.4, label=label)
    axis.set(xlabel=FRACTION, ylabel="pressure / E*")
    axis.legend(fontsize=8)
    return figure


PICTURES: dict[str, tuple[Callable[[Study], Figure | None], str]] = {
    "figure2.png": (
        figure2,
        "Contact surface, anisotropy and aspect ratio: means over the packings, the bands are standard errors. "
        "In colour, dashed: R/h = 8, dotted: lid at 0.5 m/s; black, thin: the break-point fits.",
    ),
    "figure4.png": (
        figure4,
        "Stages without (above) and with friction (below): discs by pressure over E/(1 - nu^2), lines from centre to "
        "centre as wide as the force, relative to the mean of each picture.",
    ),
    "pressure.png": (
        pressure,
        "Pressure, mean over one transit time (lines and bands as above), and the law of compaction.",
    ),
    "coordination.png": (coordination, "Coordination (lines and bands as above), and the power law above jamming."),
    "artefact.png": (
        artefact,
        "Left, shared-grid contact: vertical lines at 0.842 / (1 + h/2R)^2, "
        "dashed, and with the mean first change of our packings at 2 m/s instead of 0.842, dotted; dots where the "
        "first change is found. Right, with the gap corrected.",
    ),
    "distant.png": (
        distant,
        "A corner of the box at a nominal 0.75, without friction: discs by pressure, each picture with its own scale,"
        " and lines of force. In the mode of Nezamabadi et al. (2017) discs push each other across gaps.",
    ),
    "forgetting.png": (
        forgetting,
        "What forgetting stress at cell crossings does to the pressure: the same packing, friction 0.5.",
    ),
}
