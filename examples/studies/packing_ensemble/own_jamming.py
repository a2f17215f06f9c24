"""From which jamming point coordination grows with the root of the solid fraction: the first one, or one's own.

    python -m examples.studies.packing_ensemble own_jamming    # 15 minutes

Frictionless discs in a periodic box are compressed by static steps to their jamming point, and from there to a
series of pressures. A packing rearranges on the way. So each is also released to the jamming point that it has now
(O'Hern, Silbert, Liu & Nagel, Phys. Rev. E 68 (2003) 011306, measure the distance from that one). The table of
`docs/studies/packing_ensemble.md` is printed.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import skmpm

from .curves import mean
from .scenes import PLANE, build, options_of

PRESSURES = (3e-4, 1e-3, 2.2e-3, 4.5e-3, 1e-2)  # over E*
START = 0.79  # solid fraction, the same nominal and by outlines where discs do not touch


@dataclass(frozen=True)
class Point:
    """A packing under a pressure: its distances from jamming in solid fraction, and Z - Z_J of both."""

    first: float
    own: float
    excess: float

    def over_roots(self) -> tuple[float, float]:
        """(Z - Z_J) over the roots of the distances."""
        return self.excess / np.sqrt(self.first), self.excess / np.sqrt(self.own)


def loose(discs: int, seed: int) -> skmpm.Scene:
    """Discs as in the main job in a periodic square, below jamming."""
    return build(options_of({"discs": discs, "seed": seed, "start": START, "friction": 0.0, "periodic": True}))[0]


def measured(scene: skmpm.Scene, pressures: tuple[float, ...] = PRESSURES) -> Iterator[Point]:
    """The packing under each pressure over E*, one after the other."""
    jammed = skmpm.jam(scene, tolerance=1e-5)
    found = jammed
    for pressure in pressures:
        found = skmpm.jam(found.scene, found.state, pressure=pressure * PLANE)
        released = skmpm.jam(found.scene, found.state, tolerance=1e-5)
        excess = found.coordination - isostatic(found)
        yield Point(
            found.solid_fraction - jammed.solid_fraction, found.solid_fraction - released.solid_fraction, excess
        )


def isostatic(packing: skmpm.Jam) -> float:
    """The least coordination of N discs at rest in a periodic box, 4 - 2 / N, without rattlers."""
    return 4.0 - 2.0 / float(np.count_nonzero(~packing.rattlers))


def table(found: list[list[Point]]) -> Iterator[str]:
    """Means of the packings with standard errors, and the exponents."""
    yield "| P / E* | from the first | from its own | Z - Z_J | over root, first | over root, own |"
    yield "|---" * 6 + "|"
    for pressure, points in zip(PRESSURES, zip(*found, strict=True), strict=True):
        columns = np.array([[p.first, p.own, p.excess, *p.over_roots()] for p in points]).T
        yield f"| {pressure:g} | " + " | ".join(map(shown, columns)) + " |"
    for name in ("first", "own"):
        yield f"exponent from {name}: " + shown(np.array([exponent(points, name) for points in found]))


def exponent(points: list[Point], name: str) -> float:
    """Of Z - Z_J over the distance of this name."""
    x, y = ([getattr(point, column) for point in points] for column in (name, "excess"))
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def shown(values: np.ndarray) -> str:
    """Mean and standard error."""
    value, error = mean(values)
    return f"{value:.3g} ± {error:.1g}"


def main(options: argparse.Namespace) -> None:
    """Measure all packings, and print the table."""
    found = [[*measured(loose(options.discs, seed))] for seed in range(options.packings)]
    for line in table(found):
        print(line)


def parser() -> argparse.ArgumentParser:
    """The options."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--discs", type=int, default=60, help="in a packing")
    options.add_argument("--packings", type=int, default=6, help="two or more")
    return options
