"""Multiples of units for people to read."""

from __future__ import annotations

from collections.abc import Iterable
from math import floor, log10

UNITS = ("Pa", "m", "s", "m/s", "N/m")
PREFIXES = {-3: "n", -2: "µ", -1: "m", 0: "", 1: "k", 2: "M", 3: "G"}  # by powers of 1000


def prefixed(unit: str, size: float, chosen: Iterable[str] = ()) -> tuple[float, str]:
    """The scale and the name of the multiple of a unit in which `size` is between 1 and 1000: 1e6 and "MPa".

    It is a chosen one if that is a multiple of the unit. Units that are no single symbol, and none, keep their scale.
    """
    for name in chosen:
        if (scale := multiples(unit).get(name.replace("u", "µ"))) is not None:
            return scale, name
    if unit not in UNITS or not 0.0 < size < float("inf"):
        return 1.0, unit
    power = min(max(floor(log10(size) / 3.0 + 1e-9), -3), 3)
    if unit in ("m", "s") and power > 0:
        power = 0
    return 1000.0**power, PREFIXES[power] + unit


def multiples(unit: str) -> dict[str, float]:
    """The multiples of a unit by their names."""
    return {prefix + unit: 1000.0**power for power, prefix in PREFIXES.items() if unit in UNITS}


def quantity(value: float, unit: str) -> str:
    """A value with a prefixed unit, three digits: 8e-6 s is "8 µs"."""
    scale, name = prefixed(unit, abs(value))
    return f"{value / scale:.3g} {name}"
