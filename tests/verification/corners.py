"""Scenes of corners, and independent measures of how far bodies run into each other.

Bodies are of E = 1 MPa, nu = 0.3, 1000 kg/m3, their sides or diameters 2 R = 0.2 m; lengths are in cells where said.
Overlap and depth are measured on the polygons through the boundary points, by clipping and by crossing numbers.
"""

import logging
from dataclasses import dataclass

import meshio
import numpy as np

from skmpm import (
    Body,
    LinearElastic,
    NeoHookean,
    Points,
    Scene,
    Scheme,
    Support,
    Wall,
    box,
    disc,
    from_mesh,
    initial,
    simulate,
)

R, E, DENSITY = 0.1, 1e6, 1000.0
GEL, STIFF = NeoHookean(E, 0.3, DENSITY), LinearElastic(E, 0.3, DENSITY)
SOUND = np.sqrt(E / DENSITY)


# Measures.


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def polygons(scene, state):
    """The outer loops (2, m) of all bodies."""
    own = zip(scene.offsets, scene.bodies, strict=False)
    return [state.x[:, first:][:, body.points.outline[0]] for first, body in own]


def depth(x, polygon):
    """How deep points x (2, k) are inside a polygon (2, m), zero outside; by crossing numbers."""
    a, b = polygon[:, None], np.roll(polygon, -1, axis=1)[:, None]
    edge, y = b - a, x[:, :, None]
    crosses = (a[1] > y[1]) != (b[1] > y[1])
    rise = np.where(edge[1] == 0.0, 1.0, edge[1])
    left = crosses & (y[0] < a[0] + (y[1] - a[1]) / rise * edge[0])
    s = np.clip(((y - a) * edge).sum(axis=0) / (edge**2).sum(axis=0), 0.0, 1.0)
    distance = np.hypot(*(y - a - s * edge)).min(axis=1)
    return np.where(left.sum(axis=1) % 2 == 1, distance, 0.0)


def deepest(scene, state):
    """The lowest gap of a boundary point, of any body, to the outlines of the others and to walls [cells]."""
    boundaries, found = polygons(scene, state), [0.0]
    for i, p in enumerate(boundaries):
        for j, q in enumerate(boundaries):
            if i != j and (p.max(axis=1) > q.min(axis=1)).all() and (q.max(axis=1) > p.min(axis=1)).all():
                found.append(float(depth(p, q).max()))
        found += [
            -float((np.array(w.normal) @ (p - at[:, None])).min())
            for w, at in zip(scene.walls, state.walls, strict=True)
        ]
    return -max(found) / scene.cell


def clipped(p, q):
    """Area that two polygons share: q cut by the triangles of a fan over p (Sutherland & Hodgman, CACM 17, 1974)."""
    total, apex = 0.0, p[:, 0]
    for a, b in zip(p[:, 1:-1].T, p[:, 2:].T, strict=True):
        way = np.sign((a[0] - apex[0]) * (b[1] - apex[1]) - (a[1] - apex[1]) * (b[0] - apex[0]))
        triangle, rest = (apex, a, b) if way > 0 else (apex, b, a), q
        for start, end in zip(triangle, (*triangle[1:], triangle[0]), strict=True):
            rest = _cut(rest, start, end)
        total += way * _area(rest)
    return total


def _cut(polygon, start, end):
    """The part of a polygon to the left of the line from start to end."""
    side = (end[0] - start[0]) * (polygon[1] - start[1]) - (end[1] - start[1]) * (polygon[0] - start[0])
    after, x = np.roll(side, -1), np.roll(polygon, -1, axis=1)
    crosses = (side > 0.0) != (after > 0.0)
    t = np.where(crosses, side / np.where(crosses, side - after, 1.0), 0.0)
    both = np.stack([polygon, polygon + t * (x - polygon)], axis=2).reshape(2, -1)
    return both[:, np.stack([side > 0.0, crosses], axis=1).ravel()]


def _area(x):
    y = np.roll(x, -1, axis=1)
    return float(np.sum(x[0] * y[1] - x[1] * y[0])) / 2.0


def shared(scene, state):
    """Area shared by bodies over the area of all of them, by clipping."""
    boundaries = polygons(scene, state)
    boxes = [(p.min(axis=1), p.max(axis=1)) for p in boundaries]
    pairs = [
        (p, q)
        for i, p in enumerate(boundaries)
        for j, q in enumerate(boundaries[:i])
        if (boxes[i][0] < boxes[j][1]).all() and (boxes[j][0] < boxes[i][1]).all()
    ]
    return sum(clipped(p, q) for p, q in pairs) / sum(_area(p) for p in boundaries)


