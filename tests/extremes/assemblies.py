"""Stacks of bodies of any shape on a floor, between walls, with supports and loads: scenes of many small numbers.

Built with the floor at y = 0 in units of the bodies' size R and of E; then turned, shifted and scaled. Gravity is
turned against the floor, which makes slopes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scenes import Case
from shapes import shape_of, stacked

import skmpm

LENGTH, STRESS, DENSITY = 1e-3, 1e6, 1000.0  # R [m], E [Pa], [kg/m3]
SPEED = float(np.sqrt(STRESS / DENSITY))  # [m/s]
SIDES = ("bottom", "top", "left", "right")


@dataclass(frozen=True)
class Piece:
    """A body, before it is placed."""

    shape: str = "disc"
    aspect: float = 1.0  # of an ellipse or a box, height over width
    angle: float = 0.0  # [rad]
    shift: float = 0.0  # of the centre from that of the body below
    linear: bool = False  # LinearElastic, else NeoHookean
    nu: float = 0.3
    stiffness: float = 1.0  # over E
    speed: tuple[float, float] = (0.0, 0.0)  # at the start, over c


@dataclass(frozen=True)
class Hold:
    """A support on a side of a body: None leaves a component free."""

    body: int
    side: str
    motion: tuple[float | None, float | None]  # [cells per step]
    called: bool = False  # velocity a function of time


@dataclass(frozen=True)
class Pull:
    """A load on a side or on all of a body."""

    body: int
    side: str
    force: tuple[float, float]  # over E R
    called: bool = False


@dataclass(frozen=True)
class Assembly:
    """All that is drawn."""

    pieces: tuple[Piece, ...] = (Piece(),)
    still: bool = True  # quasi-static steps
    weight: float = 1e-3  # density g R / E
    slope: float = 0.0  # of the floor against gravity [rad]
    turned: float = 0.0  # all of it, against the grid [rad]
    floor: float | None = 0.5  # friction; None: no floor
    left: float | None = None
    right: float | None = None
    lid: float | None = None  # friction
    closing: float = 0.0  # of the lid [cells per step]
    friction: float = 0.5  # between bodies
    gap: float = 0.0  # between bodies and to walls at the start [cells]
    supports: tuple[Hold, ...] = ()
    loads: tuple[Pull, ...] = ()
    cells: float = 3.0  # R/h
    spacing: float = 0.7  # of points [cells]
    offset: tuple[float, float] = (0.137, 0.291)  # [cells]
    dt_c_h: float = 10.0  # time step over h/c
    steps: int = 3
    scheme: dict[str, Any] = field(default_factory=dict)


def drawn(number: Callable, choice: Callable) -> Assembly:
    """An assembly from what draws a number between two and one of some options."""
    count = choice(1, 2, 3, 4, 5)
    still = choice(True, False)
    weight = 10.0 ** number(-5.0, -1.5) * choice(1.0, 1.0, 1.0, 1.0, 0.0)
    wall = (0.5, 0.0, 0.2, 1.0)
    left, right = choice(None, "wall"), choice(None, "wall")
    lid = choice(None, None, None, "wall")
    supports = tuple(_hold(number, choice, count) for _ in range(choice(0, 0, 1, 2)))
    loads = tuple(_pull(number, choice, count, weight) for _ in range(choice(0, 0, 1, 2)))
    cells = min(10.0 ** number(np.log10(1.6), np.log10(5.0)), float(np.sqrt(220.0 / (4.0 * count))))
    return Assembly(
        pieces=tuple(_piece(number, choice, moving=not still) for _ in range(count)),
        still=still,
        weight=weight,
        slope=choice(0.0, 0.0, number(0.0, 0.15), number(-1.2, 1.2)),
        turned=choice(0.0, 0.5 * np.pi, np.pi, number(0.0, 2.0 * np.pi)),
        floor=choice(*wall, None) if supports else choice(*wall),
        left=choice(*wall) if left else None,
        right=choice(*wall) if right else None,
        lid=choice(*wall) if lid else None,
        closing=choice(0.0, number(0.0, 0.3)) if lid else 0.0,
        friction=choice(*wall),
        gap=choice(0.0, 0.0, number(0.0, 0.2)),
        supports=supports,
        loads=loads,
        cells=cells,
        spacing=choice(0.7, number(0.5, 0.75)),
        offset=(choice(number(0.0, 1.0), 0.0, 0.5), choice(number(0.0, 1.0), 0.0, 0.5)),
        dt_c_h=10.0 ** number(-0.5, 1.7),
        steps=choice(3, 1, 6),
        scheme=choice({}, {}, {"mean_dilatation": True}, {"newton_tol": 1e-6}),
    )


def _piece(number: Callable, choice: Callable, *, moving: bool) -> Piece:
    shape = choice("disc", "box", "ellipse", "disc", "box", "ellipse", "L", "C", "plus", "dumbbell", "annulus")
    return Piece(
        shape=shape,
        aspect=choice(1.0, number(0.4, 1.0)) if shape in ("box", "ellipse") else 1.0,
        angle=choice(0.0, 0.5 * np.pi, number(0.0, 2.0 * np.pi)),
        shift=choice(0.0, number(-0.2, 0.2), number(-1.0, 1.0)),
        linear=choice(False, False, True),
        nu=number(0.2, 0.49),
        stiffness=choice(1.0, 1.0, 10.0 ** number(-1.0, 1.0)),
        speed=choice((0.0, 0.0), (0.0, -1e-3), (3e-3, -1e-3), (0.0, -0.03)) if moving else (0.0, 0.0),
    )


def _hold(number: Callable, choice: Callable, count: int) -> Hold:
    speed = choice(0.0, number(-0.1, 0.1), number(-0.5, 0.5))
    motion = choice((speed, None), (None, speed), (0.0, speed), (0.0, 0.0))
    return Hold(choice(0, *range(count)), choice("bottom", *SIDES, "core"), motion, choice(False, True))


def _pull(number: Callable, choice: Callable, count: int, weight: float) -> Pull:
    size = choice(weight or 1e-3, 10.0 ** number(-5.0, -1.5))
    angle = choice(-0.5 * np.pi, 0.0, number(0.0, 2.0 * np.pi))
    force = (size * float(np.cos(angle)), size * float(np.sin(angle)))
    return Pull(choice(*range(count)), choice(*SIDES, "all"), force, choice(False, True))


def build(assembly: Assembly) -> Case:
    """The scene of an assembly."""
    a, h = assembly, LENGTH / assembly.cells
    dt = a.dt_c_h * h / SPEED
    turn = np.array([[np.cos(a.turned), -np.sin(a.turned)], [np.sin(a.turned), np.cos(a.turned)]])
    shift = h * np.array(a.offset)[:, None]
    shapes = [(shape_of(p.shape, p.aspect, a.spacing / a.cells), p.angle, p.shift) for p in a.pieces]
    placed = stacked(shapes, a.gap / a.cells)
    bodies = [_body(piece, points, turn, shift) for piece, points in zip(a.pieces, placed, strict=True)]
    supports = [
        skmpm.Support(_exactly(placed, hold.body, hold.side), velocity=_velocity(hold, turn, h / dt))
        for hold in a.supports
    ]
    loads = [skmpm.Load(_exactly(placed, pull.body, pull.side), force=_force(pull, turn, dt)) for pull in a.loads]
    g = a.weight * STRESS / (DENSITY * LENGTH)
    scene = skmpm.Scene(
        bodies,
        cell=h,
        walls=_walls(a, placed, turn, shift, h / dt),
        supports=supports,
        loads=loads,
        friction=a.friction,
        gravity=g * turn @ np.array([np.sin(a.slope), -np.cos(a.slope)]),
    )
    return Case("assembly", a, scene, dt, a.steps * dt, skmpm.Scheme(inertia=not a.still, **a.scheme))


def _body(piece: Piece, points: skmpm.Points, turn: np.ndarray, shift: np.ndarray) -> skmpm.Body:
    kind = skmpm.LinearElastic if piece.linear else skmpm.NeoHookean
    material = kind(E=piece.stiffness * STRESS, nu=piece.nu, density=DENSITY)
    scaled = skmpm.Points(LENGTH * (turn @ points.x) + shift, LENGTH**2 * points.volume, points.outline)
    return skmpm.Body(scaled, material, velocity=SPEED * turn @ np.array(piece.speed))


def _velocity(hold: Hold, turn: np.ndarray, unit: float) -> Any:
    """Along the axes of the grid: one component follows the nearest of them, both are turned."""
    x, y = hold.motion
    if x is not None and y is not None:
        value = tuple((unit * turn @ np.array([x, y])).tolist())
    else:
        along = turn[:, 0 if y is None else 1]
        axis, speed = int(np.argmax(np.abs(along))), unit * float(x if y is None else y)
        value = tuple(float(np.sign(along[axis])) * speed if k == axis else None for k in range(2))
    return (lambda t: value) if hold.called else value


def _force(pull: Pull, turn: np.ndarray, dt: float) -> Any:
    full = STRESS * LENGTH * turn @ np.array(pull.force)
    return (lambda t: full * min(1.0, 0.5 * (1.0 + t / dt))) if pull.called else full


def _exactly(placed: list[skmpm.Points], body: int, side: str) -> Callable:
    """The points of a body on one of its sides, as the floor's frame has it; "core": around the middle."""
    chosen = []
    for b, points in enumerate(placed):
        chosen.append(_side(points, side) if b == body else np.zeros(points.size, dtype=bool))
    mask = np.concatenate(chosen)
    return lambda x: mask


