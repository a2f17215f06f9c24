"""The step of the main job: what longer steps cost, against steps of 2 us and against the scatter of packings.

    python -m examples.studies.packing_ensemble steps --out out/steps    # 25 minutes; goes on if stopped

Runs `compaction.py` for each packing with each step, and prints the table of `docs/studies/results.md`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from examples import compaction

STEPS = {2e-6: "2 us", 8e-6: "8 us", 13.3e-6: "13.3 us"}  # the first is the reference
RANGES = ((0.78, 0.86), (0.86, 0.945))  # nominal solid fractions
MEASURES = {
    "P": ("pressure", 0.0),
    "S": ("contact_surface", 0.0),
    "Z": ("coordination", 0.0),
    "alpha - 1": ("aspect_ratio", 1.0),
}
Curves = dict[str, np.ndarray]


def main(options: argparse.Namespace) -> None:
    """Run what is missing, and print the table."""
    packings = range(options.packings)
    runs = {(dt, seed): curves(run(options.out, dt, seed, options.compaction)) for seed in packings for dt in STEPS}
    print("| solid fraction | | " + " | ".join(MEASURES) + " |")
    print("|---" * (2 + len(MEASURES)) + "|")
    for begin, end in RANGES:
        grid = np.linspace(begin, end, 101)
        for dt in list(STEPS)[1:]:
            pairs = [(runs[dt, seed], runs[min(STEPS), seed]) for seed in packings]
            cells = [shown(np.concatenate([deviation(*pair, name, grid) for pair in pairs])) for name in MEASURES]
            print(f"| {begin:g} to {end:g} | steps of {STEPS[dt]} | " + " | ".join(cells) + " |")
        cells = [scatter([runs[min(STEPS), seed] for seed in packings], name, grid) for name in MEASURES]
        print(f"| {begin:g} to {end:g} | packings, standard deviation | " + " | ".join(cells) + " |")


def run(out: Path, dt: float, seed: int, arguments: list[str]) -> Path:
    """The directory of a run of the main job, which goes on with what is there."""
    place = out / f"{1e6 * dt:g}us_seed{seed}"
    if not (place / "stages.png").exists():
        chosen = ["--dt", str(dt), "--seed", str(seed), "--out", str(place), *arguments]
        compaction.run(compaction.parser().parse_args(chosen))
    return place


def curves(place: Path) -> Curves:
    """The columns of the table of a run."""
    table = compaction.read(place / "observables.csv")
    names = ("solid_fraction_nominal", *(name for name, _ in MEASURES.values()))
    return {name: np.array([float(line[name]) for line in table]) for name in names}


def at(found: Curves, name: str, grid: np.ndarray) -> np.ndarray:
    """A measure at nominal solid fractions (n,), less its value in a packing without contacts."""
    column, nothing = MEASURES[name]
    return np.interp(grid, found["solid_fraction_nominal"], found[column]) - nothing


def deviation(found: Curves, reference: Curves, name: str, grid: np.ndarray) -> np.ndarray:
    """Relative deviations (n,) [%]."""
    return 100.0 * (at(found, name, grid) / at(reference, name, grid) - 1.0)


def shown(deviations: np.ndarray) -> str:
    """Mean and root mean square of deviations."""
    return f"{deviations.mean():+.1f} / {np.sqrt((deviations**2).mean()):.1f} %"


def scatter(packings: list[Curves], name: str, grid: np.ndarray) -> str:
    """Standard deviation of packings over their mean, root mean square over the solid fractions."""
    values = np.array([at(each, name, grid) for each in packings])
    relative = values.std(axis=0, ddof=1) / values.mean(axis=0)
    return f"{100.0 * np.sqrt((relative**2).mean()):.1f} %"


def parser() -> argparse.ArgumentParser:
    """The options."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/steps"), help="directory of the runs")
    options.add_argument("--packings", type=int, default=3, help="number of packings, two or more")
    options.add_argument("compaction", nargs="*", help="after --: other options of compaction.py")
    return options