@dataclass(frozen=True)
class Run:
    """A run and the worst of its steps."""

    scene: Scene
    start: object
    state: object
    newton: np.ndarray  # (steps,) iterations
    halved: int  # steps that failed, and were tried again with half the length
    capped: int  # of these, steps that took all iterations Newton may take
    overlap: float  # largest share of the area, by the report
    gap: float  # lowest [cells]
    gain: float  # largest gain of kinetic + elastic energy beyond what went in, of any step, over the largest energy


class Said(logging.Handler):
    """What the library warned of while it is open."""

    def __init__(self):
        super().__init__()
        self.texts = []

    def emit(self, record):
        """Keep what a record says."""
        self.texts.append(record.getMessage())

    def __enter__(self):
        logging.getLogger("skmpm").addHandler(self)
        return self

    def __exit__(self, *_):
        logging.getLogger("skmpm").removeHandler(self)


def run(scene, dt, until, scheme=None):
    """Follow a scene and keep the worst."""
    scheme = Scheme() if scheme is None else scheme
    start = state = initial(scene, scheme=scheme)
    newton, halved, overlap, gap = [], 0, 0.0, 0.0
    lost, energy = [0.0], [start.report.energy.kinetic]
    with Said() as said:
        for state in simulate(scene, dt=dt, until=until, scheme=scheme, start=start):
            report = state.report
            newton.append(report.newton)
            halved += report.retries
            overlap, gap = max(overlap, report.overlap), min(gap, deepest(scene, state))
            lost.append(report.energy.dissipated)
            energy.append(report.energy.kinetic + report.energy.elastic)
    capped = sum("Newton iterations" in text for text in said.texts)
    gain = max(0.0, -float(np.diff(lost).min())) / max(energy)
    return Run(scene, start, state, np.array(newton), halved, capped, overlap, gap, gain)


# Shapes.


def turned(points, angle, centre=(0.0, 0.0)):
    return Points(rotation(angle) @ points.x + np.reshape(centre, (2, 1)), points.volume, points.outline)


def square(cell, side=2.0 * R):
    return box((-side / 2, -side / 2), (side, side), spacing=cell / 2)


def raster(rows, size, per):
    """Points of the cells marked in `rows`, from the top, each `size` wide and cut into per x per quadrilaterals."""
    mask = np.kron(np.array(rows)[::-1], np.ones((per, per), dtype=int))
    ny, nx = mask.shape
    j, i = np.nonzero(mask)
    first = j * (nx + 1) + i
    cells = np.stack([first, first + 1, first + nx + 2, first + nx + 1], axis=1)
    y, x = np.mgrid[: ny + 1, : nx + 1] * size / per
    return from_mesh(meshio.Mesh(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1), [("quad", cells)]))


def fan(corners, spacing):
    """Points of a polygon with the given corners (k, 2), star-shaped about the origin, of triangles."""
    ends = np.roll(corners, -1, axis=0)
    n = max(2, round(float(np.hypot(*(ends - corners).T).max()) / spacing))
    nodes, cells = {}, []

    def node(a, b, i, j):
        place = (a * i + b * j) / n
        return nodes.setdefault(tuple(np.round(place / spacing, 6)), (len(nodes), place))[0]

    for a, b in zip(corners, ends, strict=True):
        for i, j in np.ndindex(n, n):
            if i + j < n:
                cells.append([node(a, b, i, j), node(a, b, i + 1, j), node(a, b, i, j + 1)])
            if i + j < n - 1:
                cells.append([node(a, b, i + 1, j), node(a, b, i + 1, j + 1), node(a, b, i, j + 1)])
    x = np.array([place for _, place in nodes.values()])
    return from_mesh(meshio.Mesh(np.c_[x, 0 * x[:, 0]], [("triangle", np.array(cells))]))


