"""What `packing` refuses before it begins: arguments, boxes without room, solid fractions at which discs jam."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from skmpm.arrays import Array
from skmpm.packing.discs import Box
from skmpm.values import SceneError

HEXAGONAL, SQUARE = np.pi / np.sqrt(12.0), np.pi / 4.0  # solid fractions of lattices of equal discs
# Solid fraction at which many equal discs jam, layer that a wall costs [mean radius], and excess of the densest
# of 500 packings, times the root of the number of discs; in narrower boxes lattices may fit [mean radius].
JAMMED, LAYER, EXCESS, NARROW = 0.84, 0.3, 0.35, 8.0


class PackingError(ValueError):
    """The discs or shapes cannot be packed with the requested solid fraction or box.

    Examples
    --------
    >>> import skmpm
    >>> try:
    ...     skmpm.packing([1e-3, 1e-3], width=5e-3, solid_fraction=0.99)
    ... except skmpm.PackingError as error:
    ...     print(str(error))
    solid_fraction 0.99 must lie between 0 and 0.9069; discs jam near 0.84
    """


def number(check: Callable[..., float], name: str, value: object, what: str) -> float:
    """The value by a check of `skmpm.values`; PackingError if it fails."""
    try:
        return check(name, value, what)
    except SceneError as error:
        raise PackingError(str(error)) from None


def radii(shapes: object) -> Array:
    """Radii of discs; PackingError for anything that is neither numbers nor a list of `Points`."""
    try:
        return np.array(shapes, dtype=float)
    except (TypeError, ValueError):
        what = type(shapes).__name__
        if isinstance(shapes, Sequence):
            kinds = dict.fromkeys(type(shape).__name__ for shape in shapes)
            what = f"a list of {' and '.join(kinds)}"
        raise PackingError(f"shapes: expected radii in metres, or a list of skmpm.Points, got {what}") from None


def check_bodies(R: Array, solid_fraction: float, most: float) -> None:
    """Raise PackingError unless radii (N,) [m] are above zero, and a solid fraction between zero and the densest."""
    if R.ndim != 1 or not R.size or not np.isfinite(R).all() or R.min() <= 0.0:
        bad = R[~(R > 0.0) | np.isinf(R)]
        found = f"radius {bad[0]:g} m" if bad.size else f"an array of shape {R.shape}"
        raise PackingError(f"radii: {found}; give an array (N,) of finite numbers above zero")
    if not 0.0 < solid_fraction < most:
        raise PackingError(
            f"solid_fraction {solid_fraction:g} must lie between 0 and {most:.4g}; discs jam near 0.84"
        )


def check_room(box: Box, unit: float, thick: float, kind: str) -> None:
    """Raise PackingError if a body is as thick as the box [mean radius], of which a unit is so many metres."""
    if thick >= box.size.min():
        size, bodies = " x ".join(f"{unit * side:.4g}" for side in box.size), f"{kind} is {unit * thick:.4g} m thick"
        raise PackingError(
            f"the box is {size} m, the largest {bodies}; change the width, lower solid_fraction or use more {kind}s"
        )


def check_reachable(R: Array, box: Box, solid_fraction: float) -> None:
    """Raise PackingError if discs of radii R (N,) [mean radius] between walls will jam below a solid fraction.

    Boxes in which lattices may fit are tried: periodic and narrow ones, and all up to the fraction of a square one.
    """
    jam = jams_at(R, box)
    fit = box.periodic.any() or box.size.min() < NARROW or solid_fraction <= SQUARE
    if not fit and solid_fraction > jam + EXCESS / np.sqrt(R.size):
        raise PackingError(
            f"{R.size} discs between walls jam at a solid fraction of about {jam:.2f}, below the requested"
            f" {solid_fraction:g}; lower solid_fraction, {denser(box)}"
        )


def denser(box: Box) -> str:
    """How to reach a higher solid fraction."""
    return ("" if box.periodic.all() else "use periodic=True, ") + "or compress soft bodies further by moving walls"


def jams_at(R: Array, box: Box) -> float:
    """Estimate the solid fraction at which discs of radii R (N,) [mean radius] jam in a box.

    The more their radii vary, the more small discs fill the pores between large ones.
    """
    spread = float(R.var())
    jam = JAMMED + JAMMED * (1.0 - JAMMED) * spread / (1.0 + spread)
    return jam * float(np.prod((1.0 - 2.0 * LAYER / box.size)[~box.periodic]))
