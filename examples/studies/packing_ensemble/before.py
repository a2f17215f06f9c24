"""The curves of the study before beside those of now: a file, and a figure.

`curves_before.csv` is what the page was made of before: four packings at 2 m/s (`mu0_seed0` ...), one under a lid at
0.5 m/s, and the mode of Nezamabadi et al. (2017), run without mean dilatation and with an earlier contact solver.
"""

from __future__ import annotations

import csv
from collections import defaultdict
from pathlib import Path

import numpy as np

from .claims import figure
from .curves import EARLY, PHI, Array, Study, mean
from .drawing import COLOURS, FRACTION, Figure, band, line, panels
from .scenes import PLANE

BEFORE = "curves_before.csv"
AT = (0.80, 0.85, 0.90, 0.95)
MEASURES = {
    "pressure": "P / E*",
    "coordination": "Z",
    "contact_surface": "S",
    "anisotropy": "A_m",
    "aspect_ratio": "alpha",
}
UNITS = {"pressure": 1.0 / PLANE}
FRICTIONS = (0.0, 0.5)
Curves = dict[str, dict[str, Array]]


def read(path: Path) -> Curves:
    """Measures on `EARLY` by member; nothing without the file."""
    if not path.exists():
        return {}
    found: Curves = defaultdict(lambda: {name: np.full(EARLY.size, np.nan) for name in MEASURES})
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            at = int(np.argmin(np.abs(EARLY - float(row["solid_fraction"]))))
            for name in MEASURES:
                found[row["member"]][name][at] = float(row[name])
    return dict(found)


def curve(before: Curves, friction: float, name: str) -> tuple[Array, Array]:
    """Mean and standard error of the packings at 2 m/s on `PHI`."""
    samples = [
        each[name][-PHI.size :] for member, each in before.items() if member.startswith(f"mu{friction:g}_seed")
    ]
    return mean(np.array(samples).reshape(-1, PHI.size))


def lines(before: Curves, found: Study) -> list[tuple[str, ...]]:
    """A table of before, now at 2 m/s and now quasi-static at some solid fractions, each with its standard error."""
    names = ("before_2m_s", "now_2m_s", "now_quasistatic")
    head = ("measure", "friction", "solid_fraction", *(f"{n}{end}" for n in names for end in ("", "_error")))
    result, at = [(*head, "change_2m_s_percent")], np.searchsorted(PHI, np.array(AT) - 1e-9)
    for name, label in MEASURES.items():
        unit, digits = UNITS.get(name, 1.0), 2 if name == "coordination" else 4
        for friction in FRICTIONS:
            sides = [curve(before, friction, name)]
            sides += [found.curve(kind, friction, name) for kind in ("fast", "quasistatic")]
            for k in at:
                both = [figure(unit * each[k], digits=digits) for side in sides for each in side]
                changed = change(sides[0][0][k], sides[1][0][k])
                result.append((label, f"{friction:g}", f"{PHI[k]:.2f}", *both, changed))
    return result


def change(old: float, new: float) -> str:
    """By how much the packings at 2 m/s differ now [%]."""
    return f"{100.0 * (new / old - 1.0):+.1f}" if np.isfinite(old) and np.isfinite(new) and old != 0.0 else "-"


def drawn(before: Curves, found: Study) -> Figure | None:
    """All measures, before dashed."""
    if not before or not any(found.seeds(kind, mu) for kind in ("fast", "quasistatic") for mu in FRICTIONS):
        return None
    image, (axes,) = panels(1, len(MEASURES), 3.1, 3.2)
    for axis, (name, label) in zip(axes, MEASURES.items(), strict=True):
        unit = UNITS.get(name, 1.0)
        for mu in FRICTIONS:
            band(axis, found, "fast", mu, name, unit, label=rf"$\mu$ = {mu:g}, now")
            line(axis, found, "quasistatic", mu, name, ":", unit, linewidth=1.1)
            old, _ = curve(before, mu, name)
            axis.plot(PHI, unit * old, COLOURS[mu], linestyle="--", linewidth=1.1, label=rf"$\mu$ = {mu:g}, before")
        axis.set(xlabel=FRACTION, title=label.replace("alpha", r"$\alpha$").replace("A_m", "$A_m$"))
    axes[0].legend(fontsize=8)
    return image
