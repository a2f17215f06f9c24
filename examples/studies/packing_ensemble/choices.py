"""The step, cells and points of the main job: what coarser ones cost, against fine ones and the scatter of packings.

    python -m examples.studies.packing_ensemble choices --out out/steps steps             # 25 minutes
    python -m examples.studies.packing_ensemble choices --out out/resolution resolution -- --discs 100    # an hour

Runs `compaction.py` for each packing with each choice, goes on if stopped, and prints the tables of
`docs/studies/results.md`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from examples import compaction

MEAN_RADIUS = 0.95e-3  # [m]
FINE_STEP = 5.5e-6  # [s], 0.14 cells of the lid at R/h = 12
Choices = dict[str, list[str]]  # options of compaction.py by what a row is called; the first is the reference


def steps() -> Choices:
    """Lengths of steps."""
    return {f"steps of {1e6 * dt:g} us": ["--dt", str(dt)] for dt in (2e-6, 8e-6, 13.3e-6)}


def resolution() -> Choices:
    """Cells and distances of points, in the same steps."""
    pairs = [(12.0, 0.5), *((n, spacing) for n in (3.2, 5.0, 8.0) for spacing in (0.74, 0.5))]
    return {f"R/h = {n:g}, points {spacing:g} h apart": resolved(MEAN_RADIUS / n, spacing) for n, spacing in pairs}


def resolved(cell: float, spacing: float) -> list[str]:
    """The options for a cell [m] and a distance of points [cells]."""
    return ["--cell", f"{cell:.4g}", "--spacing", f"{spacing * cell:.4g}", "--dt", str(FINE_STEP)]


WHAT = {"steps": steps, "resolution": resolution}
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
    choices = WHAT[options.what]()
    reference, *others = (
        [curves(run(options.out, [*chosen, *options.compaction], seed)) for seed in range(options.packings)]
        for chosen in choices.values()
    )
    for line in table(dict(zip([*choices][1:], others, strict=True)), reference):
        print(line)


def table(found: dict[str, list[Curves]], reference: list[Curves]) -> Iterator[str]:
    """The deviations of packings with each choice from the same ones with the reference, and their scatter."""
    yield "| solid fraction | | " + " | ".join(MEASURES) + " |"
    yield "|---" * (2 + len(MEASURES)) + "|"
    for begin, end in RANGES:
        grid = np.linspace(begin, end, 101)
        for name, packings in found.items():
            pairs = list(zip(packings, reference, strict=True))
            cells = [shown(np.concatenate([deviation(*pair, what, grid) for pair in pairs])) for what in MEASURES]
            yield f"| {begin:g} to {end:g} | {name} | " + " | ".join(cells) + " |"
        cells = [scatter(reference, what, grid) for what in MEASURES]
        yield f"| {begin:g} to {end:g} | packings, standard deviation | " + " | ".join(cells) + " |"


def run(out: Path, chosen: list[str], seed: int) -> Path:
    """The directory of a run of the main job, which is not run again."""
    place = place_of(out, chosen, seed)
    if not (place / "stages.png").exists():
        compaction.run(compaction.parser().parse_args([*chosen, "--seed", str(seed), "--out", str(place)]))
    return place


def place_of(out: Path, chosen: list[str], seed: int) -> Path:
    """Where a run is kept, by its options."""
    return out / "_".join([*(word.lstrip("-") for word in chosen), f"seed{seed}"])


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
    options.add_argument("what", choices=[*WHAT], help="what differs between the runs")
    options.add_argument("--out", type=Path, default=Path("out/choices"), help="directory of the runs")
    options.add_argument("--packings", type=int, default=3, help="number of packings, two or more")
    options.add_argument("compaction", nargs="*", help="after --: other options of compaction.py")
    return options
