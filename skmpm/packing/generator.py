"""Initial packings of rigid shapes: growth in a box, each step solved by the contact solver of the library."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import Array, Bools
from skmpm.linear.solver import one_thread
from skmpm.packing import checks, discs, shapes
from skmpm.packing.checks import PackingError
from skmpm.points import Points
from skmpm.values import LENGTH, not_negative, positive

_GROWTH = 0.04  # largest and smallest growth per step; where the smallest is too large the discs are jammed
_LEAST_GROWTH = 2e-4
_EASE, _DENSE = 1.12, 0.78  # growth of the solid fraction beyond the requested one, up to a dense packing
# Discs placed in all attempts together: of 40 single attempts at a solid fraction of 0.7, 35 jam with 6 discs, 17
# with 12, none with 20 or more.
_ATTEMPTED_DISCS = 250
_ATTEMPTED_SHAPES = 20  # slower, and few shapes jam less than few discs
_SHAKES = 4  # random displacements to leave a jammed state ...
_SHAKE = 0.05  # ... and their size [mean radius]


@dataclass(frozen=True, eq=False)
class Packing:
    """Discs or other shapes in the box [0, width] x [0, height], which may be periodic in one direction or both.

    Attributes
    ----------
    centres : (2, N) centres of area [m]; in a periodic box they may lie outside of it
    radii : (N,) radii [m]; of other shapes those of discs of the same area
    width : width of the box [m]
    height : height of the box, by the solid fraction [m]
    angles : (N,) rotations of the shapes that were given, counter-clockwise [rad]; zeros for discs
    points : the points of the shapes where they lie, for `Body`; empty for discs

    Examples
    --------
    >>> import skmpm
    >>> shapes = [skmpm.ellipse((0, 0), (2e-3, 1e-3), spacing=3e-4) for _ in range(3)]
    >>> result = skmpm.packing(shapes, width=1e-2, solid_fraction=0.4)
    >>> len(result.points)
    3
    >>> result.radii.round(6).tolist()
    [0.001414, 0.001414, 0.001414]
    >>> round(1e3 * result.height, 3)
    4.712

    Concave grains are packed in their convex hulls, and placed about the centres of area of these:

    >>> import numpy as np
    >>> from scipy.spatial import ConvexHull
    >>> t = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    >>> bean = 1e-3 * np.stack([1.5 * np.cos(t), 0.5 * np.sin(t) + np.cos(t) ** 2])
    >>> grain = skmpm.from_outline(bean, spacing=2e-4)
    >>> hull = skmpm.from_outline(bean[:, ConvexHull(bean.T).vertices], spacing=2e-4)
    >>> result = skmpm.packing([hull] * 3, width=6e-3, solid_fraction=0.4)
    >>> about = np.average(hull.x, axis=1, weights=hull.volume)
    >>> grains = [grain.placed(c, a, about=about) for c, a in zip(result.centres.T, result.angles)]
    """

    centres: Array
    radii: Array
    width: float
    height: float
    angles: Array
    points: tuple[Points, ...] = ()


def packing(
    shapes: ArrayLike | Sequence[Points],
    width: float,
    *,
    solid_fraction: float = 0.70,
    friction: float = 0.0,
    periodic: bool | Sequence[bool] = False,
    seed: int = 0,
) -> Packing:
    """Pack rigid discs or other convex shapes at random, without overlap, in a box of given width and fraction.

    Parameters
    ----------
    shapes : radii of discs (N,) [m], or a list of `Points` with convex outlines: ellipses, capsules, polygons, ...,
        or convex hulls of concave grains (see `Packing`)
    width : width of the box [m]
    solid_fraction : area of the bodies over that of the box, from which its height follows
    friction : coefficient between bodies during packing, zero at the walls; it lowers the solid fraction at jamming
    periodic : whether the box is periodic (`Periodic(width, height)`) and not closed by walls; or a pair, for its
        width and its height, as ``(True, False)`` for `Periodic(width, None)` between a floor and a lid
    seed : seed of the random numbers; the same seed gives the same packing in any unit of length

    Returns
    -------
    centres and radii, or angles and points of the shapes where they lie, and the size of the box

    Raises
    ------
    PackingError
        if an argument is invalid, or if the bodies jam at a lower solid fraction, which the message contains. Discs
        jam near 0.84 in a periodic box, and between walls, which cost a layer of 0.3 mean radii, at 0.73, 0.76, 0.79
        and 0.81 of a square box for 20, 40, 100 and 300 of them; far larger solid fractions are refused at once

    Notes
    -----
    Centres, and angles of shapes other than discs, are drawn at random and the sizes grow from small to full
    (Lubachevsky & Stillinger, J. Stat. Phys. 60 (1990) 561-583), but without inertia: in every step the bodies make
    the smallest mass-weighted motion that opens all gaps to first order, which is a Signorini-Coulomb problem. Discs
    do not overlap after that motion, because the linearised distance is a lower bound of the distance; for shapes
    that turn it is repeated until they do not (`packing.shapes`). A jammed state is perturbed at random, and
    packings of few bodies are restarted from other centres, before it is accepted as such. Mixtures of ellipses,
    capsules and polygons jam at 0.79 to 0.81; they take longer than discs, 60 of them ten seconds.

    Examples
    --------
    >>> import skmpm
    >>> discs = skmpm.packing([1e-3] * 4, width=5e-3, solid_fraction=0.5)
    >>> discs.centres.shape
    (2, 4)
    >>> round(1e3 * discs.height, 3)
    5.027
    >>> material = skmpm.NeoHookean(E=1e6, nu=0.3, density=1000)
    >>> bodies = [skmpm.Body(skmpm.disc(x, 1e-3, spacing=2e-4), material) for x in discs.centres.T]
    >>> len(bodies)
    4
    """
    along = np.asarray(periodic)
    if along.dtype != np.bool_ or along.shape not in ((), (2,)):
        raise PackingError(f"periodic = {periodic!r}: give True, False, or two of them, for width and height")
    along = np.broadcast_to(along, 2)
    width = checks.number(positive, "width", width, LENGTH)
    given = {"solid_fraction": solid_fraction, "friction": friction}
    solid_fraction, friction = (checks.number(not_negative, *each, "a finite number") for each in given.items())
    if isinstance(shapes, Sequence) and len(shapes) and all(isinstance(shape, Points) for shape in shapes):
        return _of_shapes(shapes, width, solid_fraction, friction, along, seed)  # type: ignore[arg-type]
    R = checks.radii(shapes)
    checks.check_bodies(R, solid_fraction, most=checks.HEXAGONAL)
    unit = R.mean()
    scaled = np.round(R / unit, 10)  # so that rounding in other units of length cannot change the packing
    height = float(np.pi * (R**2).sum() / (width * solid_fraction))
    box = discs.Box(np.round([width / unit, height / unit], 10), along)
    checks.check_room(box, unit, 2.0 * scaled.max(), "disc")
    checks.check_reachable(scaled, box, solid_fraction)
    rng = np.random.default_rng(seed)

    def move(x: Array, size: float, tolerance: float) -> Array | None:
        return discs.separate(x, size * scaled, box, friction, tolerance)

    attempts = 1 + _ATTEMPTED_DISCS // R.size
    x = _attempt(lambda: discs.scatter(scaled, box, rng), move, attempts, solid_fraction, rng, box, "discs")
    return Packing(x * unit, R, width, height, np.zeros(R.size))


def _of_shapes(
    clouds: Sequence[Points], width: float, solid_fraction: float, friction: float, periodic: Bools, seed: int
) -> Packing:
    """A packing of shapes: positions and angles (3, N)."""
    area = np.array([cloud.volume.sum() for cloud in clouds])
    R = np.sqrt(area / np.pi)
    checks.check_bodies(R, solid_fraction, most=1.0)
    unit = R.mean()
    try:
        forms = shapes.shapes_of(clouds, unit)
    except ValueError as error:
        raise PackingError(f"shapes: {error}") from error
    height = float(area.sum() / (width * solid_fraction))
    rng, box = np.random.default_rng(seed), discs.Box(np.round([width / unit, height / unit], 10), periodic)
    checks.check_room(box, unit, 2.0 * forms.inside.max(), "shape")
    if box.size[periodic].min(initial=np.inf) < 4.0 * forms.reach.max():
        raise PackingError(
            f"the periodic box is {width:g} x {height:g} m, less than twice the largest shape, which is up to"
            f" {2.0 * forms.reach.max() * unit:.4g} m long; change the width, lower solid_fraction or use more shapes"
        )

    def start() -> Array:
        return np.vstack([discs.scatter(forms.radius, box, rng), rng.uniform(0.0, 2.0 * np.pi, R.size)])

    separate = partial(shapes.separate, forms, box=box, friction=friction)
    attempts = 1 + _ATTEMPTED_SHAPES // R.size
    x = _attempt(start, separate, attempts, solid_fraction, rng, box, "shapes")
    centres = x[:2] * unit
    points = tuple(cloud.placed(c, angle) for cloud, c, angle in zip(clouds, centres.T, x[2].tolist(), strict=True))
    return Packing(centres, R, width, height, x[2], points)


Separate: TypeAlias = Callable[..., Array | None]  # x, size=, tolerance= -> x without overlap, or None


def _attempt(
    start: Callable[[], Array],
    separate: Separate,
    attempts: int,
    solid_fraction: float,
    rng: np.random.Generator,
    box: discs.Box,
    what: str,
) -> Array:
    """Positions of bodies grown to full size from random ones; PackingError if they jam in all attempts."""
    ease, size = max(1.0, min(_EASE, _DENSE / solid_fraction)), 0.0
    for _ in range(attempts):
        with one_thread():  # several round differently
            x, reached = _grow(start(), separate, np.sqrt(ease), rng)
        size = max(size, reached)
        if size >= 1.0:
            return x
    raise PackingError(
        f"the {what} jam at a solid fraction of {solid_fraction * size**2:.4f}, below the requested"
        f" {solid_fraction:g}; lower solid_fraction or friction, try another seed, {checks.denser(box)}"
    )


def _grow(x: Array, separate: Separate, limit: float, rng: np.random.Generator) -> tuple[Array, float]:
    """Grow the bodies to `limit` times their full size, in smaller steps near jamming.

    Growth beyond full size spreads them evenly; jamming there does no harm. Return the centres and the size reached.
    """
    size, growth, shakes, best = 0.0, discs.START, 0, 0.0
    while size < limit:
        target = min(limit, size + growth)
        moved = separate(x, size=target, tolerance=discs.OVERLAP[int(target < 1.0)])
        if moved is not None:
            x, size, growth = moved, target, min(1.5 * growth, _GROWTH)
            best = max(best, size)
        elif growth > _LEAST_GROWTH:
            growth *= 0.5
        elif size < 1.0 and shakes < _SHAKES:
            x, size, growth = x + _SHAKE * rng.uniform(-1.0, 1.0, x.shape), (1.0 - _SHAKE) * size, _SHAKE
            shakes += 1
        else:
            break
    return x, best
