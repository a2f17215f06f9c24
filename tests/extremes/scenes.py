"""The scenes of the sweeps: every parameter that a user can choose is a dimensionless number of `Parameters`.

Unit of length: the (mean) radius R of the discs. Unit of speed: c, the speed of pressure waves in the gel of
Nezamabadi et al. (2017), sqrt(3.79 E / density), whatever Poisson's ratio and the other ratios are. The scenes are
built in these units, then turned, shifted and scaled.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

import skmpm

WAVE = np.sqrt(0.55 / (1.45 * 0.10))  # c over sqrt(E / density) at nu = 0.45
RADII = (0.7, 1.2)  # of packed discs, over 0.95 of them is the mean
OBLIQUE = np.pi / 6.0  # between the line of centres and the relative velocity of two discs
GAP = 0.05  # [cells] between bodies at the start, if they close it within a step
JAMMED = ((4, 0.61), (12, 0.70))  # so few discs often jam below that, which takes a minute to find out
LOOSE = (0.76, 0.72, 0.68, 0.64, 0.60, 0.54, 0.48)  # solid fractions to try to pack discs at


@dataclass(frozen=True)
class Parameters:
    """All settings of a scene; the defaults are the gel of Nezamabadi et al. (2017) at R/h = 5."""

    dt_c_h: float = 4.0  # time step, over h / c
    nu: float = 0.45
    stiffness_ratio: float = 1.0  # of every second body over the others
    density_ratio: float = 1.0
    friction: float = 0.5  # between bodies and on walls
    closing: float = 0.04  # relative speed, speed of the lid and at the end of a fall, over c
    points_per_cell: float = 1.0 / 0.74**2
    cells: float = 5.0  # R/h
    offset: tuple[float, float] = (0.137, 0.291)  # of a disc's centre, or the box's corner, from a node [cells]
    origin: tuple[float, float] = (0.0, 0.0)  # where all this is [cells]
    solid_fraction: float = 0.90  # nominal, where the squeeze ends
    bodies: int | None = None  # 1 in free fall, 2 in a collision, 12 squeezed
    shape: str = "disc"  # or "box" (2R wide), "point" (one point and no outline, which needs Scheme.nezamabadi2017())
    outlined: bool = False  # contact by outlines even for points, which have none
    mean_dilatation: bool = False
    gap: float | None = None  # between two bodies at the start, over R; None: they close it in the first step
    steps: int = 150  # at most
    quarter_turns: int = 0
    mirrored: bool = False  # x -> -x, before turning
    order: tuple[int, ...] = ()  # of the bodies; as they come if empty
    seed: int = 0  # of the packing
    length: float = 1e-3  # R [m]
    stress: float = 10e6  # E [Pa]
    density: float = 990.0  # [kg/m3]
    scheme: dict[str, Any] = field(default_factory=dict)  # further options of Scheme
    loose: tuple[float, ...] = field(default=LOOSE, repr=False)  # solid fractions to try to pack discs at

    @property
    def cell(self) -> float:
        """Side h of the cells [m]."""
        return self.length / self.cells

    @property
    def speed(self) -> float:
        """Wave speed c [m/s]."""
        return float(WAVE * np.sqrt(self.stress / self.density))

    @property
    def dt(self) -> float:
        """[s]."""
        return self.dt_c_h * self.cell / self.speed

    @property
    def spacing(self) -> float:
        """Of the points, over R."""
        return 1.0 / (self.cells * np.sqrt(self.points_per_cell))


@dataclass(frozen=True)
class Case:
    """A scene and how to run it."""

    name: str
    parameters: Parameters
    scene: skmpm.Scene
    dt: float  # [s]
    until: float  # [s]
    scheme: skmpm.Scheme


@dataclass(frozen=True)
class Piece:
    """A body before it is scaled: lengths in R, speeds in c."""

    centre: tuple[float, float]
    radius: float = 1.0
    velocity: tuple[float, float] = (0.0, 0.0)
    spin: float = 0.0  # [c/R]
    angle: float = 0.0  # by which its points are turned; a disc has a boundary point at angle 0


@dataclass(frozen=True)
class Plane:
    """A wall before it is scaled."""

    point: tuple[float, float]
    normal: tuple[float, float]
    velocity: tuple[float, float] = (0.0, 0.0)


def fall(parameters: Parameters) -> Case:
    """Bodies apart from each other, slowly spinning, fall from rest; they reach the closing speed at 10 R/c."""
    n = parameters.bodies or 1
    columns = int(np.ceil(np.sqrt(n)))
    spin = 0.25 * parameters.closing
    pieces = [Piece((4.0 * (i % columns), 4.0 * (i // columns)), spin=spin) for i in range(n)]
    duration = _duration(10.0, parameters)
    return _case("fall", parameters, pieces, (), duration, gravity=(0.0, -parameters.closing / 10.0))


def collision(parameters: Parameters) -> Case:
    """Pairs of bodies hit each other obliquely: two discs of radii 1 and 0.9, boundary points first, or two boxes."""
    n = 2 if parameters.bodies is None else parameters.bodies
    half = 0.5 * parameters.closing
    gap = gap_of(parameters)
    if parameters.shape == "disc":
        reach, other, slide, angle = 1.9 + gap, 0.9, 0.0, OBLIQUE
        apart = (reach * np.cos(OBLIQUE), reach * np.sin(OBLIQUE))
    else:
        apart, other, slide, angle = (2.0 + gap, 0.5), 1.0, 0.5 * half, 0.0
    pieces = []
    for i in range(n):
        (x, y), radius, sign, turned = ((0.0, 0.0), 1.0, 1.0, 0.0) if i % 2 == 0 else (apart, other, -1.0, np.pi)
        place = (x, y + 5.0 * (i // 2))
        pieces.append(Piece(place, radius, velocity=(sign * half, sign * slide), angle=angle + turned))
    return _case("collision", parameters, pieces, (), _duration(20.0, parameters))


def gap_of(parameters: Parameters) -> float:
    """Gap between two bodies at the start, over R."""
    return (
        min(GAP, 0.5 * parameters.closing * parameters.dt_c_h) / parameters.cells
        if parameters.gap is None
        else parameters.gap
    )


def squeeze(parameters: Parameters) -> Case:
    """Discs of radii 0.74 to 1.26 R in a box, or a lattice of other shapes, squeezed by a lid, with friction."""
    n = 12 if parameters.bodies is None else parameters.bodies
    centres, radii, width, height = _packed(n, parameters)
    solid = float((np.pi if parameters.shape == "disc" else 4.0) * (radii**2).sum())
    pieces = [Piece((x, y), radius) for (x, y), radius in zip(centres.T.tolist(), radii.tolist(), strict=True)]
    planes = (
        Plane((0.0, 0.0), (0.0, 1.0)),
        Plane((0.0, height), (0.0, -1.0), velocity=(0.0, -parameters.closing)),
        Plane((0.0, 0.0), (1.0, 0.0)),
        Plane((width, 0.0), (-1.0, 0.0)),
    )
    travel = height - solid / (width * parameters.solid_fraction)
    if travel <= 0.0:
        raise ValueError(f"the box starts at a solid fraction of {solid / (width * height):.3g}; end above it")
    duration = min(travel / parameters.closing, parameters.steps * parameters.dt_c_h / parameters.cells)
    return _case("squeeze", parameters, pieces, planes, duration)


def crush(parameters: Parameters) -> Case:
    """One body between a floor and a lid that comes down to the floor and through it: it cannot end well."""
    planes = (
        Plane((0.0, 0.0), (0.0, 1.0)),
        Plane((0.0, 2.0), (0.0, -1.0), velocity=(0.0, -parameters.closing)),
    )
    return _case("crush", parameters, [Piece((0.0, 1.0))], planes, 2.02 / parameters.closing)


SCENES: dict[str, Callable[[Parameters], Case]] = {"fall": fall, "collision": collision, "squeeze": squeeze}


def _duration(usual: float, parameters: Parameters) -> float:
    """Time to simulate [R/c]: as usual, but at least three steps and at most `parameters.steps`."""
    step = parameters.dt_c_h / parameters.cells
    return float(np.clip(usual, 3.0 * step, parameters.steps * step))


@cache
def packed_discs(n: int, seed: int, loose: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Centres (2, n), radii (n,), width and height of the box, for discs as dense as so many can be packed."""
    radii = np.random.default_rng(seed).uniform(*RADII, n) / np.mean(RADII)
    width = max(float(np.sqrt(np.pi * (radii**2).sum() / 0.84)), 2.05 * radii.max())
    jammed = next((fraction for few, fraction in JAMMED if n <= few), 1.0)
    for fraction in (f for f in loose if f < jammed):
        try:
            placed = skmpm.packing(radii, width, solid_fraction=fraction, seed=seed)
        except skmpm.PackingError:
            continue
        return placed.centres, placed.radii, placed.width, placed.height
    raise ValueError(f"{n} discs do not pack at a solid fraction of {loose[-1]}")


