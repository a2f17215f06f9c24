"""Checks of the parts of a scene: their classes and functions, materials, supports, loads and springs."""

from __future__ import annotations

from collections.abc import Mapping
from inspect import signature

import numpy as np

from skmpm.arrays import EXACT, Bools
from skmpm.material import Rigid
from skmpm.points import Points
from skmpm.scene.functions import POSITIONS, may_be_functions
from skmpm.scene.layout import Layout
from skmpm.scene.model import Model
from skmpm.scene.objects import Body, Load, Pressure, Spring, Support, Wall
from skmpm.scene.periodic import Periodic
from skmpm.scene.point_sets import TURNING, PointSet, prescribed_components, stiffness_of, support_angle
from skmpm.values import SceneError, vector

TIME, PLACES, FIELD = "t", "x", "X, t"  # arguments of functions
REMEDY = {
    TIME: "give a function of the time t [s]",
    PLACES: "give a function of positions x (2, n) [m]",
    FIELD: "give a function of positions X (2, n) [m] and the time t [s]",
}
SHORTEST = 1e-6  # [cells] bar at t = 0, which needs a direction
KINDS = (
    ("body", "skmpm.Body(points, material)", Body),
    ("wall", "skmpm.Wall(point, normal)", Wall),
    ("support", "skmpm.Support(where, velocity=...)", Support),
    ("load", "skmpm.Load(where, force) or skmpm.Pressure(where, value)", Load | Pressure),
    ("spring", "skmpm.Spring(where, stiffness)", Spring),
    ("periodic", "skmpm.Periodic(width, height), or None without a box", Periodic),
)


def check_kinds(scene: Layout) -> None:
    """Raise SceneError for the first part of another class, or function that does not take its arguments."""
    _check_function("gravity", scene.gravity, FIELD)
    boxes = () if scene.periodic is None else (scene.periodic,)
    parts = (scene.bodies, scene.walls, scene.supports, scene.loads, scene.springs, boxes)
    for (kind, remedy, classes), objects in zip(KINDS, parts, strict=True):
        for i, part in enumerate(objects):
            name = kind if part is scene.periodic else f"{kind} {i}"
            if not isinstance(part, classes):
                raise SceneError(f"{name} is a {type(part).__name__}; use {remedy}")
            for what, of in may_be_functions(part).items():
                _check_function(f"{name}: {what}", getattr(part, what), PLACES if of == POSITIONS else TIME)


def _check_function(name: str, function: object, arguments: str) -> None:
    """Raise SceneError for a function that cannot be called with its arguments; it is not called."""
    if not callable(function):
        return
    try:
        accepted = signature(function)
    except ValueError:  # callables that are not written in Python have no signature
        return
    try:
        accepted.bind(*arguments.split(", "))
    except TypeError:
        remedy = REMEDY[arguments]
        if name.startswith("support") and arguments == TIME:
            remedy = f"{remedy}; {TURNING}"
        message = f"{name} takes the arguments {accepted} and is called with ({arguments}); {remedy}"
        raise SceneError(message) from None


def check_groups(name: str, points: Points, materials: Mapping[str, object]) -> None:
    """Raise SceneError unless each group of the points has a deformable material, and each material points."""
    if points.group is None:
        raise SceneError(
            f"{name}: materials are given by group, {_listed(materials)}, and its points have no groups; use"
            " points.with_groups(...) or from_mesh of a mesh with physical groups, or give one material"
        )
    known, count = np.unique(points.group, return_counts=True)
    for group, size in zip(known.tolist(), count.tolist(), strict=True):
        if group not in materials:
            raise SceneError(
                f"{name}: group {group!r} of its points, {size} of {points.size}, has no material; there are those of"
                f" {_listed(materials)}"
            )
    for group, material in materials.items():
        if group not in known:
            raise SceneError(
                f"{name}: there is a material of group {group!r}, and its points have the groups"
                f" {_listed(known.tolist())}; correct the name or leave it out"
            )
        if isinstance(material, Rigid):
            raise SceneError(
                f"{name}, group {group!r}: its material is Rigid, which only whole bodies are; use a stiff material,"
                " and to turn it beds with a moving rest, a Spring at each of its boundary points"
            )


def _listed(names: Mapping[str, object] | list[str]) -> str:
    return ", ".join(repr(name) for name in names)


