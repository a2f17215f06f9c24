"""A cloud of material points with its outline, and checks of both."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skmpm.arrays import Array, Ints
from skmpm.outline.topology import chunks, ranges

Names = NDArray[np.str_]

PAIRS = 200_000  # of edges tested for crossing at a time
ROUND = 1e-14  # relative, of products of differences of positions


@dataclass(frozen=True, eq=False, repr=False)
class Points:
    """Material points of one body and, if it has one, its outline.

    `outline` holds closed loops of indices of the points on the boundary, in order: outer loops counter-clockwise,
    holes clockwise; the last point of a loop is joined to its first. Bodies touch at smooth curves through
    the boundary points, with corners where the boundary turns by more than 50 degrees. Arrays are copied and their
    types converted; a `Scene` checks them.

    Parameters
    ----------
    x : positions, (2, n) [m]
    volume : volumes, (n,) [m2]
    outline : closed loops of indices of points, (m,) each
    group : names of the groups of the points, (n,), for a body of several materials (see `Body`); None without groups

    Examples
    --------
    >>> import skmpm
    >>> points = skmpm.disc((0, 0), 1e-3, spacing=2e-4)
    >>> points.x.shape
    (2, 110)
    >>> len(points.outline[0])
    31
    >>> round(float(1e6 * points.volume.sum()), 3)
    3.142
    """

    x: Array
    volume: Array
    outline: tuple[Ints, ...] = ()
    group: Names | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "x", np.array(self.x, dtype=np.float64))
        object.__setattr__(self, "volume", np.array(self.volume, dtype=np.float64))
        object.__setattr__(self, "outline", tuple(_indices(loop) for loop in self.outline))
        if self.group is not None:
            object.__setattr__(self, "group", _names(self.group))

    def __repr__(self) -> str:
        return f"Points({self.size} points, {len(self.outline)} loops)"

    @property
    def size(self) -> int:
        """Number of material points."""
        return int(self.volume.size)

    def placed(self, centre: ArrayLike, angle: float = 0.0, *, about: ArrayLike | None = None) -> Points:
        """Points moved to another place and rotated.

        Parameters
        ----------
        centre : (2,) new centre of their area [m], or place of `about`
        angle : rotation about it, counter-clockwise [rad]
        about : (2,) place [m] that comes to lie at `centre`; the centre of their area by default

        Returns
        -------
        the points there
        """
        middle = np.average(self.x, axis=1, weights=self.volume) if about is None else about
        arm = self.x - np.asarray(middle, dtype=np.float64)[:, None]
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        return replace(self, x=np.asarray(centre, dtype=np.float64)[:, None] + turn @ arm)

    def with_groups(self, group: Callable[[Array], ArrayLike] | ArrayLike) -> Points:
        """The points in groups, of which each may have its own material.

        Parameters
        ----------
        group : (n,) names, or a function of positions (2, n) [m] that returns them, as in
            ``disc(...).with_groups(lambda x: np.where(np.hypot(*x) < R / 2, "core", "shell"))``

        Returns
        -------
        the points in groups

        Raises
        ------
        ValueError
            if these are not n names
        """
        points = replace(self, group=_names(group(self.x.copy()) if callable(group) else group))
        if problem := _check_group(points):
            raise ValueError(f"with_groups: {problem}")
        return points


def _indices(loop: ArrayLike) -> Ints:
    """Indices of points as integers; ValueError if they are no whole numbers."""
    given = np.array(loop)
    with np.errstate(invalid="ignore"):
        whole = given.astype(np.int64)
    if not np.array_equal(whole, given):
        raise ValueError(f"Points: outline has a loop {loop!r}; indices of points are whole numbers")
    return whole


def _names(group: ArrayLike) -> Names:
    """Names as an array of text, if all are texts; anything else as it is, for `check` to refuse."""
    given = np.array(group)
    texts = given.dtype.kind == "O" and all(isinstance(name, str) for name in given.ravel().tolist())
    return cast(Names, given.astype(np.str_) if texts else given)


def check(points: Points) -> str | None:
    """An error message with the value and the remedy; None if `points` are valid."""
    x, volume = points.x, points.volume
    if x.ndim != 2 or x.shape[0] != 2 or x.shape[1] == 0:
        return f"x has shape {x.shape}; give (2, n) with n > 0, components first"
    if volume.shape != x.shape[1:]:
        return f"volume has shape {volume.shape}, x {x.shape}; give one volume per point"
    if not np.isfinite(x).all():
        return f"the position of point {np.argmin(np.isfinite(x).all(axis=0))} is not finite"
    if not (np.isfinite(volume) & (volume > 0)).all():
        worst = np.argmin(np.where(np.isfinite(volume), volume, -np.inf))
        return f"the volume of point {worst} is {volume[worst]:g}; volumes must be finite and > 0"
    if message := _check_group(points):
        return message
    for k, loop in enumerate(points.outline):
        if message := _check_loop(x, loop):
            return f"outline loop {k} {message}"
    return check_crossings(x, points.outline) or _check_orientation(x, points.outline)


def _check_group(points: Points) -> str | None:
    if points.group is None:
        return None
    group, names = points.group, "give one name per point, as np.where(x[0] < 0.0, 'left', 'right')"
    if group.dtype.kind != "U":
        return f"group holds {group.dtype}; {names}"
    if group.shape != (points.size,):
        return f"group has shape {group.shape}, there are {points.size} points; {names}"
    return None


def _check_loop(x: Array, loop: Ints) -> str | None:
    if loop.ndim != 1 or loop.size < 3:
        return f"has shape {loop.shape}; a loop is a list of at least 3 indices of points"
    if loop.min() < 0 or loop.max() >= x.shape[1]:
        return f"has indices from {loop.min()} to {loop.max()}; there are {x.shape[1]} points, numbered from 0"
    if np.unique(loop).size < loop.size:
        return "visits a point twice; it is closed implicitly, do not repeat its first point"
    same = (x[:, np.roll(loop, -1)] == x[:, loop]).all(axis=0)
    if same.any():
        return f"has two consecutive points at the same position (point {loop[same.argmax()]}); merge them"
    return None


def check_crossings(x: Array, outline: Sequence[Ints]) -> str | None:
    """Edges that cross: the ends of each are on opposite sides of the other; or edges of one loop that touch."""
    if not outline:
        return None
    start, end = np.concatenate(outline), np.concatenate([np.roll(loop, -1) for loop in outline])
    a, b, of = x[:, start], x[:, end], np.repeat(np.arange(len(outline)), [loop.size for loop in outline])
    bottom, top = np.minimum(a, b), np.maximum(a, b) + ROUND * np.abs(x).max()
    along = np.ptp(a, axis=1).argmax()
    low, high = bottom[along], top[along]
    number, order = np.arange(start.size), np.argsort(low, kind="stable")
    begun = np.searchsorted(low[order], high[order], side="right")  # edges that begin before each one ends
    count = begun - number - 1
    for part in chunks(count, PAIRS):
        k, j = order[np.repeat(number[part], count[part])], order[ranges(number[part] + 1, count[part])]
        one = _side(a[:, k], b[:, k], a[:, j]) * _side(a[:, k], b[:, k], b[:, j])
        other = _side(a[:, j], b[:, j], a[:, k]) * _side(a[:, j], b[:, j], b[:, k])
        crossed = (one < 0) & (other < 0)
        loop = (of[k] == of[j]) & (start[k] != end[j]) & (end[k] != start[j])
        meet = (bottom[:, k] <= top[:, j]).all(axis=0) & (bottom[:, j] <= top[:, k]).all(axis=0)
        touched = loop & meet & (one <= 0) & (other <= 0)
        if (crossed | touched).any():
            worst = np.argmax(crossed) if crossed.any() else np.argmax(touched)
            k, j = sorted((k[worst], j[worst]))
            edges = f"edges {start[k]}-{end[k]} and {start[j]}-{end[j]} (points)"
            if of[k] != of[j]:
                return f"outline loops {of[k]} and {of[j]} cross: {edges}; move these parts apart"
            if crossed.any():
                return f"the outline crosses itself: {edges}; list the boundary points in order"
            return f"the outline touches itself: {edges}; move its parts apart there"
    return None


def _side(a: Array, b: Array, p: Array) -> Array:
    """+1, 0, -1 where p is to the left of, on (to round-off), to the right of the line from a to b."""
    left, right = (b[0] - a[0]) * (p[1] - a[1]), (b[1] - a[1]) * (p[0] - a[0])
    # Positions of size |x| are known to eps |x|, so the products of their differences to eps |x| |b - a|.
    length = np.abs(b - a).max(axis=0) * np.abs(p).max(initial=0.0)
    side: Array = np.where(np.abs(left - right) <= ROUND * length, 0.0, np.sign(left - right))
    return side


def _check_orientation(x: Array, outline: Sequence[Ints]) -> str | None:
    """Loops inside an even number of others are outer loops and must be counter-clockwise, the others clockwise."""
    for k, loop in enumerate(outline):
        depth = sum(encloses(x[:, other], x[:, loop[0]]) for other in (*outline[:k], *outline[k + 1 :]))
        area, kind = signed_area(x[:, loop]), ("an outer loop", "a hole")[depth % 2]
        if area * (-1) ** depth <= 0:
            order = ("counter-clockwise", "clockwise")[depth % 2]
            apart = ", or keep it out of the others" if depth else ""
            return f"outline loop {k} is {kind} with signed area {area:g}; list its points {order}{apart}"
    return None


def signed_area(x: Array) -> float:
    """Area inside the closed loop x (2, m), positive if counter-clockwise [m2]."""
    y = x - x[:, :1]
    z = np.roll(y, -1, axis=1)
    return float(np.sum(y[0] * z[1] - y[1] * z[0]) / 2)


def encloses(x: Array, p: Array) -> bool:
    """Whether the loop x (2, m) encloses p (2,): parity of the edges crossed by the ray to the right."""
    (a, b), (c, d) = x - p[:, None], np.roll(x, -1, axis=1) - p[:, None]
    crosses = (b > 0) != (d > 0)
    side = (a * d - b * c) * np.sign(d - b)
    return bool(np.count_nonzero(crosses & (side > 0)) % 2)
