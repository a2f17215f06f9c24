"""Figure and page of the shear study from the tables of its members.

python -m examples.studies.periodic_shear figures --study out/shear --docs docs/studies

Both are those of docs/studies; nothing is run.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import skmpm
from examples.studies import sweeps
from examples.studies.pages import parser_of_figures, table
from examples.studies.periodic_shear import study
from skmpm.sweep import Member

STEADY = 0.2  # strain from which means are taken
WINDOW = 0.01  # strain over which the curves of the figure are averaged
HEAD = ("member", "steps", "retries", "μ* at most", "μ* mean", "its deviation", "Φ at first", "Φ mean", "Z mean",
        "vertical stress off P", "kinetic / elastic, median", "wall time")  # fmt: skip
Columns = dict[str, np.ndarray]


def sheared(member: Member) -> Columns:
    """The columns of the third stage."""
    last = member.columns["stage"] == 2
    return {name: column[last] for name, column in member.columns.items()}


def smooth(strain: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Means over the steps within half a window: steps are short where the packing rearranges."""
    weight = np.diff(strain, prepend=0.0)
    summed = np.concatenate([[0.0], np.cumsum(weight * values)]), np.concatenate([[0.0], np.cumsum(weight)])
    begin, end = (np.searchsorted(strain, strain + half) for half in (-WINDOW / 2.0, WINDOW / 2.0))
    first, last = np.minimum(begin, strain.size - 1), np.minimum(end + 1, strain.size)
    return (summed[0][last] - summed[0][first]) / (summed[1][last] - summed[1][first])


def line(member: Member) -> tuple[str, ...]:
    """A row of the table of members; means are weighted with the strain of their steps."""
    found, about = sheared(member), member.parameters
    strain, ratio = found["strain"], found["shear"] / found["vertical"]
    weight = np.where(strain > min(STEADY, strain[-1] / 2.0), np.diff(strain, prepend=0.0), 0.0)

    def mean(values: np.ndarray) -> float:
        return float(np.average(values, weights=weight))

    still = np.median(np.abs(found["vertical"] / about["confining"] - 1.0))
    return (
        f"{about['discs']} discs, friction {about['friction']}, seed {about['seed']}",
        f"{strain.size}",
        f"{found['retries'].sum():.0f}",
        f"{smooth(strain, ratio).max():.2f}",
        f"{mean(ratio):.2f}",
        f"{np.sqrt(mean((ratio - mean(ratio)) ** 2)):.2f}",
        f"{found['solid_fraction'][0]:.4f}",
        f"{mean(found['solid_fraction']):.4f}",
        f"{mean(found['coordination_without_rattlers']):.2f}",
        f"{100 * still:.2g} %",
        f"{np.median(found['kinetic'] / found['elastic']):.0e}",
        f"{member.columns['seconds'].sum() / 60:.0f} min",
    )


def draw(found: skmpm.Sweep, folder: Path) -> None:
    """Friction and solid fraction over the strain, and the last state of the first member."""
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.6), layout="constrained", width_ratios=(1, 1, 1.2))
    for k, member in enumerate(found):
        columns, about = sheared(member), member.parameters
        strain, name = columns["strain"], f"friction {about['friction']}, seed {about['seed']}"
        ratio = columns["shear"] / columns["vertical"]
        axes[0].plot(strain, ratio, color=f"C{k}", lw=0.4, alpha=0.5)
        axes[0].plot(strain, smooth(strain, ratio), color=f"C{k}", label=name)
        axes[1].plot(strain, columns["solid_fraction"], color=f"C{k}")
    axes[0].set(xlabel="shear strain", title="shear stress over vertical stress")
    axes[0].legend()
    axes[1].set(xlabel="shear strain", title="solid fraction")
    first = next(iter(found))
    about = {key: first.parameters[key] for key in ("discs", "friction", "confining", "seed")}
    skmpm.plot(study.stages(**about)[-1], first.state(), forces=True, axes=axes[2])
    axes[2].axis("off")
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "shear.png", dpi=110)
    plt.close(figure)


def tables(found: skmpm.Sweep) -> dict[str, str]:
    """The parts of the page that are made of the members."""
    return {"members": table(HEAD, [line(member) for member in found])}


def write(out: Path, docs: Path) -> None:
    """Draw the figure and fill the page; SystemExit if no member has finished."""
    sweeps.write(out, docs, "periodic_shear", draw, tables)


def main(options: argparse.Namespace) -> None:
    """Draw the figure and fill the page."""
    write(options.study, options.docs)


def parser() -> argparse.ArgumentParser:
    """Options."""
    return parser_of_figures(__doc__, Path("out/shear"))