def check_supports(scene: Model) -> None:
    """Raise SceneError for the first error in the supports."""
    for i, support in enumerate(scene.supports):
        _check_displacement(f"support {i}", support, scene.cell)
        _check_rotation(f"support {i}", support, i)
    for i, (free, supported) in enumerate(zip(scene.free_components, scene.supported, strict=True)):
        hint = "; `motion` holds rigid ones"
        _check_not_empty(f"support {i}: where", scene, supported, scene.deformable, "deformable body", hint)
        if free.all():
            what = "velocity" if scene.supports[i].displacement is None else "displacement"
            raise SceneError(
                f"support {i}: {what} = (None, None) prescribes nothing; give a component or leave it out"
            )
        for axis in np.flatnonzero(~free):
            last = scene.supporting[axis, supported.points]
            if (last != i).any():
                other, point = last[last != i][0], supported.points[last != i][0]
                raise SceneError(
                    f"supports {i} and {other} both hold the {'xy'[axis]} component of the point at"
                    f" {scene.initial_positions[:, point]}; let `where` of one leave it out"
                )


def _check_rotation(name: str, support: Support, i: int) -> None:
    if support.rotation is None:
        if support.centre is not None:
            raise SceneError(f"{name}: centre = {support.centre!r} without a rotation; give one, or no centre")
        return
    if not callable(support.rotation):
        raise SceneError(f"{name}: rotation = {support.rotation!r}; give a function of time t -> angle [rad]")
    if abs(angle := support_angle(support, 0.0, i)) > EXACT:
        raise SceneError(f"{name}: rotation at t = 0 is {angle:g}; give the angle since then, zero at t = 0")
    if support.centre is not None:
        vector(f"{name}: centre", support.centre)
    if np.isnan(prescribed_components(support, 0.0, name)).any():
        raise SceneError(f"{name}: a component is None beside a rotation, whose centre moves as given; give both")


def _check_displacement(name: str, support: Support, cell: float) -> None:
    if support.displacement is None:
        return
    if not callable(support.displacement):
        raise SceneError(f"{name}: displacement = {support.displacement!r}; give a function of time t -> (x, y) [m]")
    if np.array(support.velocity, dtype=object).tolist() != [0.0, 0.0]:
        raise SceneError(f"{name}: velocity = {support.velocity} and displacement; give one of them")
    start = prescribed_components(support, 0.0, f"{name}: displacement")
    if np.abs(np.nan_to_num(start)).max() > EXACT * cell:
        raise SceneError(f"{name}: displacement at t = 0 is {start}; give the displacement since then, zero at t = 0")


def _check_not_empty(name: str, scene: Model, chosen: PointSet, bodies: Bools, which: str, hint: str = "") -> None:
    if chosen.points.size == 0:
        x = scene.initial_positions[:, bodies[scene.owner]]
        raise SceneError(
            f"{name} is true at no point of a {which}; they lie between {x.min(axis=1)} and {x.max(axis=1)},"
            f" the outermost on the boundary: allow for round-off in comparisons{hint}"
        )


def check_loads(scene: Model) -> None:
    """Raise SceneError for the first error in the loads."""
    for i, pressure in scene.pressures.items():
        if pressure.penetrates not in (False, True):
            raise SceneError(f"load {i}: penetrates = {pressure.penetrates!r}; use True or False")
    scene.forces(0.0)
    scene.pressure_values(0.0)
    for i, loaded in zip(scene.dead_loads, scene.loaded, strict=True):
        hint = "; a body whose motion is prescribed bears no load: leave the load out"
        _check_not_empty(f"load {i}: where", scene, loaded, scene.movable, "body that forces move", hint)
    for i, segments in zip(scene.pressures, scene.pressed, strict=True):
        if segments.size == 0:
            raise SceneError(
                f"load {i}: where is true at no two neighbouring boundary points of a deformable body, between which"
                " a pressure acts; give the Points an outline, and allow for round-off in comparisons"
            )


def check_springs(scene: Model) -> None:
    """Raise SceneError for the first error in the springs."""
    for i, (spring, ends) in enumerate(zip(scene.springs, scene.sprung, strict=True)):
        stiffness_of(i, spring)
        for name, points in (("where", ends.first), ("to", ends.second)):
            if points is not None and points.points.size == 0:
                raise SceneError(
                    f"spring {i}: {name} is true at no point of a deformable body; allow for round-off in comparisons"
                )
        if ends.second is not None and np.isin(ends.first.points, ends.second.points).any():
            raise SceneError(f"spring {i}: where and to have points in common; give two separate sets")
        if not ends.bed and np.hypot(*ends.span(scene.initial_positions)) <= SHORTEST * scene.cell:
            raise SceneError(f"spring {i}: both its ends are at the same position at t = 0; move one of them")
        scene.rest_of_spring(i, 0.0)
