"""Arguments of functions that count in bins."""

from __future__ import annotations

import reprlib

import numpy as np

from skmpm.scene import SceneError


def check_bins(name: str, bins: object, largest: object, remedy: str) -> None:
    """Raise SceneError unless `bins` is a positive integer and `largest` a positive number."""
    if not isinstance(bins, int | np.integer) or bins < 1:
        raise SceneError(f"{name}: bins = {reprlib.repr(bins)}; give a whole number, 1 or more")
    if not (isinstance(largest, int | float | np.number) and 0.0 < largest < np.inf):
        raise SceneError(f"{name}: largest = {reprlib.repr(largest)}; give {remedy}")
