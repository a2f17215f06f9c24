"""How quantities and objects are shown: with prefixed units, in one line, or as a small table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from html import escape
from math import floor, log10
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


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
    scale, name = prefixed(unit, abs(float(f"{value:.3g}")))
    return f"{value / scale:.3g} {name}"


def span(values: NDArray[Any], digits: str) -> str:
    """The range of values as text, or the one that all of them have."""
    low, high = values.min(), values.max()
    return f"{low:{digits}}" if low == high else f"{low:{digits}} to {high:{digits}}"


def line(name: str, facts: Mapping[str, object]) -> str:
    """One line: the name, and pairs of key and value."""
    return f"{name}({', '.join(f'{key} {value}' if key else str(value) for key, value in facts.items())})"


def table(name: str, facts: Mapping[str, object]) -> str:
    """A table in HTML: the name, and rows of key and value."""
    rows = "".join(f"<tr><td>{escape(key)}</td><td>{escape(str(value))}</td></tr>" for key, value in facts.items())
    return f"<table><caption>{escape(name)}</caption>{rows}</table>"


def with_shapes(of: DataclassInstance) -> str:
    """One line for a dataclass: its fields, arrays by their shapes."""
    facts = ", ".join(f"{f.name}={_short(getattr(of, f.name))}" for f in fields(of) if f.repr)
    return f"{type(of).__name__}({facts})"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"<{value.dtype} {value.shape}>"
    if isinstance(value, dict):
        return f"<{', '.join(map(str, value))}>"
    if isinstance(value, tuple) and (len(value) > 3 or any(isinstance(item, np.ndarray) for item in value)):
        return f"<{len(value)} of {type(value[0]).__name__}>"
    return f"{value:.6g}" if isinstance(value, float) else repr(value)
