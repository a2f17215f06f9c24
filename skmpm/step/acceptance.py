"""The five checks of a solved step: inversion, energy gain, folds, tunnelling, penetration."""

from __future__ import annotations

import numpy as np

from skmpm import outline
from skmpm.arrays import Array, Ints
from skmpm.contact import acts_at_grid_nodes
from skmpm.material import Rigid, determinant, is_linear
from skmpm.outline.crossings import apart
from skmpm.scene import MAX_OVERLAP, TOUCHING, Scene, State, fitted_motions, material_at, overlaps
from skmpm.scheme import Scheme
from skmpm.step.errors import StepRejected, pair, place
from skmpm.step.statics import TOO_FAR
from skmpm.step.terms import ENERGY_TOLERANCE, Budget

MAX_WALL_PENETRATION = 0.05  # [cells] (test_acceptance)
# [cells] of outline between crossing segments: a shorter fold is hardly resolved by the grid. From 1 to 4 tests pass.
UNRESOLVED_FOLD = 2.0
FOLDS = "use smaller loads, a finer cell or rounder corners"
PASSES = "use a smaller cell if these parts were less than a cell apart at the start"
# Over the energy exchanged in a step (`Budget.exchanged`): gain by negative curvature of the potential. A body that
# rotates on what it is pressed on meets it up to a rotation of 0.02 to 0.04 rad.
CURVATURE_TOLERANCE = 0.01
# Over the largest energy: gain of the energy that does not oscillate (`Budget.swing`) in all steps of a run with a
# scheme that dissipates nothing.
MAX_GAIN = 0.05


def check_step(scene: Scene, scheme: Scheme, before: State, after: State, budget: Budget, solves: int = 1) -> float:
    """Overlap area over the area of all bodies after a step; StepRejected if the step violates a check.

    No point is inverted, bodies gain no energy without work, no outline folds, nothing moves so far that contact may
    go undetected, and nothing lies deep in a wall or in a body.

    Solves of a static step detect contacts anew; those after the first may move bodies further.
    """
    _check_points(scene, after, budget)
    if scheme.inertia:
        _check_push_out(scene, before, after, budget)
        if scheme.theta == 1.0:
            _check_gain(before, after, budget)
        else:
            _check_total_energy(scheme, before, after, budget)
    _check_crossings(scene, after)
    if not (scene.can_touch or after.contacts.gap.size):
        return 0.0
    exact = not acts_at_grid_nodes(scheme.contact)
    _check_travel(scene, before, after, exact, (solves - 1) * TOO_FAR * scene.cell)
    if exact:
        _check_walls(scene, after)
    return _check_overlap(scene, after)


def _check_points(scene: Scene, after: State, budget: Budget) -> None:
    """Raise StepRejected if a point is inverted."""
    if np.isfinite(budget.elastic[1]) and float(after.volume.min()) > 0.0:
        return
    worst = int(np.argmin(determinant(after.F)))
    b, material = int(after.body[worst]), material_at(scene, worst)
    linear = not isinstance(material, Rigid) and is_linear(material)
    remedy = f"use NeoHookean: {type(material).__name__} holds for small strains" if linear else ""
    where = f"body {b} near {place(after.x[:, worst], scene.cell)}"
    raise StepRejected(where, "points are inverted (det F <= 0) at the end of the step", remedy)


def _check_push_out(scene: Scene, before: State, after: State, budget: Budget) -> None:
    """Raise StepRejected if the removal of an overlap takes more energy than there is.

    Contact removes an overlap within the step, at a speed that grows as the step gets shorter. Overlaps up to
    `TOUCHING`, which bodies may begin with, are exempt, and those that `Scene.overlap` says are meant.
    """
    available = budget.before + abs(budget.external)
    if budget.overlap > max(TOUCHING * scene.cell, scene.overlap) and budget.push_out > available:
        raise StepRejected(
            pair(budget.overlapping),
            f"they overlap by {budget.overlap / scene.cell:.2g} cells, and to part them in a step of"
            f" {after.t - before.t:.2g} s takes {budget.push_out / max(available, 1e-300):.2g} times the energy that"
            " there is",
            "shorter steps push harder: use a shorter dt before they overlap, smaller cells, or end earlier",
            retryable=False,
        )