def regular(k, radius):
    angle = 2.0 * np.pi * np.arange(k) / k
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def shapes(cell):
    """Of the heap: three of them concave, their centroids at the origin."""
    star = regular(10, R) * np.where(np.arange(10) % 2, 0.62, 1.12)[:, None]
    found = {
        "hexagon": fan(regular(6, R), cell),
        "triangle": fan(regular(3, 1.12 * R), cell),
        "square": fan(regular(4, 1.1 * R), cell),
        "star": fan(star, cell),
        "L": raster([[1, 0], [1, 1]], 0.8 * R, 3),
        "C": raster([[1, 1, 1], [1, 0, 0], [1, 1, 1]], 0.52 * R, 2),
    }
    centred = {name: p.x @ p.volume / p.volume.sum() for name, p in found.items()}
    return {name: turned(p, 0.0, -centred[name]) for name, p in found.items()}


# Scenes; `rng` draws offset and direction.


def press(rng, *, friction, on="face", cells=5, stroke=0.15):
    """A square driven by `stroke` R, corner first, 10 degrees or more off the flat, into a face or a wall."""
    h = R / cells
    angle, tilt = rng.uniform(0.0, 2.0 * np.pi), np.deg2rad(rng.uniform(-35.0, 35.0))
    origin, along = h * rng.random(2), rng.uniform(-R / 2, R / 2)
    n, t = rotation(angle).T
    tool = turned(square(h), angle + 0.75 * np.pi + tilt)
    tool = turned(tool, 0.0, origin + 0.02 * h * n - tool.x[:, np.argmin(n @ tool.x)] + (on == "face") * along * t)
    top, bottom = (n @ tool.x).max() - 0.35 * R, n @ origin - 2.0 * R + 1e-9
    supports = [Support(lambda x: n @ x > top, velocity=-stroke * R * n)]
    if on == "wall":
        walls = [Wall(origin, n, friction=friction)]
        return Scene([Body(tool, GEL)], cell=h, supports=supports, walls=walls)
    supports.append(Support(lambda x: n @ x < bottom))
    other = turned(square(h), angle, origin - R * n)
    return Scene([Body(tool, GEL), Body(other, GEL)], cell=h, supports=supports, friction=friction)


def meet(rng, *, friction, offset, cells=5, speed=0.02):
    """Two squares that fly at each other tip to tip, their tips `offset` cells beside each other.

    Without `rng` along the middle of a row of cells.
    """
    h = R / cells
    angle, origin = (rng.uniform(0.0, 2.0 * np.pi), h * rng.random(2)) if rng else (0.0, np.array([0.0, 0.5 * h]))
    n, t = rotation(angle).T
    away = (np.sqrt(2.0) * R + 0.05 * h) * n + 0.5 * offset * h * t
    bodies = []
    for sign, turn in ((1.0, 0.25 * np.pi), (-1.0, 1.25 * np.pi)):
        points = turned(square(h), angle + turn, origin + sign * away)
        bodies.append(Body(points, GEL, velocity=-sign * speed * SOUND * n))
    return Scene(bodies, cell=h, friction=friction)


WEIGHT = 5.0  # gravity of the disc in the notch [m/s2]; it sinks in by half a per cent, and the flanks hardly turn


def notch(rng, *, friction, cells=5):
    """A disc in the right angle of an L that stands on its outer corner, held at its ends."""
    h = R / cells
    angle, origin = rng.uniform(0.0, 2.0 * np.pi), h * rng.random(2)
    up = rotation(angle)[:, 0]
    L = raster([[1, 0, 0], [1, 0, 0], [1, 1, 1]], 0.9 * R, 4)
    L = turned(turned(L, 0.0, (-0.9 * R, -0.9 * R)), angle - 0.25 * np.pi, origin)
    ball = disc(origin + np.sqrt(2.0) * 1.0001 * R * up, R, spacing=h / 2)
    low = L.x[:, np.argmin(up @ L.x)]
    supports = [Support(lambda x: (up @ x < up @ origin - 0.3 * R) | (np.hypot(*(x - low[:, None])) < 0.1 * R))]
    return Scene([Body(L, GEL), Body(ball, GEL)], cell=h, supports=supports, friction=friction, gravity=-WEIGHT * up)


