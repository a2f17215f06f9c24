"""Figures and page of the shear-cell study from the tables of its members.

python -m examples.studies.shear_cell figures --study out/shear_cell --docs docs/studies

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
from examples.studies.shear_cell import study
from skmpm.sweep import Member

STEADY = study.RAMP + 0.5  # strain from which means are taken
HEAD = ("P / E*", "I", "packings", "μ", "its deviation", "solid fraction", "height [d]", "lid over floor, pressure",
        "lid over floor, shear", "overlap, largest [%]", "steps", "retries", "time [min]")  # fmt: skip


def means(member: Member) -> dict[str, float]:
    """Means over the steady part of a member, weighted with the lengths of steps."""
    columns = member.columns
    late = np.where(columns["strain"] > min(STEADY, 0.5 * columns["strain"][-1]), columns["dt"], 0.0)
    found = {name: float(np.average(values, weights=late)) for name, values in columns.items()}
    each = columns["shear_floor"] / found["pressure_floor"]
    found["ratio"] = found["shear_floor"] / found["pressure_floor"]
    found["deviation"] = float(np.sqrt(np.average((each - found["ratio"]) ** 2, weights=late)))
    return found


def groups(found: skmpm.Sweep) -> dict[tuple[float, float], list[Member]]:
    """Members by pressure and inertial number."""
    out: dict[tuple[float, float], list[Member]] = {}
    for member in found:
        out.setdefault((member.parameters["pressure"], member.parameters["inertial"]), []).append(member)
    return dict(sorted(out.items()))


def line(point: tuple[float, float], members: list[Member]) -> tuple[str, ...]:
    """A row of the table."""
    each = [means(member) for member in members]

    def mean(name: str) -> float:
        return float(np.mean([m[name] for m in each]))

    count = [member.columns["t"].size for member in members]
    return (
        f"{point[0]:g}",
        f"{point[1]:g}",
        f"{len(members)}",
        ", ".join(f"{m['ratio']:.3f}" for m in each),
        f"{mean('deviation'):.2f}",
        f"{mean('solid_fraction'):.3f}",
        f"{mean('height') / study.D:.2f}",
        f"{mean('pressure_lid') / mean('pressure_floor'):.3f}",
        f"{mean('shear_lid') / mean('shear_floor'):.3f}",
        f"{100 * max(float(member.columns['overlap'].max()) for member in members):.2g}",
        f"{np.mean(count):.0f}",
        f"{np.mean([member.columns['retries'].sum() for member in members]):.0f}",
        f"{np.mean([member.columns['seconds'].sum() for member in members]) / 60:.1f}",
    )


def draw(found: skmpm.Sweep, folder: Path) -> None:
    """Friction and solid fraction against the inertial number, profiles of velocity, and the last state of one."""
    figure, axes = plt.subplots(1, 4, figsize=(14, 3.6), layout="constrained", width_ratios=(1, 1, 1, 1.1))
    by_point = groups(found)
    for k, pressure in enumerate(sorted({p for p, _ in by_point})):
        numbers = sorted(number for p, number in by_point if p == pressure)
        for axis, name in zip(axes, ("ratio", "solid_fraction"), strict=False):
            each = [[means(m)[name] for m in by_point[pressure, number]] for number in numbers]
            axis.semilogx(numbers, [np.mean(e) for e in each], "-", color=f"C{k}", label=f"P / E* = {pressure:g}")
            for number, values in zip(numbers, each, strict=True):
                axis.plot([number] * len(values), values, "o", color=f"C{k}", ms=3)
        for number in numbers:
            profiles = [[means(m)[f"layer_{i}"] for i in range(study.LAYERS)] for m in by_point[pressure, number]]
            place = (np.arange(study.LAYERS) + 0.5) / study.LAYERS
            axes[2].plot(np.mean(profiles, axis=0), place, color=f"C{k}", alpha=0.3 + 0.7 * number / max(numbers))
    axes[0].set(xlabel="inertial number", title="shear stress over pressure")
    axes[0].legend()
    axes[1].set(xlabel="inertial number", title="solid fraction")
    axes[2].set(xlabel="mean velocity over that of the lid", title="place over the height", xlim=(0.0, 1.0))
    first = next(iter(found))
    about = {key: first.parameters[key] for key in ("discs", "pressure", "inertial", "friction", "seed")}
    skmpm.plot(study.scene(**about)[0], first.state(), "speed", forces=True, axes=axes[3])
    axes[3].axis("off")
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "shear_cell.png", dpi=110)
    plt.close(figure)


def tables(found: skmpm.Sweep) -> dict[str, str]:
    """The parts of the page that are made of the members."""
    return {"members": table(HEAD, [line(*group) for group in groups(found).items()])}


def write(out: Path, docs: Path) -> None:
    """Draw the figure and fill the page; SystemExit if no member has finished."""
    sweeps.write(out, docs, "shear_cell", draw, tables)


def main(options: argparse.Namespace) -> None:
    """Draw the figure and fill the page."""
    write(options.study, options.docs)


def parser() -> argparse.ArgumentParser:
    """Options."""
    return parser_of_figures(__doc__, Path("out/shear_cell"))
