"""Initial packings of rigid discs: growth in a box, each step solved by the contact solver of the library."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from skmpm import coulomb

Array: TypeAlias = NDArray[np.float64]

_START = 0.3  # initial over final size of the discs
_GROWTH = 0.04  # largest and smallest growth per step; where the smallest is too large the discs are jammed
_LEAST_GROWTH = 2e-4
_EASE, _DENSE = 1.12, 0.78  # growth of the solid fraction beyond the requested one, up to a dense packing
# Discs placed in all attempts together: of 40 single attempts at a solid fraction of 0.7, 35 jam with 6 discs, 17
# with 12, none with 20 or more.
_ATTEMPTED_DISCS = 250
_SHAKES = 4  # random displacements to leave a jammed state ...
_SHAKE = 0.05  # ... and their size [mean radius]
_MARGIN = 0.5  # pairs with a smaller gap are constraints [mean radius]
_OVERLAP = 1e-6, 1e-3  # allowed at the end and during growth [smallest radius]
_TOLERANCE = 1e-9  # of the contact solver
_ACCEPTED = 1e-5  # if the solver stalls; the next linearisation corrects the error
_NEWTON = 20
_ROUNDS = 12  # linearisations per step
_HEXAGONAL = np.pi / np.sqrt(12.0)


class PackingError(ValueError):
    """The discs cannot be packed with the requested solid fraction or box."""


@dataclass(frozen=True)
class Packing:
    """Discs in the box [0, width] x [0, height], which may be periodic.

    Attributes
    ----------
    centres : (2, N) [m]
    radii : (N,) [m]
    width : of the box [m]
    height : of the box, by the solid fraction [m]
    """

    centres: Array
    radii: Array
    width: float
    height: float


def packing(
    radii: ArrayLike,
    width: float,
    *,
    solid_fraction: float = 0.70,
    friction: float = 0.0,
    periodic: bool = False,
    seed: int = 0,
) -> Packing:
    """Pack rigid discs at random, without overlap, in a box of the given width and solid fraction.

    Centres are drawn at random and the radii grow from small to full (Lubachevsky & Stillinger, J. Stat.
    Phys. 60 (1990) 561-583), but without inertia: in every step the discs make the smallest mass-weighted
    motion that opens all gaps to first order, which is a Signorini-Coulomb problem. Pairs do not overlap after
    that motion, because the linearised distance is a lower bound of the distance. A jammed state is perturbed at
    random, and packings of few discs are restarted from other centres, before it is accepted as such.

    Parameters
    ----------
    radii : (N,) [m]
    width : of the box [m]; its height is sum(pi R^2) / (width solid_fraction)
    friction : coefficient between discs during packing, zero at the walls; it lowers the solid fraction at jamming
    periodic : whether the box is periodic (`Periodic(width, height)`) instead of closed by walls
    seed : of the random numbers; the same seed gives the same packing in any unit of length

    Raises
    ------
    PackingError
        If an argument is invalid, or if the discs jam at a lower solid fraction, which the message contains.
    """
    R = np.array(radii, dtype=float)
    _check(R, width, solid_fraction, friction)
    unit = R.mean()
    scaled = np.round(R / unit, 10)  # so that rounding in other units of length cannot change the packing
    height = float(np.pi * (R**2).sum() / (width * solid_fraction))
    box = _Box(np.round([width / unit, height / unit], 10), periodic)
    if box.size.min() <= 2.0 * scaled.max():
        raise PackingError(
            f"the box is {width:g} x {height:g} m but the largest disc has a radius of {R.max():g} m; "
            "change the width, lower solid_fraction or use more discs"
        )
    rng = np.random.default_rng(seed)
    ease = max(1.0, min(_EASE, _DENSE / solid_fraction))
    size = 0.0
    for _ in range(1 + _ATTEMPTED_DISCS // R.size):
        x, reached = _grow(_scatter(scaled, box, rng), scaled, box, friction, np.sqrt(ease), rng)
        size = max(size, reached)
        if size >= 1.0:
            break
    else:
        raise PackingError(
            f"the discs jam at a solid fraction of {solid_fraction * size**2:.4f}, "
            f"below the requested {solid_fraction:g}; lower solid_fraction or friction, or try another seed"
        )
    return Packing(x * unit, R, float(width), height)


@dataclass(frozen=True)
class _Box:
    """The box, in mean radii."""

    size: Array  # (2,)
    periodic: bool

    def pairs(self, x: Array, distance: float) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
        """Pairs of centres x (2, N) closer than a distance, and the vectors (2, pairs) from second to first."""
        if not self.periodic:
            a, b = cKDTree(x.T).query_pairs(distance, output_type="ndarray").T
            return a, b, x[:, a] - x[:, b]
        within = np.minimum(np.mod(x.T, self.size), np.nextafter(self.size, 0.0))  # mod may return the size itself
        a, b = cKDTree(within, boxsize=self.size).query_pairs(distance, output_type="ndarray").T
        apart = x[:, a] - x[:, b]
        return a, b, apart - self.size[:, None] * np.rint(apart / self.size[:, None])

    def walls(self, x: Array, R: Array) -> Array:
        """Gaps between discs and the left, bottom, right and top wall, (4 N,), where there are walls."""
        if self.periodic:
            return np.zeros(0)
        return np.concatenate([x - R, self.size[:, None] - x - R]).ravel()


def _scatter(R: Array, box: _Box, rng: np.random.Generator) -> Array:
    """Draw a centre in each of N cells of a grid: random, but without the voids of independent centres."""
    columns = int(np.ceil(np.sqrt(R.size * box.size[0] / box.size[1])))
    rows = -(-R.size // columns)
    cell = rng.permutation(rows * columns)[: R.size]
    place = np.array(np.divmod(cell, rows)) + rng.uniform(size=(2, R.size))
    inner = 0.0 * R if box.periodic else _START * R
    return np.asarray(inner + place / [[columns], [rows]] * (box.size[:, None] - 2.0 * inner), dtype=float)


def _grow(
    x: Array, R: Array, box: _Box, friction: float, limit: float, rng: np.random.Generator
) -> tuple[Array, float]:
    """Grow the discs to `limit` times their full size, in smaller steps near jamming.

    Growth beyond full size spreads them evenly; jamming there does no harm. Return the centres and the size reached.
    """
    size, growth, shakes, best = 0.0, _START, 0, 0.0
    while size < limit:
        target = min(limit, size + growth)
        moved = _separate(x, target * R, box, friction, _OVERLAP[int(target < 1.0)])
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


def _separate(x: Array, R: Array, box: _Box, friction: float, tolerance: float) -> Array | None:
    """Move the discs as little as possible until none overlap; None if that does not converge."""
    for _ in range(_ROUNDS):
        contacts = _contacts(x, R, box)
        if contacts.gap.min(initial=0.0) >= -tolerance * R.min():
            return x
        motion = _motion(contacts, R, friction)
        if motion is None or np.abs(motion).max() > _MARGIN:
            return None
        x = x + motion
    return None


@dataclass(frozen=True)
class _Contacts:
    """Pairs of discs, then discs at walls, closer than the margin."""

    first: NDArray[np.intp]  # (k,)
    second: NDArray[np.intp]  # (pairs,)
    normal: Array  # (2, k) towards the first
    gap: Array  # (k,)


def _contacts(x: Array, R: Array, box: _Box) -> _Contacts:
    a, b, apart = box.pairs(x, 2.0 * R.max() + _MARGIN)
    distance = np.maximum(np.hypot(*apart), 1e-12)
    gap = distance - R[a] - R[b]
    near = gap < _MARGIN
    wall_gap = box.walls(x, R)
    wall, disc = np.divmod(np.flatnonzero(wall_gap < _MARGIN), R.size)
    inward = np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0]])[:, wall]
    return _Contacts(
        np.concatenate([a[near], disc]),
        b[near],
        np.hstack([(apart / distance)[:, near], inward]),
        np.concatenate([gap[near], wall_gap[wall_gap < _MARGIN]]),
    )


def _motion(contacts: _Contacts, R: Array, friction: float) -> Array | None:
    """Least mass-weighted motion (2, N) that opens all gaps, linearised; None if there is none."""
    k, pairs = contacts.gap.size, contacts.second.size
    mu = np.where(np.arange(k) < pairs, friction, 0.0)
    mass, inertia = R**2, 0.5 * R**4
    if friction > 0.0:
        H, q = _rows(contacts, R), np.zeros(2 * k)
    else:
        H, q = _rows(contacts, R)[::2], np.zeros(k)
    q[:: q.size // k] = contacts.gap - 0.5 * _OVERLAP[0] * R.min()
    H_M = H @ sp.diags_array(1.0 / np.concatenate([mass, mass, inertia]))
    r, info = coulomb.solve(H_M @ H.T, q, mu, tol=_TOLERANCE, iterations=_NEWTON)
    return (H_M.T @ r)[: 2 * R.size].reshape(2, -1) if info.residual < _ACCEPTED else None


def _rows(contacts: _Contacts, R: Array) -> sp.csr_array:
    """Contact Jacobian (2k, 3N): normal and tangential rows in turn; columns x, then y, then angles of all discs."""
    N, pairs = R.size, contacts.second.size
    n = contacts.normal
    t = np.array([-n[1], n[0]])
    a, b = contacts.first, contacts.second
    i = 2 * np.arange(a.size)
    j = i[:pairs]
    entries = [
        (i, a, n[0]),
        (i, N + a, n[1]),
        (i + 1, a, t[0]),
        (i + 1, N + a, t[1]),
        (i + 1, 2 * N + a, -R[a]),
    ]
    entries += [(j, b, -n[0, :pairs]), (j, N + b, -n[1, :pairs])]
    entries += [(j + 1, b, -t[0, :pairs]), (j + 1, N + b, -t[1, :pairs]), (j + 1, 2 * N + b, -R[b])]
    rows, columns, values = (np.concatenate(e) for e in zip(*entries, strict=True))
    return sp.csr_array((values, (rows, columns)), shape=(2 * a.size, 3 * N))


def _check(R: Array, width: float, solid_fraction: float, friction: float) -> None:
    if R.ndim != 1 or not R.size or not np.isfinite(R).all() or R.min() <= 0.0:
        bad = R[~(R > 0.0) | np.isinf(R)]
        found = f"radius {bad[0]:g} m" if bad.size else f"an array of shape {R.shape}"
        raise PackingError(f"radii: {found}; give an array (N,) of finite numbers above zero")
    if not 0.0 < solid_fraction < _HEXAGONAL:
        raise PackingError(
            f"solid_fraction {solid_fraction:g} must lie between 0 and {_HEXAGONAL:.4f}; random discs jam near 0.84"
        )
    if not (np.isfinite(width) and width > 2.0 * R.max()):
        raise PackingError(f"width {width:g} m must exceed the largest diameter, {2.0 * R.max():g} m")
    if not (np.isfinite(friction) and friction >= 0.0):
        raise PackingError(f"friction {friction:g} must be a finite number >= 0")
