"""Results of `study.py` against the performance goals."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

Result = dict[str, Any]
Line = tuple[str, ...]

STEPS = ("quasi-static", "dynamic")
PHASES = {
    "detection": ("detection",),
    "Delassus": ("delassus",),
    "contact solve": ("contact",),
    "linear solves": ("linear",),
    "factorisation": ("factorisation",),
    "bulk": ("bulk",),
    "transfer": ("transfer",),
    "report, overlap": ("report", "overlap"),
}
# Goals, in times of one LU: milliseconds asked for over the 135 of an LU. A Newton iteration of the dense frictional
# step of version 0.1 took 2.4 LUs; 0.45 of that on one core and 0.33 on two are asked for.
FREE = {"LinearElastic": 25 / 135, "NeoHookean": 75 / 135}
DENSE, DENSE_ON_TWO = 0.45 * 2.4, 0.33 * 2.4
SLOWER, LARGE = 1.15, 3000  # of time per point, up to so many discs
MEMORY = 16.0  # [GB] of ten thousand discs
PER_DISC, PER_POINT = 0.4, 1.2e-3  # allowed memory [MB]


def phases(result: Result) -> dict[str, float]:
    """Seconds by the phases of the page; what no phase claims comes last."""
    spent = result["phases"]
    found = {name: sum(spent.get(part, 0.0) for part in parts) for name, parts in PHASES.items()}
    return {**found, "rest": max(result["step"] - sum(found.values()), 0.0)}


def per_lu(seconds: float, result: Result, digits: int = 2) -> tuple[str, str]:
    """A time in those of the two LUs of the same matrix: the faster one, and that of `linear.direct`."""
    if "lu" not in result:
        return "-", "-"
    return f"{seconds / result['lu']:.{digits}f}", f"{seconds / result['lu_direct']:.{digits}f}"


def ms(seconds: float) -> str:
    """Milliseconds, with three digits or none behind the point."""
    return f"{1e3 * seconds:.3g}" if seconds < 1.0 else f"{1e3 * seconds:.0f}"


class Results:
    """The results by what they are of."""

    def __init__(self, results: dict[str, Result], options: argparse.Namespace) -> None:
        self.all = results
        self.main, self.cells, self.friction = options.main, options.cells[0], options.friction[0]

    def dense(self, discs: int, cells: float, friction: float) -> Result | None:
        """A dense packing, None where it was not measured."""
        return self.all.get(f"dense_{discs}_{cells:g}_{friction:g}")

    @property
    def growth(self) -> list[Result]:
        """Dense packings of all sizes."""
        of = [r for r in self.all.values() if r["kind"] == "dense"]
        chosen = [r for r in of if (r["cells"], r["friction"]) == (self.cells, self.friction)]
        return sorted(chosen, key=lambda r: r["discs"])

    @property
    def reference(self) -> Result | None:
        """The one that growth is relative to: 100 discs, or the fewest."""
        return next((r for r in self.growth if r["discs"] == 100), self.growth[0] if self.growth else None)

    @property
    def single(self) -> list[Result]:
        """Single bodies."""
        return sorted((r for r in self.all.values() if r["kind"] == "single"), key=lambda r: r["points"])


def verdict(value: float, goal: float) -> str:
    """Whether it is met."""
    return "met" if value <= goal else "**missed**"


def goals(found: Results) -> Iterator[Line]:
    """Goal by goal: what, the goal, what was measured, whether it is met."""
    yield from _bulk_goals(found)
    yield from _contact_goals(found)
    yield from _growth_goals(found)
    yield from _large_goals(found)
    yield from _memory_goals(found)


def _in_lu(what: str, seconds: float, result: Result, goal: float) -> Line:
    if "lu" not in result:
        return what, f"{goal:.2f} LU", f"{ms(seconds)} ms", "no LU"
    return what, f"{goal:.2f} LU", f"{per_lu(seconds, result)[0]} LU", verdict(seconds / result["lu"], goal)


def _bulk_goals(found: Results) -> Iterator[Line]:
    for law, goal in FREE.items():
        r = found.all.get(f"free_{law}")
        if r is not None:
            what = f"{r['discs']} free {law}, {r['newton']:.1f} iterations"
            yield _in_lu(what, r["step"], r, goal)


def _contact_goals(found: Results) -> Iterator[Line]:
    rough, smooth = (found.dense(found.main, found.cells, mu) for mu in (found.friction, 0.0))
    if rough is None:
        return
    what = f"dense step with friction, {rough['discs']} discs"
    yield what, "-", f"{per_lu(rough['step'], rough)[0]} LU", "shown"
    what = "its Newton iteration"
    yield _in_lu(f"{what}, one thread", rough["step"] / rough["newton"], rough, DENSE)
    if rough.get("cores", 1) > 1:
        cores = f"{rough['cores']} threads, wall"
        yield _in_lu(f"{what}, {cores}", rough["wall_threaded"] / rough["newton"], rough, DENSE_ON_TWO)
    share = rough["contact_phases"] / rough["step"]
    yield "contact phases, share of that step", "0.70", f"{share:.2f}", verdict(share, 0.7)
    if smooth is not None and smooth is not rough:
        more = rough["contact_phases"] / smooth["contact_phases"]
        yield "the same with friction over without", "1.5", f"{more:.2f}", verdict(more, 1.5)


def _growth_goals(found: Results) -> Iterator[Line]:
    few = found.reference
    if few is None or found.growth[-1] is few:
        return
    many = [r for r in found.growth if r["discs"] <= LARGE][-1]
    slower = per_point(many) / per_point(few)
    sizes = f"{many['discs']} discs over {few['discs']}"
    yield f"time per point, {sizes}", f"{SLOWER:g}", f"{slower:.2f}", verdict(slower, SLOWER)
    share = many["memory"] / allowed(many)
    what = f"memory of {many['discs']} discs over that allowed"
    yield what, "1", f"{share:.2f}", verdict(share, 1.0)
    largest = found.growth[-1]
    if largest["discs"] >= 10_000:
        memory = largest["memory"] / 1e3
        yield f"memory of {largest['discs']} discs", f"{MEMORY:g} GB", f"{memory:.1f} GB", verdict(memory, MEMORY)


def _large_goals(found: Results) -> Iterator[Line]:
    large = [r for r in found.single if r["unknowns"] >= 1e4]
    if large:
        most = [max(r[name]["iterations"] for name in STEPS) for r in large]
        what = f"amg iterations, {large[0]['unknowns']:.1e}-{large[-1]['unknowns']:.1e} unknowns"
        yield what, "40", f"{min(most)} to {max(most)}", verdict(max(most), 40)


def _memory_goals(found: Results) -> Iterator[Line]:
    r = found.all.get("memory")
    if r is not None:
        more = r["late"] - r["early"]
        what = f"memory, {r['steps']} steps over {r['steps'] // 10} and {r['steps'] // 2}"
        measured = f"{r['late'] / r['early']:.3f}, {r['late'] / r['middle']:.3f}"
        yield what, "1.02", measured, verdict(more, 0.02 * r["early"])


def per_point(result: Result) -> float:
    """Time of a step per point [s]."""
    return float(result["step"] / result["points"])


def allowed(result: Result) -> float:
    """Memory that the goal allows [MB]."""
    return float(PER_DISC * result["discs"] + PER_POINT * result["points"])