def _side(points: skmpm.Points, side: str) -> np.ndarray:
    if side == "all":
        return np.ones(points.size, dtype=bool)
    middle = 0.5 * (points.x.min(axis=1) + points.x.max(axis=1))
    if side == "core":
        from_it = np.hypot(*(points.x - middle[:, None]))
        return from_it <= max(0.3, float(from_it.min()) + 1e-9)
    axis, sign = {"bottom": (1, -1.0), "top": (1, 1.0), "left": (0, -1.0), "right": (0, 1.0)}[side]
    height = sign * points.x[axis]
    on_boundary = np.zeros(points.size, dtype=bool)
    on_boundary[np.concatenate(points.outline)] = True
    return on_boundary & (height >= height.max() - 0.02)


def _walls(a: Assembly, placed: list[skmpm.Points], turn: np.ndarray, shift: np.ndarray, unit: float) -> list:
    """The floor, the walls to both sides and the lid, where they are."""
    x = np.concatenate([points.x for points in placed], axis=1)
    (left, bottom), (right, top) = x.min(axis=1), x.max(axis=1)
    gap = a.gap / a.cells
    lid = (0.0, -unit * a.closing)
    planes = [
        (a.floor, (0.0, bottom - gap), (0.0, 1.0), (0.0, 0.0)),
        (a.left, (left - gap, 0.0), (1.0, 0.0), (0.0, 0.0)),
        (a.right, (right + gap, 0.0), (-1.0, 0.0), (0.0, 0.0)),
        (a.lid, (0.0, top + gap), (0.0, -1.0), lid),
    ]
    return [
        skmpm.Wall(
            LENGTH * (turn @ np.array(point)) + shift[:, 0],
            turn @ np.array(normal),
            velocity=turn @ np.array(velocity),
            friction=friction,
        )
        for friction, point, normal, velocity in planes
        if friction is not None
    ]
