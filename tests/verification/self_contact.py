"""Bodies that touch themselves: slotted blocks, open and closed rings; and how deep an outline lies in itself."""

from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree
from sectors import sector

from skmpm import Body, Load, NeoHookean, Points, Rigid, Scene, Support, Wall, disc

RUBBER = NeoHookean(1e6, 0.3, 1000.0)


def rectilinear(corners, spacing):
    """Points on a lattice in a polygon of horizontal and vertical sides; corners (k, 2) in units of the spacing."""
    corners = np.asarray(corners)
    low, size = corners.min(axis=0), np.ptp(corners, axis=0)
    closed = np.concatenate([corners, corners[:1]]) - low
    filled = np.zeros(size, dtype=int)
    for (x0, y0), (x1, y1) in pairwise(closed):  # vertical sides: the material to the right changes
        filled[x0:, min(y0, y1) : max(y0, y1)] += (x0 == x1) * int(np.sign(y0 - y1))
    share = np.zeros(size + 1)
    for i, j in np.ndindex(2, 2):
        share[i : size[0] + i, j : size[1] + j] += 0.25 * filled
    number = np.cumsum(share > 0).reshape(share.shape) - 1
    loop = []
    for a, b in pairwise(closed):
        length = np.abs(b - a).sum()
        loop += [number[tuple(a + k * (b - a) // length)] for k in range(length)]
    x = (np.argwhere(share > 0) + low).T * spacing
    return Points(x, share[share > 0] * spacing**2, (np.array(loop),))


def annulus(inner, outer, *, spacing):
    """Points of a ring with a hole."""
    count = round(np.pi * (inner + outer) / spacing)
    layers = max(round((outer - inner) / spacing), 2)
    r = np.linspace(inner, outer, layers + 1)
    angle = 2.0 * np.pi * np.arange(count) / count
    area = np.pi * np.diff(r**2) / count
    volume = 0.5 * (np.append(area, 0.0) + np.insert(area, 0, 0.0))
    x = np.stack([np.outer(r, np.cos(angle)), np.outer(r, np.sin(angle))]).reshape(2, -1)
    outer_loop, inner_loop = layers * count + np.arange(count), np.arange(count)[::-1]
    return Points(x, np.repeat(volume, count), (outer_loop, inner_loop))


def c_ring(cell, friction):
    """A C-ring between two plates, one of which moves by more than the radius in a second.

    With friction both arms have the same length; without, when tips that meet would slip off each other, the upper
    one is shorter, and its tip lands on the other arm.
    """
    begin, end, speed = (0.3, 0.3, 1.5) if friction else (1.4, 0.0, 1.4)
    points = sector(0.75, 1.0, begin, 2.0 * np.pi - end, spacing=0.5 * cell)
    plates = [
        Wall((0, -1.0), (0, 1), friction=friction),
        Wall((0, 1.0), (0, -1), velocity=(0, -speed), friction=friction),
    ]
    spine = Support(lambda x: (np.abs(x[1]) < 0.03) & (x[0] < -0.99), velocity=(0.0, None))
    return Scene([Body(points, RUBBER)], cell=cell, walls=plates, supports=[spine], friction=friction)


def slotted(slot, friction=0.0, *, divided=False):
    """Two legs over a slot of `slot` half cells, held below, their tips pressed together within a second.

    With `divided` the legs are two bodies.
    """
    leg, base, top = 8, 6, 46
    width = 2 * leg + slot
    legs = [[(a, 0), (a + leg, 0), (a + leg, top), (a, top)] for a in (0, leg + slot)]
    whole = [
        (0, 0),
        (width, 0),
        (width, top),
        (leg + slot, top),
        (leg + slot, base),
        (leg, base),
        (leg, top),
        (0, top),
    ]
    bodies = [Body(rectilinear(corners, 0.5), RUBBER) for corners in (legs if divided else [whole])]
    speed, high = 0.5 * slot * 0.5 * 1.25, 0.5 * top - 2.01
    supports = [
        Support(lambda x: x[1] <= 0.5 * base + 1e-9),
        Support(lambda x: (x[1] > high) & (x[0] < 1e-9), velocity=(speed, None)),
        Support(lambda x: (x[1] > high) & (x[0] > 0.5 * width - 1e-9), velocity=(-speed, None)),
    ]
    return Scene(bodies, cell=1.0, supports=supports, friction=friction)


def crushed_ring(cell):
    """A ring of thickness R/4 between two rigid discs that meet."""
    discs = [
        Body(disc((0.0, 1.4 * up), 0.4, spacing=0.5 * cell), Rigid(1000.0), motion=(0.0, -0.85 * up, 0.0))
        for up in (1.0, -1.0)
    ]
    held = Support(lambda x: (np.abs(x[0]) < 1e-6) & (np.abs(x[1]) > 0.99), velocity=(0.0, None))
    return Scene(
        [Body(annulus(0.75, 1.0, spacing=0.5 * cell), RUBBER), *discs], cell=cell, supports=[held], friction=0.3
    )


def flying_fork(friction):
    """A free fork whose prongs fly at each other."""

    def velocity(x):
        swing = -np.sign(x[0] - 5.5) * 0.01 * np.maximum(x[1] - 3.0, 0.0) ** 2
        return np.stack([swing + 0.3, 0.2 + 0.05 * x[0]])

    corners = [(0, 0), (22, 0), (22, 44), (16, 44), (16, 6), (6, 6), (6, 42), (0, 42)]
    body = Body(rectilinear(corners, 0.5), NeoHookean(1e5, 0.3, 1000.0), velocity=velocity)
    return Scene([body], cell=1.0, friction=friction)


def penetration(x, cell):
    """Greatest depth [cells] of a loop of boundary points (2, m) in itself, of splines between its corners.

    Of each of 20 samples a segment the nearest opposite one is found that lies more than three cells away along the
    loop; the depth is measured along its normal.
    """
    at, tangent = _sampled(x)
    normal = np.stack([tangent[1], -tangent[0]])
    along = np.cumsum(np.hypot(*np.diff(at, axis=1, prepend=at[:, :1])))
    i, j = cKDTree(at.T).query_pairs(0.5 * cell, output_type="ndarray").T
    way = np.abs(along[i] - along[j])
    facing = (np.minimum(way, along[-1] - way) > 3.0 * cell) & ((normal[:, i] * normal[:, j]).sum(axis=0) < -0.3)
    i, j = np.concatenate([i[facing], j[facing]]), np.concatenate([j[facing], i[facing]])
    order = np.lexsort((np.hypot(*(at[:, i] - at[:, j])), i))
    nearest = order[np.unique(i[order], return_index=True)[1]]
    i, j = i[nearest], j[nearest]
    apart = at[:, i] - at[:, j]
    opposite = np.abs((apart * tangent[:, j]).sum(axis=0)) < 0.05 * cell
    depth = -(apart * normal[:, j]).sum(axis=0)[opposite]
    return float(depth.max(initial=0.0)) / cell


def _sampled(x):
    """Samples (2, k) of splines through a loop of boundary points, from corner to corner, and their unit tangents."""
    edge = np.roll(x, -1, axis=1) - x
    back, size = np.roll(edge, 1, axis=1), x.shape[1]
    turn = np.abs(np.arctan2(back[0] * edge[1] - back[1] * edge[0], (back * edge).sum(axis=0)))
    corners = np.flatnonzero(turn > np.deg2rad(50.0))
    ends = [*pairwise(corners), (corners[-1], corners[0] + size)] if corners.size else [(0, size)]
    parts = []
    for a, b in ends:
        side = np.arange(a, b + 1) % size
        knots = np.append(0.0, np.cumsum(np.hypot(*edge[:, side[:-1]])))
        spline = CubicSpline(knots, x[:, side].T, bc_type="not-a-knot" if corners.size else "periodic")
        s = np.interp(np.arange(20 * (b - a)) / 20.0, np.arange(b - a + 1), knots)
        parts.append((spline(s).T, spline(s, 1).T))
    at, tangent = (np.concatenate(part, axis=1) for part in zip(*parts, strict=True))
    return at, tangent / np.hypot(*tangent)


def standing_fork():
    """A fork on a floor, under its weight, whose prongs are pressed together by loads that grow with time."""
    top, width = 20.99, 10.0

    def pressed(side):
        return lambda x: (x[1] > top) & (np.abs(x[0] - side) < 1e-9)

    loads = [Load(pressed(0.0), lambda t: (3000.0 * t, 0.0)), Load(pressed(width), lambda t: (-3000.0 * t, 0.0))]
    floor = Wall((0, 0), (0, 1), friction=0.5)
    return Scene(slotted(4).bodies, cell=1.0, loads=loads, walls=[floor], gravity=(0.0, -1.0), friction=0.5)
