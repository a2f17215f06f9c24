"""The end of a verified range, and comparisons with it."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, floor, log10
from typing import NamedTuple

LIMIT_TOLERANCE = 1e-9  # relative excess over a limit that is round-off


class Limit(NamedTuple):
    """The end of a verified range, and the reason for it."""

    value: float
    where: str


def above(value: float, limit: Limit) -> bool:
    """Whether a value exceeds a limit by more than round-off."""
    return value > limit.value * (1.0 + LIMIT_TOLERANCE)


def below(value: float, limit: Limit) -> bool:
    """Whether a value falls below a limit by more than round-off."""
    return value < limit.value * (1.0 - LIMIT_TOLERANCE)


def rounded_down(value: float) -> str:
    """Two digits, rounded down, so that a value that follows the advice causes no warning."""
    return _two_digits(value, floor)


def rounded_up(value: float) -> str:
    """Two digits, rounded up."""
    return _two_digits(value, ceil)


def _two_digits(value: float, whole: Callable[[float], int]) -> str:
    unit = 10.0 ** (floor(log10(value)) - 1)
    return f"{whole(value / unit) * unit:.2g}"
