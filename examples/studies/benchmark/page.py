"""The tables of docs/studies/performance.md and how_large.md, a figure and csv files from results of `study.py`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt

from .. import pages
from ..pages import table
from . import how_large
from .goals import PHASES, STEPS, Line, Result, Results, allowed, goals, ms, per_lu, per_point, phases

MEASURED = """All of this page is measured and written by `python -m examples.studies.benchmark` (here{kept} in
{minutes:.0f} minutes). One process, one thread; medians of {steps} steps after two, of processor time (wall time was
{least:.2f} to {most:.2f} times as much; more than 1.1 indicates a busy machine).
"""
PHASE_HEAD = ("discs", "R/h", "points", "unknowns", "contacts", "Newton", "step / LU", "step / direct", "ms here")


def phase_lines(found: Results) -> list[Line]:
    """Times of all steps of discs, and the shares of their phases, a header first."""
    lines: list[Line] = []
    for r in (r for r in found.all.values() if r["kind"] in ("free", "dense")):
        kind = f"free, {r['law']}" if r["kind"] == "free" else f"dense, friction {r['friction']:g}"
        what = (f"{r['discs']} {kind}", f"{r['cells']:g}", str(r["points"]), str(r["unknowns"]))
        cost = (str(r.get("contacts", "-")), f"{r['newton']:.1f}", *per_lu(r["step"], r), ms(r["step"]))
        lines.append((*what, *cost, *(f"{100.0 * seconds / r['step']:.0f}" for seconds in phases(r).values())))
    return [(*PHASE_HEAD, *(f"{name} %" for name in (*PHASES, "rest"))), *lines]


def short(lines: list[Line]) -> str:
    """The same on the page, without shares."""
    return table(PHASE_HEAD, [each[: len(PHASE_HEAD)] for each in lines[1:]])


def growth_table(found: Results) -> str:
    """How dense packings grow."""
    few, lines = found.reference, []
    for r in found.growth if few is not None else []:
        slower = per_point(r) / per_point(few)
        contacts = (f"{r['contacts'] / r['discs']:.1f}", f"{r['forced'] / r['discs']:.1f}")
        memory = (f"{r['memory']:.0f}", f"{allowed(r):.0f}")
        factor = f"{lu_per_point(r) / lu_per_point(few):.2f}" if "lu" in r else "-"
        system = f"{100.0 * r['system'] / r['step']:.0f}" if "system" in r else "-"
        lines.append((str(r["discs"]), str(r["points"]), *contacts, f"{slower:.2f}", factor, system, *memory))
    of = "" if few is None else f", over that of {few['discs']} discs"
    contacts = ("contacts a disc", "with force")
    head = ("discs", "points", *contacts, f"time per point{of}", f"LU per point{of}", "in the system %")
    head = (*head, "memory [MB]", "allowed")
    return table(head, lines)


def lu_per_point(result: Result) -> float:
    """Time of one LU per point [s]."""
    return float(result["lu"] / result["points"])


def single_table(found: Results) -> str:
    """One body by pyamg."""
    lines = []
    for r, name in ((r, name) for r in found.single for name in STEPS):
        s = r[name]
        what = (f"{r['points']:.2g}", f"{r['unknowns']:.2g}", name, str(s["newton"]), str(s["iterations"]))
        setup = s["phases"].get("factorisation", 0.0) / s["step"]
        cost = (*per_lu(s["step"] / s["newton"], s, 1), ms(s["step"]), f"{100.0 * setup:.0f}", f"{r['memory']:.0f}")
        lines.append((*what, *cost))
    what = ("points", "unknowns", "step", "Newton", "iterations of a solve, most")
    return table((*what, "iteration / LU", "iteration / direct", "ms here", "set-up %", "memory [MB]"), lines)


def draw(found: Results, path: Path) -> None:
    """Time of a step against points, by phase; one body beside it."""
    fig, (left, right) = plt.subplots(1, 2, figsize=(10, 4.4), layout="constrained", sharey=True)
    _draw_growth(left, found)
    _draw_single(right, found)
    left.set(title=f"dense packings, friction {found.friction:g}", xlabel="points", ylabel="ms a step, one machine")
    right.set(title="one disc, linear.amg", xlabel="points")
    for axis, measured in ((left, found.growth), (right, found.single)):
        if measured:  # a logarithmic axis needs something to scale
            axis.set(xscale="log", yscale="log")
            axis.legend(fontsize=7)
        axis.grid(which="major", lw=0.3)
    pages.picture(fig, path, 80)


def _draw_growth(axis: Any, found: Results) -> None:
    points = [r["points"] for r in found.growth]
    for name in PHASES:
        axis.plot(points, [1e3 * max(phases(r)[name], 1e-6) for r in found.growth], ".-", lw=1, label=name)
    axis.plot(points, [1e3 * r["step"] for r in found.growth], "k.-", label="step")
    factored = [(r["points"], 1e3 * r["lu"]) for r in found.growth if "lu" in r]
    if factored:
        axis.plot(*zip(*factored, strict=True), "k:", label="one LU")
    few = found.reference
    if few is not None:
        axis.plot(points, [1e3 * n * per_point(few) for n in points], "0.7", lw=0.8, zorder=0, label="linear growth")


def _draw_single(axis: Any, found: Results) -> None:
    points = [r["points"] for r in found.single]
    for name, style in zip(STEPS, ("s-", "o--"), strict=True):
        of = [r[name] for r in found.single]
        axis.plot(points, [1e3 * s["step"] for s in of], f"k{style}", ms=4, label=f"{name} step")
        for colour, part, label in (("C4", "factorisation", "set-up"), ("C5", "bulk", "forces and solves")):
            spent = [1e3 * s["phases"].get(part, 1e-6) for s in of]
            axis.plot(points, spent, colour + style, ms=3, lw=1, label=f"{name}: {label}")


def flat(result: Result, prefix: str = "") -> Result:
    """Nested results as columns."""
    columns: Result = {}
    for name, value in result.items():
        columns.update(flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {prefix + name: value})
    return columns


def rounded(results: dict[str, Result]) -> list[Result]:
    """All that was measured, a line for every workload."""
    rows = [{"workload": name, **flat(result)} for name, result in results.items()]
    return [{k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows]


def measured(results: dict[str, Result], options: argparse.Namespace) -> str:
    """How long all took, and how busy the machine was."""
    minutes = sum(r["total"] for r in results.values()) / 60.0
    kept = " with `--keep-pages`" if options.keep_pages else ""
    busy = [r["wall"] / r["step"] for r in results.values() if "wall" in r] or [1.0]
    return MEASURED.format(minutes=minutes, kept=kept, least=min(busy), most=max(busy), steps=options.steps)


def write(results: dict[str, Result], options: argparse.Namespace, docs: Path) -> None:
    """Write both pages, the figure and the csv."""
    folder, found = docs / "performance", Results(results, options)
    draw(found, folder / "phases.png")
    lines = phase_lines(found)
    pages.keep(folder, {"phases": lines, "results": pages.columns(rounded(results))})
    parts = {
        "goals": table(("what", "at most", "measured", "verdict"), list(goals(found))),
        "phases": short(lines),
        "growth": growth_table(found),
        "single": single_table(found),
        "measured": measured(results, options),
    }
    pages.put(docs / "performance.md", parts)
    large = {part.__name__: table(*part(found)) for part in (how_large.machine, how_large.ensemble, how_large.shares)}
    pages.put(docs / "how_large.md", large)
