"""Points that are composed of others: rows of grains or teeth as rough walls, frames, funnels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import Array, Ints
from skmpm.points.cloud import Points
from skmpm.values import vector


def joined(parts: Sequence[Points]) -> Points:
    """Points of all parts as those of one body, as of a funnel or a frame of `Rigid` bars.

    Parts may not overlap. They are for a `Rigid` body, which moves as one; a deformable body has one piece, as from a
    mesh (`from_mesh`).

    Parameters
    ----------
    parts : one or more; if one has groups, all have

    Returns
    -------
    points and outlines of all parts

    Raises
    ------
    ValueError
        if there is no part, or some have groups and some have none

    Examples
    --------
    >>> import skmpm
    >>> left = skmpm.box((-3e-3, 0), (2e-3, 5e-4), spacing=2e-4)
    >>> right = skmpm.box((1e-3, 0), (2e-3, 5e-4), spacing=2e-4)
    >>> gate = skmpm.Body(skmpm.joined([left, right]), skmpm.Rigid(2000.0), motion=(0, 0, 0))
    >>> len(gate.points.outline)
    2
    """
    every = list(parts) if isinstance(parts, Sequence) else []
    if not every or not all(isinstance(part, Points) for part in every):
        raise ValueError(f"joined: {parts!r} is not a list of Points; give one or more, as [disc(...), box(...)]")
    named = [part.group is not None for part in every]
    if any(named) and not all(named):
        raise ValueError(f"joined: part {named.index(False)} has no groups, others have; give all of them groups")
    starts = np.append(0, np.cumsum([part.size for part in every]))
    loops: list[Ints] = [loop + start for part, start in zip(every, starts, strict=False) for loop in part.outline]
    group = np.concatenate([part.group for part in every if part.group is not None]) if all(named) else None
    x: Array = np.concatenate([part.x for part in every], axis=1)
    return Points(x, np.concatenate([part.volume for part in every]), tuple(loops), group)


def row(part: Points, count: int, step: ArrayLike) -> Points:
    """Points of several copies of a part in a row as those of one `Rigid` body, a rough wall.

    Parameters
    ----------
    part : the first of them, as a disc or a tooth
    count : number of copies
    step : (2,) from each to the next [m]

    Returns
    -------
    points and outlines of all copies

    Raises
    ------
    ValueError
        if the part is no Points, count is not a positive integer, or the step is not a finite vector other than zero

    Examples
    --------
    A rough lid of grains that is drawn along a periodic cell, and settles under a load:

    >>> import skmpm
    >>> grains = skmpm.row(skmpm.disc((5e-4, 8e-3), 4.8e-4, spacing=1.5e-4), count=8, step=(1e-3, 0))
    >>> lid = skmpm.Body(grains, skmpm.Rigid(1000.0), motion=(0.1, None, 0))
    >>> len(lid.points.outline)
    8
    """
    if not isinstance(part, Points):
        raise ValueError(f"row: part is a {type(part).__name__}; give Points, as disc(...)")
    if not (isinstance(count, int | np.integer) and count >= 1):
        raise ValueError(f"count is {count!r}; give an integer of one or more")
    apart = vector("step", step)[:, None]
    if not apart.any():
        raise ValueError(
            f"step is {step!r}; give the vector from each copy to the next, so long that they do not overlap"
        )
    return joined([replace(part, x=part.x + k * apart) for k in range(int(count))])
