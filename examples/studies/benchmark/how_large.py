"""Tables of docs/studies/how_large.md from the results of `study.py`: one machine, an ensemble, shares of a step."""

from __future__ import annotations

from .goals import PHASES, Line, Result, Results, phases

PER_BODY = ("bulk", "factorisation", "Delassus", "transfer", "linear solves", "report, overlap")
BETWEEN = ("detection", "contact solve")
GB = 1e3  # [MB]
MAIN_JOB = 600  # steps of a compaction from 0.70 to 0.95


def machine(found: Results) -> tuple[Line, list[Line]]:
    """Time of a step, hours of a compaction and memory against the number of discs."""
    head = ("discs", "points", "contacts", "step [s]", f"{MAIN_JOB} such steps [h]", "memory [GB]")
    lines = [
        (
            str(r["discs"]),
            str(r["points"]),
            str(r["contacts"]),
            f"{r['step']:.3g}",
            f"{MAIN_JOB * r['step'] / 3600.0:.2g}",
            f"{r['memory'] / GB:.2g}",
        )
        for r in found.growth
    ]
    return head, lines


def ensemble(found: Results) -> tuple[Line, list[Line]]:
    """Wall time of an ensemble by the number of processes."""
    head = ("processes", "members", "wall time [s]", "over that of one process", "ideal")
    runs = sorted((r for r in found.all.values() if r["kind"] == "ensemble"), key=lambda r: r["processes"])
    lines = [
        (
            str(r["processes"]),
            str(r["members"]),
            f"{r['step']:.1f}",
            f"{r['step'] / runs[0]['step']:.2f}",
            f"{runs[0]['processes'] / r['processes']:.2f}",
        )
        for r in runs
    ]
    return head, lines


def shares(found: Results) -> tuple[Line, list[Line]]:
    """Shares of a step: what each body does alone, and what lies between bodies."""
    head = ("discs", *(f"{name} %" for name in PHASES), "of each body alone %", "between bodies %")
    lines = []
    for r in found.growth:
        spent = phases(r)
        lines.append(
            (
                str(r["discs"]),
                *(_percent(spent[name], r) for name in PHASES),
                _percent(sum(spent[name] for name in PER_BODY), r),
                _percent(sum(spent[name] for name in BETWEEN), r),
            )
        )
    return head, lines


def _percent(seconds: float, result: Result) -> str:
    return f"{100.0 * seconds / result['step']:.0f}"
