"""Checks of a scene before it is simulated."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import ROUND_OFF, Array, Ints
from skmpm.material import ElastoPlastic, Isotropic, Rigid, lacking
from skmpm.outline import centroid, curve, outlines, perimeter
from skmpm.outline.measures import chord_sagitta
from skmpm.points import Points
from skmpm.points import check as check_points
from skmpm.points.cloud import signed_area
from skmpm.scene.check_parts import check_groups, check_kinds, check_loads, check_springs, check_supports
from skmpm.scene.model import Model
from skmpm.scene.objects import Body, Wall, rigid_motion
from skmpm.scene.periodic import Periodic
from skmpm.scene.prescribed import gravity_at
from skmpm.values import LENGTH, SceneError, field_values, motion, not_negative, number, positive, scalar, vector

MAX_AREA_RATIO = 1.5  # of the points' volume and the area in their outline, which may exclude half a spacing
BESIDE = 2.0  # [spacings] between the centres of the points and of the area in their outline
TOUCHING = 1e-3  # [cells] overlap at the start up to which things touch
MAX_OVERLAP = 0.25  # [cells] of an overlap that is meant; more at the end of a step has missed contacts


def check(scene: Model) -> None:
    """Raise SceneError for the first error in the scene."""
    if not scene.bodies:
        raise SceneError("the scene has no bodies; give at least one Body")
    positive("cell", scene.cell, "a cell size in metres, about a fifth of the smallest radius")
    not_negative("cohesion between bodies", scene.cohesion, "a stress in Pa")
    not_negative("cohesion_range", scene.cohesion_range, LENGTH)
    not_negative("overlap", scene.overlap, LENGTH)
    if scene.overlap > MAX_OVERLAP * scene.cell:
        raise SceneError(
            f"overlap = {scene.overlap:g} m is {scene.overlap / scene.cell:.3g} cells; give at most a quarter of a"
            " cell, or use a larger cell"
        )
    check_kinds(scene)
    for i, body in enumerate(scene.bodies):
        _check_body(f"body {i}", body)
    if not scene.deformable.any():
        raise SceneError(
            f"all {len(scene.bodies)} bodies are Rigid; give at least one of a deformable material, as NeoHookean"
        )
    if callable(scene.gravity):
        gravity_at(scene, scene.initial_positions[:, scene.movable[scene.owner]], 0.0)
    else:
        vector("gravity", scene.gravity)
    for i, wall in enumerate(scene.walls):
        _check_wall(f"wall {i}", wall)
    _ = scene.frictions  # with their checks, and kept
    check_supports(scene)
    check_loads(scene)
    check_springs(scene)
    if scene.periodic is not None:
        _check_periodic(scene, scene.periodic)
    _check_overlaps(scene)


def _check_periodic(scene: Model, periodic: Periodic) -> None:
    periodic.check()
    edges = periodic.box
    if edges.shape[1] == 2 and scene.walls:
        raise SceneError(
            f"periodic: the scene also has {len(scene.walls)} walls; leave them out, or make the box periodic in one"
            " direction, Periodic(width, None) or Periodic(None, height)"
        )
    inclined = np.flatnonzero(np.abs(edges.T @ scene.normals).max(axis=0, initial=0.0) > ROUND_OFF * edges.max())
    if inclined.size:
        i, along = int(inclined[0]), (0, 1) if edges[0].any() else (1, 0)
        raise SceneError(
            f"periodic: wall {i} with the normal {tuple(scene.normals[:, i].tolist())} crosses the edge of the box;"
            f" walls lie along it, with normals like {along}"
        )


def _check_body(name: str, body: Body) -> None:
    if not isinstance(body.points, Points):
        raise SceneError(
            f"{name}: its points are no skmpm.Points; make them by disc, from_outline, from_mesh or skmpm.Points"
        )
    problem = check_points(body.points)
    if problem:
        raise SceneError(f"{name}: {problem}")
    if not isinstance(body.material, Rigid):
        _check_outline(name, body.points)
    if isinstance(body.material, Mapping):
        check_groups(name, body.points, body.material)
        for group, material in body.material.items():
            _check_material(f"{name}, group {group!r}", material)
    else:
        _check_material(name, body.material)
    _check_motion(name, body)


def _check_material(name: str, material: object) -> None:
    """A material is Rigid or has density, lame, energy, stress and tangent, whatever its class."""
    if isinstance(material, Isotropic):
        positive(f"{name}: Young's modulus E", material.E, "a modulus in Pa")
        nu = number(f"{name}: Poisson's ratio nu", material.nu, "give one between -1 and 0.5")
        if not -1.0 < nu < 0.5:
            raise SceneError(
                f"{name}: Poisson's ratio nu = {nu}; it lies between -1 and 0.5, both excluded; give 0.499 for"
                " what is incompressible"
            )
    if isinstance(material, ElastoPlastic):
        positive(f"{name}: yield_stress", material.yield_stress, "a stress in Pa")
        not_negative(f"{name}: hardening", material.hardening, "a modulus in Pa")
    if not isinstance(material, Rigid) and (problem := lacking(material)):
        raise SceneError(
            f"{name}: material is {material!r}, {problem}; use NeoHookean, ElastoPlastic, Rigid, ... or a material of"
            " your own that passes skmpm.check_material"
        )
    positive(f"{name}: density", material.density, "a density in kg/m3")  # type: ignore[attr-defined]


def _check_outline(name: str, points: Points) -> None:
    """The outline of a deformable body, if it has one, bounds one piece, whose area is that of its points."""
    if not points.outline:
        return
    areas = np.array([signed_area(points.x[:, loop]) for loop in points.outline])
    if (areas > 0.0).sum() > 1:
        raise SceneError(
            f"{name}: its outline has {(areas > 0.0).sum()} outer loops; parts of one body do not touch each other,"
            " make a Body of each"
        )
    boundary = outlines([points.outline], offsets=[0])
    x, inside, volume = points.x[:, boundary.point], float(areas.sum()), float(points.volume.sum())
    spacing = float(np.sqrt(volume / points.size))
    beyond = 0.5 * spacing * float(perimeter(boundary, x, 1)[0])
    if not inside / MAX_AREA_RATIO < volume < MAX_AREA_RATIO * (inside + beyond):
        raise SceneError(
            f"{name}: its points have a volume of {volume:.4g} m2 in all, its outline bounds {inside:.4g} m2; give"
            " volumes in m2 that add up to the body, and an outline along its boundary"
        )
    centre = np.average(points.x, axis=1, weights=points.volume)
    apart = float(np.hypot(*(centre - centroid(boundary, x, 1)[:, 0])))
    if apart > BESIDE * spacing:
        raise SceneError(
            f"{name}: the centre of its points is {apart:.3g} m from that of the area in its outline; give points"
            " that fill this area"
        )


def _check_motion(name: str, body: Body) -> None:
    rigid, spin = isinstance(body.material, Rigid), "give a finite angular velocity in rad/s"
    if callable(body.velocity) and rigid:
        raise SceneError(
            f"{name}: velocity is a function, of a Rigid body; give its velocity at t = 0, or motion = f(t) if it is"
            " prescribed"
        )
    if callable(body.velocity):
        field_values(f"{name}: velocity(x)", body.velocity(body.points.x.copy()), body.points.x)
    else:
        motion(body.velocity, 0.0, f"{name}: velocity")
    spinning = number(f"{name}: spin", body.spin, spin) != 0.0
    if body.motion is None:
        return
    if not rigid:
        raise SceneError(f"{name}: motion of a deformable body; give velocity and spin at t = 0, or a Support")
    held = ~np.isnan(rigid_motion(body, 0.0, name))
    moving = np.asarray(body.velocity, dtype=float) != 0.0
    for what, given in (("velocity", (moving & held[:2]).any()), ("spin", spinning and held[2])):
        if given:
            raise SceneError(
                f"{name}: {what} = {getattr(body, what)} and motion; give one of them for each component"
            )


def _check_wall(name: str, wall: Wall) -> None:
    vector(f"{name}: point", wall.point)
    if not vector(f"{name}: normal", wall.normal).any():
        raise SceneError(f"{name}: normal = {wall.normal!r} has length 0; give the direction towards the bodies")
    motion(wall.velocity, 0.0, f"{name}: velocity")
    driving = [given for given in (wall.force, wall.pressure) if given is not None]
    if len(driving) > 1:
        raise SceneError(f"{name}: force = {wall.force} and pressure = {wall.pressure}; give one of them")
    if wall.mass is not None and not driving:
        raise SceneError(f"{name}: mass = {wall.mass} without force or pressure; give one, or no mass")
    if wall.mass is not None:
        positive(f"{name}: mass", wall.mass, "a mass per metre of thickness in kg/m, or None")
    for given in driving:
        scalar(given, 0.0, f"{name}: driving force or pressure")
    not_negative(f"{name}: cohesion", wall.cohesion, "a stress in Pa")


def check_walls_at_start(scene: Model) -> None:
    """Raise SceneError if a wall cuts a body that forces move at t = 0."""
    walls = dict(enumerate(scene.wall_points))
    remedy = "move the wall or the body, or turn its normal; a wall of a later stage begins in skmpm.continued"
    check_walls(scene, scene.initial_positions, walls, remedy)


def check_walls(scene: Model, x: Array, walls: Mapping[int, ArrayLike], remedy: str) -> None:
    """Raise SceneError if a body that forces move, with points x (2, n), lies behind one of the walls (2,)."""
    own = np.flatnonzero(scene.movable[scene.owner])
    for i, point in walls.items():
        behind = scene.normals[:, i] @ (np.asarray(point)[:, None] - x[:, own])
        if behind.max(initial=0.0) > TOUCHING * scene.cell:
            b = scene.owner[own[np.argmax(behind)]]
            raise SceneError(f"wall {i} cuts body {b}: a point lies {behind.max():.3g} m behind it; {remedy}")


def _check_overlaps(scene: Model) -> None:
    """Bodies may touch at the start, but not overlap by more than `TOUCHING` cells or what is meant."""
    boundary = scene.outlines
    if boundary.point.size == 0:
        return
    x, count = scene.initial_positions[:, boundary.point], len(scene.bodies)
    pairs, area, depth = overlaps(scene, x, scene.initial_box)
    # Where one cuts the other between its boundary points, a circle in the shared area has this radius at least.
    around, chords = perimeter(boundary, x, count)[pairs], chord_sagitta(boundary, x, count)[pairs]
    depth = np.maximum(depth, area / around.min(axis=0) - chords.sum(axis=0))
    if depth.max(initial=0.0) > max(TOUCHING * scene.cell, 1.01 * scene.overlap):
        a, b = pairs[:, np.argmax(depth)]
        if a == b:
            raise SceneError(
                f"body {a} overlaps its own image in the periodic box by {depth.max():.3g} m; make the box wider, or"
                " the body shorter"
            )
        raise SceneError(
            f"bodies {a} and {b} overlap by {depth.max():.3g} m at the start; move them apart or shrink them, or give"
            " Scene(overlap=...), up to a quarter of a cell, if it is meant"
        )


def overlaps(scene: Model, x: Array, box: Array | None) -> tuple[Ints, Array, Array]:
    """Pairs of bodies (2, p) whose boxes overlap, their shared areas (p,) [m2] and depths (p,) [m].

    Boundary points are at x (2, m) [m].
    """
    near = scene.images(x, box, 0.0)
    at, reference = near.at(x, box), scene.initial_positions[:, near.outlines.point]
    return near.depth(curve(near.outlines, reference, at).through(at))