def _check_gain(before: State, after: State, budget: Budget) -> None:
    """Raise StepRejected if the bodies gain more energy than the work done on them and the tolerance.

    In a solved step of backward Euler the energy changes by the work of loads, walls and supports, minus
    1/2 |v1 - v0|_M^2, minus R = E_s(u0) - E_s(u1) + dt dE_s/du(u1) . w, E_s the stored energy, contacts included.
    R is half the second derivative of E_s along the displacement increment: negative, so that energy is gained, where
    bodies under pressure rotate or a column buckles. Such a gain is a fraction of the energy exchanged that decreases
    with dt.
    """
    exchanged, round_off = budget.exchanged, ENERGY_TOLERANCE * budget.largest
    if budget.surplus > round_off + CURVATURE_TOLERANCE * exchanged:  # seldom: the work at contacts takes time
        exchanged += _exchanged_at_contacts(before, after)
    if budget.surplus > round_off + CURVATURE_TOLERANCE * exchanged:
        b = after.body[np.argmin(determinant(after.F))]
        of = f"{_percent(budget.surplus, exchanged)} of the energy exchanged in the step"
        tolerance = _percent(CURVATURE_TOLERANCE, 1.0)
        raise StepRejected(f"body {b}", f"the bodies gain energy without work, {of} (tolerance {tolerance})")


def _check_total_energy(scheme: Scheme, before: State, after: State, budget: Budget) -> None:
    """Raise StepRejected if the bodies have gained energy since the start of the run: steps are unstable.

    The midpoint rule is where bodies deform much in a step (Simo & Tarnow, ZAMP 43 (1992) 757-792), by so little in
    each that no single one is suspicious. What small motions seem to gain at the ends of steps (`Budget.swing`) does
    not count.
    """
    gained = before.report.energy.gained + budget.surplus - max(budget.swing, 0.0)
    largest = max(before.report.energy.largest, budget.largest)
    if gained > MAX_GAIN * largest:
        b = after.body[np.argmin(determinant(after.F))]
        raise StepRejected(
            f"body {b}",
            f"since the start of the run the bodies have gained {_percent(gained, largest)} of their largest energy"
            f" without work (tolerance {_percent(MAX_GAIN, 1.0)}): steps with theta ="
            f" {scheme.theta:g} of this length are unstable here",
            "begin again with a smaller dt, or use theta = 1",
            retryable=False,
        )


def _exchanged_at_contacts(before: State, after: State) -> float:
    """Bound on the energy that bodies exchange at their contacts in a step [J/m].

    Every contact force times what it moves along: the relative displacement of the two bodies, and of each the motion
    of the contact point about the centre by rotation. The sum of the works may be zero, as for a body that rolls on a
    floor or is carried by a plate. R is a share of this bound, the displacements over the radii of curvature.
    """
    contacts, centre = after.contacts, after.centres
    *mean, turned = fitted_motions(after.x, after.x - before.x, after.mass, after.body)
    moved = np.stack(mean)
    path, displacement = np.zeros(contacts.gap.size), []
    for end, side in enumerate(contacts.bodies):
        on_wall, b = side < 0, np.maximum(side, 0)
        path += np.where(on_wall, 0.0, np.abs(turned[b]) * np.hypot(*(contacts.at(end) - centre[:, b])))
        wall = np.where(on_wall, -1 - side, 0)
        of_walls = (after.walls - before.walls)[wall].T if after.walls.size else np.zeros_like(contacts.x)
        displacement.append(np.where(on_wall, of_walls, moved[:, b]))
    between = displacement[0] - displacement[1]
    if after.box_rate is not None:
        between -= (after.t - before.t) * after.box_rate @ contacts.image
    path += np.hypot(*between)
    return float(np.hypot(*contacts.force) @ path)


def _percent(value: float, of: float) -> str:
    return f"{100.0 * value / max(of, 1e-300):.2g} %"


def _check_crossings(scene: Scene, after: State) -> None:
    """Raise StepRejected if the outline of a deformable body folds, or penetrates itself by too much.

    Contact constrains boundary points, so chords may cross where parts of a body touch, as between bodies.
    """
    boundary = scene.outlines
    if boundary.size == 0:
        return
    x = after.x[:, boundary.point]
    pairs = outline.crossings(boundary, x, np.flatnonzero(scene.deformable))
    if pairs.size == 0:
        return
    local = apart(boundary, x, *pairs) <= UNRESOLVED_FOLD * scene.cell
    if local.any():
        raise _crossed(boundary, x, pairs[:, np.argmax(local)], scene.cell, ", where it folds", FOLDS)
    for b in np.unique(boundary.body[pairs[0]]):
        depth = float(outline.depth(boundary, x, b).max(initial=0.0)) / scene.cell
        if depth > MAX_OVERLAP:
            first = pairs[:, np.argmax(boundary.body[pairs[0]] == b)]
            raise _crossed(boundary, x, first, scene.cell, f", {depth:.3g} cells deep", PASSES)


