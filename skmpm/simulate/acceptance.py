"""What a step must not do, however well its equations are solved: jump, gain energy, sink into walls or bodies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm import outline
from skmpm.contact import point_to_curve
from skmpm.implicit import NotConverged
from skmpm.material import Rigid, determinant, is_linear
from skmpm.scene import Scene, State
from skmpm.scheme import Scheme
from skmpm.simulate.energy_budget import Budget
from skmpm.simulate.initial_state import can_touch

Array = NDArray[np.float64]

MAX_TRAVEL = 1.0  # [cells] in one step; contact finds what is less than a cell deep
THICKNESS_SHARE = 0.25  # of the thinnest part of all bodies, which what moves past the others must not pass unseen
MAX_WALL_DEPTH = 0.05  # [cells] of a point behind a wall
MAX_BODY_DEPTH = 0.25  # [cells] of one body in another
UNRESOLVED_FOLD = (
    2.0  # [cells] of the outline between crossing segments: less is a fold of what the grid hardly resolves
)
ENERGY_TOLERANCE = 5e-7  # of the energies, for tolerances and rounding
CURVATURE_SHARE = 0.01  # of the energy that a step exchanges: what it may gain where the potential curves downwards
EXPLICIT_TOLERANCE = 0.05  # of the energies in an explicit step, which swings about the energy it keeps


def check_step(scene: Scene, scheme: Scheme, before: State, after: State, budget: Budget) -> float:
    """Area shared by bodies over the area of all bodies after a step; NotConverged where the step cannot be right."""
    if not (np.isfinite(budget.elastic) and float(after.volume.min()) > 0.0):
        b = int(after.body[np.argmin(determinant(after.F))])
        material = scene.bodies[b].material
        linear = not isinstance(material, Rigid) and is_linear(material)
        small = f" or NeoHookean: {type(material).__name__} holds for small strains" if linear else ""
        remedy = f"use a smaller dt{small}"
        raise NotConverged(f"body {b}", "points are turned inside out at the end of the step", remedy)
    if scheme.inertia and scheme.theta == 1.0:
        _check_energy(scheme, after, budget)
    _check_crossings(scene, after)
    if not can_touch(scene):
        return 0.0
    exact = scheme.contact is point_to_curve
    _check_travel(scene, before, after, exact)
    if exact:
        _check_walls(scene, after)
    return _check_overlap(scene, after, exact)


def _check_energy(scheme: Scheme, after: State, budget: Budget) -> None:
    """The bodies gain no energy, or little of what the step exchanges.

    In a solved step of backward Euler the energy changes by the work of loads, walls and supports less
    1/2 |v1 - v0|_M^2 + R, R = E(u0) - E(u1) + dt E'(u1) w, contacts included. R is half the curvature of the
    potential along the way times its square: negative where pressed bodies rotate or a column buckles, and a share
    of what is exchanged that falls with the length of the step.
    """
    if scheme.explicit:
        limit, of = EXPLICIT_TOLERANCE * budget.largest, f"{_percent(budget.surplus, budget.largest)} of their energy"
    else:
        limit = ENERGY_TOLERANCE * budget.largest + CURVATURE_SHARE * budget.exchanged
        of = f"{_percent(budget.surplus, budget.exchanged)} of what the step exchanges"
    if budget.surplus > limit:
        b = after.body[np.argmin(determinant(after.F))]
        most = _percent(EXPLICIT_TOLERANCE if scheme.explicit else CURVATURE_SHARE, 1.0)
        raise NotConverged(f"body {b}", f"the bodies gain energy from nothing, {of} (at most {most})")


def _percent(value: float, of: float) -> str:
    return f"{100.0 * value / max(of, 1e-300):.2g} %"


def _check_crossings(scene: Scene, after: State) -> None:
    """No deformable body passes through itself: what a body touches are other bodies and walls."""
    boundary = scene.outlines
    if boundary.size == 0:
        return
    x = after.x[:, boundary.point]
    pairs = outline.crossings(boundary, x, np.flatnonzero(scene.deformable))
    if pairs.size == 0:
        return
    longest = int(np.argmax(outline.apart(boundary, x, *pairs)))
    i, j = pairs[:, longest]
    local = float(outline.apart(boundary, x, *pairs)[longest]) <= UNRESOLVED_FOLD * scene.cell
    raise NotConverged(
        f"body {boundary.body[i]}",
        f"its outline crosses itself near ({x[0, i]:.6g}, {x[1, i]:.6g}) and ({x[0, j]:.6g}, {x[1, j]:.6g}) m",
        "it folds there: use smaller loads, a finer cell or rounder corners"
        if local
        else "a body does not touch itself: use smaller loads, or make it of several bodies",
    )


def _check_travel(scene: Scene, before: State, after: State, exact: bool) -> None:
    """No point moves so far from the common motion that it may pass through a body, none arrives at a wall so fast.

    With outlines, bodies that pass each other by less than their thickness overlap, which is looked for.
    """
    moved = after.x - before.x
    relative = np.hypot(*(moved - (moved @ before.mass / before.mass.sum())[:, None]))
    if float(relative.max()) > MAX_TRAVEL * scene.cell:
        farthest = THICKNESS_SHARE * float(np.nanmin(scene.thickness)) if exact else 0.0
        if float(relative.max()) > max(MAX_TRAVEL * scene.cell, farthest):
            raise _jumped(before, int(np.argmax(relative)), float(relative.max()) / scene.cell)
    for normal, start, end in zip(scene.normals.T, before.walls, after.walls, strict=True):
        near = np.flatnonzero(normal @ (after.x - end[:, None]) < scene.cell)
        approach = -normal @ (moved[:, near] - (end - start)[:, None])
        if float(approach.max(initial=0.0)) > MAX_TRAVEL * scene.cell:
            raise _jumped(before, int(near[np.argmax(approach)]), float(approach.max()) / scene.cell)


def _jumped(state: State, point: int, cells: float) -> NotConverged:
    where = f"body {state.body[point]}"
    return NotConverged(where, f"a point moves {cells:.3g} cells past others in one step, and may jump over them")


def _check_walls(scene: Scene, after: State) -> None:
    """Only boundaries are held off walls; what is inside may still be pressed through them."""
    own = scene.deformable[after.body]
    for i, (normal, point) in enumerate(zip(scene.normals.T, after.walls, strict=True)):
        depth = -(normal @ (after.x - point[:, None]))[own] / scene.cell
        if float(depth.max()) > MAX_WALL_DEPTH:
            b = after.body[own][np.argmax(depth)]
            raise NotConverged(
                f"body {b} and wall {i}",
                f"a point lies {depth.max():.3g} cells behind the wall",
                "use a smaller dt or cell, or compress less",
            )


def _check_overlap(scene: Scene, after: State, exact: bool) -> float:
    """Area shared by bodies over the area of all bodies, by outlines; zero without outlines."""
    boundary, bodies = scene.outlines, len(scene.bodies)
    if bodies == 1 or boundary.point.size == 0:
        return 0.0
    x = after.x[:, boundary.point]
    pairs, shared = outline.overlap(boundary, x, bodies)
    size = outline.area(boundary, x, bodies)
    depth = outline.lens_depth(shared, size[pairs]) / scene.cell
    if exact and float(depth.max(initial=0.0)) > MAX_BODY_DEPTH:
        a, b = pairs[:, np.argmax(depth)]
        raise NotConverged(f"bodies {a} and {b}", f"they lie {depth.max():.3g} cells in one another")
    return float(shared.sum() / size.sum())