def slot(rng, *, friction, cells=5, fit=0.98, strokes=40):
    """A peg driven to the bottom of a slot, and 2 % of its length further; quasi-static, one step a second."""
    h, w = R / cells, 0.8 * R
    angle, origin = rng.uniform(0.0, 2.0 * np.pi), h * rng.random(2)
    n, t = rotation(angle).T
    U = raster([[1, 0, 1], [1, 0, 1], [1, 0, 1], [1, 1, 1]], w, 3)
    U = turned(turned(U, 0.0, (-1.5 * w, 0.0)), angle - 0.5 * np.pi, origin)
    peg = turned(box((-0.5 * fit * w, 0.0), (fit * w, 3.0 * w), spacing=h / 2), angle - 0.5 * np.pi)
    peg = turned(peg, 0.0, origin + 2.5 * w * n + 0.3 * (1.0 - fit) * w * t)
    velocity, top, bottom = -1.56 * w / strokes * n, (n @ peg.x).max() - 1e-9, n @ origin + 1e-9
    supports = [Support(lambda x: n @ x < bottom), Support(lambda x: n @ x > top, velocity=velocity)]
    return Scene([Body(U, GEL), Body(peg, GEL, velocity=velocity)], cell=h, supports=supports, friction=friction)


KINDS = [
    "hexagon",
    "triangle",
    "L",
    "hexagon",
    "star",
    "square",
    "hexagon",
    "C",
    "triangle",
    "L",
    "hexagon",
    "square",
]
LID = 2.0  # [m/s]


def heap(rng, *, friction, cells=4, kinds=KINDS, columns=3):
    """Polygons turned at random in a box whose lid comes down; its height, and that at a nominal fraction of 1."""
    h, pitch = R / cells, 2.36 * R
    made, origin = shapes(h), h * rng.random(2)
    at = [pitch * (np.array(divmod(i, columns))[::-1] + 0.5) for i in range(len(kinds))]
    order = rng.permutation(kinds)
    bodies = [
        Body(turned(made[kind], rng.uniform(0.0, 2.0 * np.pi), origin + c), GEL)
        for kind, c in zip(order, at, strict=True)
    ]
    width, height = pitch * columns, pitch * len(kinds) / columns
    walls = [
        Wall(origin, (0, 1), friction=0.0),
        Wall(origin, (1, 0), friction=0.0),
        Wall(origin + np.array([width, 0.0]), (-1, 0), friction=0.0),
        Wall(origin + np.array([0.0, height]), (0, -1), velocity=(0, -LID), friction=0.0),
    ]
    area = sum(body.points.volume.sum() for body in bodies)
    return Scene(bodies, cell=h, walls=walls, friction=friction), height, area / width


def stack(rng, *, cell, radii, spacings, friction=0.3, stroke=0.05):
    """A disc on another between two walls that come together by 4 `stroke` of the smaller radius in one second."""
    angle, origin = rng.uniform(0.0, 2.0 * np.pi), cell * rng.random(2)
    n, (r, other) = rotation(angle)[:, 0], radii
    discs = zip(radii, spacings, strict=True)
    small, large = (turned(disc((0, 0), a, spacing=s), rng.uniform(0.0, 6.0)) for a, s in discs)
    bodies = [
        Body(turned(small, 0.0, origin + (2.0 * other + r) * n), STIFF),
        Body(turned(large, 0.0, origin + other * n), STIFF),
    ]
    lid = Wall(origin + 2.0 * (r + other) * n, -n, velocity=-4.0 * stroke * min(radii) * n, friction=friction)
    return Scene(bodies, cell=cell, walls=[Wall(origin, n, friction=friction), lid], friction=friction)


def approach(force, radii):
    """Of the walls of `stack`, by Johnson (Contact Mechanics, 1985, eq. 5.57), plane strain [m]."""
    stiff, (r, other) = E / (1.0 - 0.3**2), radii
    middle = np.sqrt(8.0 * force * r * other / (r + other) / (np.pi * stiff))
    widths = [(a, np.sqrt(4.0 * force * a / (np.pi * stiff))) for a in radii] + [(a, middle) for a in radii]
    return sum(force / (np.pi * stiff) * (2.0 * np.log(4.0 * a / width) - 1.0) for a, width in widths)


def flight(rng, *, cell, radii, spacings, speed=0.01):
    """Two discs without stress that fly at each other from 0.3 cells apart, each at half the speed."""
    n = rotation(rng.uniform(0.0, 2.0 * np.pi))[:, 0]
    first = cell * rng.random(2)
    ends = (first, first + (sum(radii) + 0.3 * cell) * n)
    bodies = [
        Body(turned(disc((0, 0), a, spacing=s), rng.uniform(0.0, 6.0), c), STIFF, velocity=v * speed / 2 * n)
        for a, s, c, v in zip(radii, spacings, ends, (1, -1), strict=True)
    ]
    return Scene(bodies, cell=cell, friction=0.5)
