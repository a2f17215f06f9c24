"""Tractions along a side of a boundary from the forces of single contacts, by the hat functions of the grid."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from skmpm.arrays import ROUND_OFF, Array, Bools, Ints
from skmpm.observe.sides import Placed, Side

NARROW = 2.7  # loaded length up to which the narrow estimate counts alone [cells]
SAMPLES = 12  # per cell, for integrals along the side
MAX_CELLS = 10_000  # along a side, which bounds the memory for a small `length`


def recover(side: Side, placed: Placed, loads: Array, lattice: Array, length: float, h: float) -> tuple[Array, Array]:
    """Tractions (components, n) at the points of a side, and the error (n,) of the first two components [Pa].

    Parameters
    ----------
    loads : (components, k) [N/m] at the contacts `placed`, of which the first two are the force in x and y
    lattice : (2, m) all boundary points in the coordinates of the body grid [m]
    length : edge of the cells of the hat functions [m]; 0 for the point forces over tributary lengths
    h : edge of the cells of the grid [m]
    """
    number = np.full(lattice.shape[1], -1)
    number[side.segments] = np.arange(side.segments.size)
    here = np.flatnonzero(number[placed.segment] >= 0)
    segment, t = number[placed.segment[here]], placed.t[here]
    loads = np.vstack([loads, np.hypot(*loads[:2])])[:, here]
    w, one, cell = side.weight, np.ones(side.point.size), max(length or h, side.total / MAX_CELLS)
    A, at_contacts = _hat_functions(side, segment, t, lattice[:, side.point], cell)

    def shared(q: Array, f: Array) -> Array:
        """Nodal loads f (nodes, c) over their hats in proportion to q (n,)."""
        return np.asarray((q / w)[:, None] * (A.T @ _ratio(f, A @ q)))

    f = at_contacts @ loads.T
    first = shared(one, f)
    smooth = shared(one, A @ first)
    q, spread = smooth[:, -1], shared(one, A @ smooth)[:, -1]
    stretch = _stretches(side, q > 0.0)

    def widely(f: Array) -> Array:
        """Tractions of nodal loads by their first estimate."""
        each = shared(spread, A @ shared(one, f))
        return q[:, None] * shared(one, A @ _ratio(each, spread))

    if length == 0.0:
        tractions = _point_forces(side, segment, t, loads)
        difference = tractions - widely(f)
    else:
        total, square = _sums(w[:, None] * first[:, -1:] ** [1, 2], stretch).T
        loaded = _ratio(total[:, None] ** 2, square)[stretch[segment], 0]
        part = np.minimum(1.0, (NARROW * cell / np.maximum(loaded, cell)) ** 2)
        f_narrow = at_contacts @ (part * loads).T
        tractions = shared(q, f_narrow) + widely(f - f_narrow)
        difference = shared(q, f) - widely(f)
    error = 2.0 * shared(one, A @ np.hypot(*difference[:, :2].T)[:, None])[:, 0]
    tractions = _with_moments(side, segment, t, loads, tractions, stretch)
    hidden = _hidden(side, segment, t, loads[-1], placed.width[here], tractions[:, -1], h)
    return tractions[:, :-1].T, np.maximum(error, hidden)


def _hidden(side: Side, segment: Ints, t: Array, force: Array, width: Array, size: Array, h: float) -> Array:
    """What tractions of a size (n,) lack [Pa] if each contact has the lowest peak that its forces (k,) allow.

    Forces are of one contact if they are at most two cells apart: those farther apart hardly share a node.
    """
    away = np.abs(side.s[:, None] - (side.s[segment] + _along(side, segment, t))[force > 0.0])
    away = np.minimum(away, side.total - away) if side.closed else away
    near = away.min(axis=1, initial=np.inf) <= h
    near[segment[force > 0.0]] = True
    contact = _stretches(side, near)
    least, peak = _least_peaks(side, segment, t, force, width, contact), np.zeros(int(contact.max()) + 1)
    size = np.where(near, size, 0.0)
    np.maximum.at(peak, contact, size)
    lacking = np.divide(least, peak, out=np.ones(peak.size), where=peak > 0.0) - 1.0
    return np.multiply(np.maximum(lacking, 0.0)[contact], size, out=np.zeros(size.size), where=size > 0.0)


def _least_peaks(side: Side, segment: Ints, t: Array, force: Array, width: Array, contact: Ints) -> Array:
    """Lowest peak [Pa] that each of the contacts (n,) of the points may have; inf where it may have no width.

    Of all tractions with the same force and second moment the uniform one has the lowest peak; it is sqrt(12)
    standard deviations wide. Forces (k,) act at points, and are shared by those on both sides of where the traction
    acts: that has added width^2 / 6 to the second moment, the variance of a hat function.
    """
    own, groups = contact[segment], int(contact.max()) + 1
    x = (1.0 - t) * side.x[:, segment] + t * side.x[:, (segment + 1) % side.point.size]
    sums = _sums(force[:, None] * np.stack([np.ones(t.size), *x], axis=1), own, groups)
    total, mean = sums[:, 0], _ratio(sums[:, 1:], sums[:, 0])
    square = ((x.T - mean[own]) ** 2).sum(axis=1) - width**2 / 6.0
    extent = np.sqrt(12.0 * np.maximum(total * _sums((force * square)[:, None], own, groups)[:, 0], 0.0))
    return np.asarray(np.divide(total**2, extent, out=np.full(groups, np.inf), where=extent > 0.0))


def _along(side: Side, segment: Ints, t: Array) -> Array:
    """Arc lengths (k,) [m] from where segments begin to places at parts t of them."""
    return np.asarray(t * np.diff(np.append(side.s, side.total))[segment])


def _with_moments(side: Side, segment: Ints, t: Array, loads: Array, tractions: Array, stretch: Ints) -> Array:
    """Tractions (n, c) with the first moments of the loads (c, k) in arc length over each stretch under load.

    They move in proportion to the last component, which is not negative; a loop that is loaded all round has no ends.
    """
    F, s = side.weight[:, None] * tractions, side.s
    if side.closed:
        if tractions[:, -1].all():
            return tractions
        s = (s - s[np.argmin(tractions[:, -1])]) % side.total
    total, first = _sums(F[:, -1:] * np.stack([np.ones(s.size), s], axis=1), stretch).T
    arm = s - _ratio(first[:, None], total)[stretch, 0]
    load_arm = arm[segment] + _along(side, segment, t)
    missing = -_sums(F * arm[:, None], stretch)
    np.add.at(missing, stretch[segment], loads.T * load_arm[:, None])
    second = _sums(F[:, -1:] * arm[:, None] ** 2, stretch)[:, 0]
    return np.asarray(tractions + (arm * tractions[:, -1])[:, None] * _ratio(missing, second)[stretch])


def _ratio(a: Array, b: Array) -> Array:
    """Rows of a (n, c) over b (n,), zero where b is."""
    return np.divide(a, b[:, None], out=np.zeros_like(a), where=b[:, None] > 0.0)


def _sums(values: Array, group: Ints, groups: int = 0) -> Array:
    """Sums of the rows of values (n, c) over groups (n,), of which there are at least `groups`, as (groups, c)."""
    return np.stack([np.bincount(group, column, groups) for column in values.T], axis=1).astype(np.float64)


def _point_forces(side: Side, segment: Ints, t: Array, loads: Array) -> Array:
    """Loads (components, k) over the tributary lengths of the points they act at (n, components)."""
    at, n = np.append(segment, (segment + 1) % side.point.size), side.point.size
    return _sums(np.concatenate([(1.0 - t) * loads, t * loads], axis=1).T, at, n) / side.weight[:, None]


def _stretches(side: Side, loaded: Bools) -> Ints:
    """Number of the stretch of loaded points that each point (n,) of a side belongs to; any where not loaded."""
    before = np.roll(loaded, 1)
    before[0] &= side.closed
    number = np.cumsum(loaded & ~before)
    return np.asarray(number % max(int(number.max()), 1))  # the first one of a closed side may be the end of the last


def _hat_functions(
    side: Side, segment: Ints, t: Array, lattice: Array, cell: float
) -> tuple[sp.csr_array, sp.csr_array]:
    """Integrals of the hats of nodes times those of points (nodes, n) [m]; the hats of nodes at contacts (nodes, k).

    A node counts once for each stretch of the side under its hat: faces of a part thinner than a cell share none.
    """
    step, n = np.diff(np.append(side.s, side.total) if side.closed else side.s), side.point.size
    pieces = np.ceil(SAMPLES * step / cell).astype(np.int64)
    own = np.repeat(np.arange(step.size), pieces)
    position = (np.arange(own.size) - np.repeat(np.cumsum(pieces) - pieces, pieces) + 0.5) / pieces[own]
    begin, on = np.concatenate([own, segment]), np.concatenate([position, t])
    ds = np.concatenate([(step / pieces)[own], np.zeros(t.size)])
    y = ((1.0 - on) * lattice[:, begin] + on * lattice[:, (begin + 1) % n]) / cell
    low = np.floor(y)
    (a, b), corners = y - low, low[:, None] + np.array([[0, 1, 0, 1], [0, 0, 1, 1]])[:, :, None]
    value = np.concatenate([(1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b])
    node, sample = _visits(corners, begin + on, side.closed), np.tile(np.arange(on.size), 4)
    integral, hat, point = value * ds[sample], on[sample], begin[sample]
    entries = np.concatenate([integral * (1.0 - hat), integral * hat])
    places = np.tile(node, 2), np.concatenate([point, (point + 1) % n])
    A = sp.csr_array((entries, places), shape=(node.max() + 1, n))
    kept = (sample >= own.size) & (A.sum(axis=1)[node] > ROUND_OFF * cell)
    value, node, contact = value[kept], node[kept], sample[kept] - own.size
    shares = value / np.bincount(contact, value)[contact]  # a node that no sample saw has none
    return A, sp.csr_array((shares, (node, contact)), shape=(A.shape[0], t.size))


def _visits(corners: Array, position: Array, closed: bool) -> Ints:
    """Numbers (4 n,) of nodes with corners (2, 4, n) at samples of a position (n,) along the side.

    A node has another number where the side comes back to it.
    """
    rank = np.empty(position.size, dtype=np.int64)
    rank[np.argsort(position, kind="stable")] = np.arange(position.size)
    x, y, rank = corners[0].ravel(), corners[1].ravel(), np.tile(rank, 4)
    order = np.lexsort((rank, y, x))
    moved = np.abs(np.diff(x[order])) + np.abs(np.diff(y[order])) > 0.0
    number = np.empty(x.size, dtype=np.int64)
    number[order] = np.cumsum(np.append(False, moved | (np.diff(rank[order]) > 1)))
    if closed:
        for i in np.flatnonzero(rank == rank.max()):
            j = np.flatnonzero((rank == 0) & (x == x[i]) & (y == y[i]))
            number[number == number[i]] = number[j[0]] if j.size else number[i]
    return number