def _packed(n: int, parameters: Parameters) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Centres (2, n), radii (n,), width and height of the box."""
    if parameters.shape == "disc":
        return packed_discs(n, parameters.seed, parameters.loose)
    pitch, columns = 2.02, int(np.ceil(np.sqrt(n)))
    number = np.arange(n)
    centres = 1.01 + pitch * np.stack([number % columns, number // columns])
    return centres, np.ones(n), pitch * columns, float(centres[1].max() + 1.01)


def _case(
    name: str,
    parameters: Parameters,
    pieces: list[Piece],
    planes: tuple[Plane, ...],
    duration: float,
    *,
    gravity: tuple[float, float] = (0.0, 0.0),
) -> Case:
    """Turned, shifted and scaled."""
    turn = np.linalg.matrix_power(np.array([[0.0, -1.0], [1.0, 0.0]]), parameters.quarter_turns % 4)
    turn = turn @ np.diag([-1.0, 1.0]) if parameters.mirrored else turn
    shift = parameters.cell * (np.asarray(parameters.offset) + np.asarray(parameters.origin))
    L, c = parameters.length, parameters.speed

    def place(x):
        return L * (turn @ np.asarray(x, dtype=float)) + shift

    bodies = []
    for i in parameters.order or range(len(pieces)):
        piece, odd = pieces[i], (i + len(pieces)) % 2 == 1  # a single body counts as the other one
        material = skmpm.NeoHookean(
            parameters.stress * (parameters.stiffness_ratio if odd else 1.0),
            parameters.nu,
            parameters.density * (parameters.density_ratio if odd else 1.0),
        )
        points = _points(piece, parameters, turn, shift)
        velocity, spin = c * (turn @ piece.velocity), piece.spin * c / L * float(np.linalg.det(turn))
        bodies.append(skmpm.Body(points, material, velocity=velocity, spin=spin))
    walls = [
        skmpm.Wall(place(p.point), turn @ p.normal, velocity=c * (turn @ p.velocity), friction=parameters.friction)
        for p in planes
    ]
    scene = skmpm.Scene(
        bodies, cell=parameters.cell, walls=walls, friction=parameters.friction, gravity=c**2 / L * (turn @ gravity)
    )
    seeds_way = parameters.shape == "point" and not parameters.outlined
    scheme = (
        skmpm.Scheme.nezamabadi2017()
        if seeds_way
        else skmpm.Scheme(mean_dilatation=parameters.mean_dilatation, **parameters.scheme)
    )
    return Case(name, parameters, scene, parameters.dt, duration * L / c, scheme)


def _points(piece: Piece, parameters: Parameters, turn: np.ndarray, shift: np.ndarray) -> skmpm.Points:
    """The body's points in metres, turned and shifted."""
    x, y = piece.centre
    if parameters.shape == "point":
        points = skmpm.Points(np.array([[x], [y]]), np.array([np.pi * piece.radius**2]))
    elif parameters.shape == "box":
        points = skmpm.box(
            (x - piece.radius, y - piece.radius), (2.0 * piece.radius,) * 2, spacing=parameters.spacing
        )
    else:
        points = skmpm.disc((0.0, 0.0), piece.radius, spacing=parameters.spacing)
        (cos, sin), centre = (np.cos(piece.angle), np.sin(piece.angle)), np.array([[x], [y]])
        turned = np.array([[cos, -sin], [sin, cos]]) @ points.x if piece.angle else points.x
        points = skmpm.Points(centre + turned, points.volume, points.outline)
    loops = tuple(loop[::-1] for loop in points.outline) if parameters.mirrored else points.outline
    where = parameters.length * (turn @ points.x) + shift[:, None]
    return skmpm.Points(where, parameters.length**2 * points.volume, loops)
