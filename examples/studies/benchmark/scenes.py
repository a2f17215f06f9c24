"""Workloads of `study.py`: dense packings of any size built from one compressed tile, free discs, single bodies.

Compression to a nominal solid fraction of 0.90 takes hundreds of steps, so one *tile*, a box of at most 100 discs, is
compressed, and larger packings consist of its mirror images. The mirror image of a motion at a smooth wall is a
motion, so that in an array of tiles without inner walls every disc moves as in the tile and Newton's method takes the
same number of iterations (with friction to the tolerance of a step; without, discs and their images first slip,
since contact normals are those of one of the two curves). A contact with a wall becomes one with the image, so there
are fewer contacts per disc by those of the walls; strain rate and pressure are unchanged. By construction a large
packing is thus no harder than the tile: computing time grows, not the number of rare difficult contacts. Every size
is compressed at the strain rate of the main job (300 discs, lid at 2 m/s), so lids of higher packings are faster; the
velocities of the images are shifted accordingly.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import skmpm

Array = NDArray[np.float64]

GEL = {"E": 10e6, "nu": 0.45, "density": 990.0}
RADII = 0.7e-3, 1.2e-3  # [m]
SPACING = 0.14 / 0.19  # of the points [cells], the main job's
RATE = 72.0  # [1/s], 2 m/s over the height of 300 discs at 0.90
SPEED_UP = 4.0  # by which tiles are squeezed faster
START, SQUEEZED = 0.68, 0.8975  # nominal solid fractions of a tile
DT = 8e-6  # [s]


def layout(discs: int, tile: int) -> tuple[int, int, int]:
    """Discs of a tile, tiles side by side and on top of each other."""
    if discs <= tile:
        return discs, 1, 1
    tiles = discs // tile
    if tiles * tile != discs:
        raise ValueError(f"{discs} discs; give at most {tile} or a multiple of it")
    rows = max(k for k in range(1, int(np.sqrt(tiles)) + 1) if tiles % k == 0)
    return tile, tiles // rows, rows


def box(width: float, height: float, lid: float, bodies: list[skmpm.Body], cell: float, mu: float) -> skmpm.Scene:
    """Bodies in a box of smooth walls: floor, lid coming down at speed `lid` [m/s], left, right."""
    walls = [
        skmpm.Wall((0.0, 0.0), (0.0, 1.0), friction=0.0),
        skmpm.Wall((0.0, height), (0.0, -1.0), velocity=(0.0, -lid), friction=0.0),
        skmpm.Wall((0.0, 0.0), (1.0, 0.0), friction=0.0),
        skmpm.Wall((width, 0.0), (-1.0, 0.0), friction=0.0),
    ]
    return skmpm.Scene(bodies, cell=cell, walls=walls, friction=mu)


def boxed(discs: int, cells: float, friction: float, *, start: float = START, speed_up: float = 1.0) -> skmpm.Scene:
    """Discs of `cells` grid cells per mean radius in a box of whole cells; all shrinks as the lid comes down."""
    cell = float(np.mean(RADII)) / cells
    radii = np.random.default_rng(0).uniform(*RADII, discs)
    solid = np.pi * (radii**2).sum()
    width = cell * round(np.sqrt(solid / 0.72) / cell)
    height = cell * round(solid / (width * start) / cell)
    packing = skmpm.packing(radii, width, solid_fraction=solid / (width * height))
    lid, gel = speed_up * RATE * solid / (width * 0.90), skmpm.NeoHookean(**GEL)
    bodies = [
        skmpm.Body(skmpm.disc(c, R, spacing=SPACING * cell), gel, velocity=(0.0, -lid * c[1] / height))
        for c, R in zip(packing.centres.T, packing.radii, strict=True)
    ]
    return box(width, height, lid, bodies, cell, friction)


def fraction(scene: skmpm.Scene, state: skmpm.State) -> float:
    """Nominal solid fraction in the box."""
    return float(scene.initial_volumes.sum() / (state.walls[3, 0] * state.walls[1, 1]))


def squeezed(discs: int, cells: float, friction: float, cache: Path) -> tuple[skmpm.Scene, skmpm.State]:
    """The tile at SQUEEZED, slowed down to the strain rate of the main job; kept in `cache`."""
    scene, path = boxed(discs, cells, friction), cache / f"tile_{discs}_{cells:g}_{friction:g}.checkpoint"
    state = skmpm.load(path) if path.exists() else None
    if state is None or not np.array_equal(state.x_anchor, scene.initial_positions):
        state = squeeze(boxed(discs, cells, friction, speed_up=SPEED_UP), SQUEEZED)
        cache.mkdir(parents=True, exist_ok=True)
        skmpm.save(path, state)
    return scene, state


def squeeze(scene: skmpm.Scene, full: float) -> skmpm.State:
    """Squeeze a box to a nominal solid fraction, faster by `SPEED_UP` than it will be measured, and slow it down."""
    lid, height = -scene.walls[1].velocity[1], float(scene.walls[1].point[1])
    until = (height - scene.initial_volumes.sum() / (scene.walls[3].point[0] * full)) / lid
    (state,) = deque(skmpm.simulate(scene, dt=DT, until=until), maxlen=1)
    return replace(state, v=state.v / SPEED_UP, C=state.C / SPEED_UP)


def dense(discs: int, cells: float, friction: float, tile: int, cache: Path) -> tuple[skmpm.Scene, skmpm.State]:
    """A packing of that many discs at SQUEEZED, from tiles of at most `tile` discs."""
    of_tile, across, up = layout(discs, tile)
    scene, state = squeezed(of_tile, cells, friction, cache)
    return (scene, state) if across * up == 1 else tiled(scene, state, across, up)


@dataclass(frozen=True)
class Image:
    """The image of the tile in one place: that in odd columns and rows is turned over."""

    place: Array  # (2,) column and row

    @property
    def sign(self) -> Array:
        """Minus one where it is turned over, (2,)."""
        return np.where(self.place % 2, -1.0, 1.0)

    def __call__(self, values: Array, size: Array) -> Array:
        """What becomes of a field (2, n) of the tile whose values at its two far sides are `size` (2,)."""
        shift = np.where(self.sign < 0.0, size, 0.0) + self.place * size
        return np.asarray(self.sign[:, None] * values + shift[:, None])

    def tensor(self, values: Array) -> Array:
        """The same of a tensor (2, 2, n)."""
        return np.asarray(np.outer(self.sign, self.sign)[:, :, None] * values)

    def body(self, body: skmpm.Body, size: Array) -> skmpm.Body:
        """The same of a body before it was squeezed."""
        turn = int(self.sign.prod())  # outlines stay counter-clockwise
        boundary = tuple(loop[::turn] for loop in body.points.outline)
        return skmpm.Body(skmpm.Points(self(body.points.x, size), body.points.volume, boundary), body.material)


def tiled(scene: skmpm.Scene, state: skmpm.State, across: int, up: int) -> tuple[skmpm.Scene, skmpm.State]:
    """A squeezed tile and its mirror images side by side and on top of each other, without the walls between."""
    images = [Image(np.array([i, j])) for j in range(up) for i in range(across)]
    before = np.array([scene.walls[3].point[0], scene.walls[1].point[1]])
    size, speed = np.array([state.walls[3, 0], state.walls[1, 1]]), np.array(scene.walls[1].velocity)
    bodies = [image.body(body, before) for image in images for body in scene.bodies]
    whole = box(across * before[0], up * before[1], -up * speed[1], bodies, scene.cell, scene.friction)
    first = skmpm.initial(whole)

    def laid(values: Array, size: Array) -> Array:
        return np.concatenate([image(values, size) for image in images], axis=1)

    def turned(values: Array) -> Array:
        return np.concatenate([image.tensor(values) for image in images], axis=2)

    walls = np.array([[0.0, 0.0], [0.0, up * size[1]], [0.0, 0.0], [across * size[0], 0.0]])
    return whole, replace(
        first,
        x=laid(state.x, size),
        v=laid(state.v, speed),
        F=turned(state.F),
        C=turned(state.C),
        stress=turned(state.stress),
        volume=np.tile(state.volume, len(images)),
        weight=np.tile(state.weight, len(images)),
        displacement=_displacement(scene, state, first, laid, (before, size)),
        walls=walls,
        contacts=skmpm.scene.Contacts.none(),
    )


def _displacement(
    scene: skmpm.Scene,
    state: skmpm.State,
    first: skmpm.State,
    laid: Callable[[Array, Array], Array],
    sizes: tuple[Array, Array],
) -> Array:
    """The nodal displacement of all images: their nodes are those of the tile, numbered in another order."""
    old = skmpm.initial(scene).derived.assembly.grid
    new = first.derived.assembly.grid
    index = np.rint(laid(old.node_index, np.rint(sizes[0] / scene.cell))).astype(int)
    body = np.repeat(np.arange(new.bodies // old.bodies), old.nodes) * old.bodies
    order = np.lexsort((*index, body + np.tile(old.node_body, new.bodies // old.bodies)))
    place = np.lexsort((*new.node_index, new.node_body))
    if index.shape != new.node_index.shape or (index[:, order] != new.node_index[:, place]).any():
        raise RuntimeError("an image of the tile has other cells than the tile: a point lies on a grid line")
    u = np.empty((2, new.nodes))
    u[:, place] = laid(state.displacement.reshape(-1, 2).T, sizes[1] - sizes[0])[:, order]
    return u.T.ravel()


def free(discs: int, cells: float, law: str) -> tuple[skmpm.Scene, skmpm.State]:
    """Discs far apart that swing by a strain of about 1 %, of the material with that name."""
    cell, pitch = float(np.mean(RADII)) / cells, 2.2 * max(RADII)
    radii, material = np.random.default_rng(0).uniform(*RADII, discs), getattr(skmpm, law)(**GEL)
    centres = pitch * np.transpose(np.divmod(np.arange(discs), int(np.ceil(np.sqrt(discs)))))
    bodies = [
        skmpm.Body(skmpm.disc(c, R, spacing=SPACING * cell), material, velocity=swing(c, R))
        for c, R in zip(centres, radii.tolist(), strict=True)
    ]
    scene = skmpm.Scene(bodies, cell=cell)
    return scene, skmpm.initial(scene)


def swing(centre: Array, radius: float) -> Callable[[Array], Array]:
    """Longer and thinner at 2 m/s at the boundary."""
    return lambda x: 2.0 / radius * np.array([[1.0], [-1.0]]) * (x - centre[:, None])


def single(points: int, *, pulled: bool) -> skmpm.Scene:
    """One disc of radius 1 m whose centre lies anywhere in a cell: held and pulled by 1 %, or free and swinging."""
    spacing = float(np.sqrt(np.pi / points))
    cell = spacing / SPACING
    centre = cell * np.random.default_rng(points).uniform(size=2)
    body = skmpm.Body(skmpm.disc(centre, 1.0, spacing=spacing), skmpm.NeoHookean(**GEL), velocity=swing(centre, 1.0))
    if not pulled:
        return skmpm.Scene([body], cell=cell)
    held = skmpm.Support(lambda x: x[0] < centre[0] - 0.9)
    load = skmpm.Load(lambda x: x[0] > centre[0] + 0.9, (0.01 * GEL["E"], 0.0))
    return skmpm.Scene([replace(body, velocity=(0.0, 0.0))], cell=cell, supports=[held], loads=[load])


def breathing(discs: int, cells: float, period: float) -> skmpm.Scene:
    """Discs under a lid that goes down until they touch everywhere, and up again, once a period [s]."""
    scene = boxed(discs, cells, 0.5, start=0.55)
    width, height = float(scene.walls[3].point[0]), float(scene.walls[1].point[1])
    speed = np.pi * height * (1.0 - 0.55 / 0.80) / period
    bodies = [replace(body, velocity=(0.0, 0.0)) for body in scene.bodies]
    scene = box(width, height, 0.0, bodies, scene.cell, scene.friction)
    lid = replace(scene.walls[1], velocity=lambda t: (0.0, -speed * np.sin(2.0 * np.pi * t / period)))
    return replace(scene, walls=[scene.walls[0], lid, *scene.walls[2:]])