def _crossed(
    boundary: outline.Outlines, x: Array, segments: Ints, cell: float, how: str, remedy: str
) -> StepRejected:
    """The error of an outline of which two segments (2,) cross."""
    first, second = (place(at, cell) for at in x[:, segments].T)
    problem = f"its outline crosses itself near {first} and {second}{how}"
    return StepRejected(f"body {boundary.body[segments[0]]}", problem, remedy)


def _check_travel(scene: Scene, before: State, after: State, exact: bool, further: float) -> None:
    """Raise StepRejected if a point moves so far, relative to the mean or a wall, that contact may go undetected.

    Later solves of a static step may have moved it `further` [m].

    With outlines, bodies that tunnel by less than their thickness overlap, which `_check_overlap` detects.
    """
    moved = after.x - before.x
    relative = moved if before.box is None else moved - _affine(before, after)
    square = ((relative - (relative @ before.mass / before.mass.sum())[:, None]) ** 2).sum(axis=0)
    fastest = int(np.argmax(square))
    largest = float(np.sqrt(square[fastest]))
    if largest > further + (scene.max_motion if exact else scene.cell):
        raise _tunnelling(scene, before, fastest, largest)
    for normal, start, end in zip(scene.normals.T, before.walls, after.walls, strict=True):
        near = np.flatnonzero(scene.movable[after.body] & (normal @ after.x < normal @ end + scene.cell))
        approach = -normal @ (moved[:, near] - (end - start)[:, None])
        if float(approach.max(initial=0.0)) > further + scene.cell:
            raise _tunnelling(scene, before, int(near[np.argmax(approach)]), float(approach.max()))


def _affine(before: State, after: State) -> Array:
    """Displacements (2, n) [m] with which the points would follow the periodic box."""
    assert after.box_rate is not None
    F = np.linalg.inv(np.eye(2) - (after.t - before.t) * after.box_rate)  # not from the edges, which may be others
    return np.asarray((F - np.eye(2)) @ before.x)


def _tunnelling(scene: Scene, before: State, point: int, moved: float) -> StepRejected:
    """The error of a point that has moved by so much [m]."""
    where = f"body {before.body[point]} near {place(before.x[:, point], scene.cell)}"
    problem = f"a point moves {moved / scene.cell:.3g} cells past others in one step, and may pass through them"
    return StepRejected(where, problem)


def _check_walls(scene: Scene, after: State) -> None:
    """Raise StepRejected if a point lies behind a wall; contact constrains boundary points only."""
    fixed = ~scene.movable[after.body]
    for i, (normal, point) in enumerate(zip(scene.normals.T, after.walls, strict=True)):
        depth = (normal @ point - normal @ after.x) / scene.cell
        depth[fixed] = 0.0
        if float(depth.max()) > MAX_WALL_PENETRATION:
            deepest = int(np.argmax(depth))
            raise StepRejected(
                f"body {after.body[deepest]} and wall {i} near {place(after.x[:, deepest], scene.cell)}",
                f"a point lies {depth.max():.3g} cells behind the wall",
                "use a smaller cell, or compress less",
            )


def _check_overlap(scene: Scene, after: State) -> float:
    """Overlap area over that of all bodies, by their outlines, zero without; StepRejected if one lies too deep."""
    boundary, bodies = scene.outlines, len(scene.bodies)
    if (bodies == 1 and after.box is None) or boundary.point.size == 0:
        return 0.0
    x = after.x[:, boundary.point]
    pairs, shared, depth = overlaps(scene, x, after.box)
    if float(depth.max(initial=0.0)) > MAX_OVERLAP * scene.cell:
        a, b = pairs[:, np.argmax(depth)]
        raise StepRejected(f"bodies {a} and {b}", f"they overlap by {depth.max() / scene.cell:.3g} cells")
    return float(shared.sum() / outline.area(boundary, x, bodies).sum())
