"""Stages: a state continues in another scene of the same bodies, or of some of them."""

from __future__ import annotations

from dataclasses import replace
from itertools import zip_longest
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skmpm.arrays import Array, Bools, Ints
from skmpm.material import has_memory
from skmpm.scene.check import check_walls
from skmpm.scene.fits import STAYS_RIGID, check_fits, check_scene
from skmpm.scene.objects import Body, rigid_motion
from skmpm.scene.point_sets import support_arms, support_rotations
from skmpm.scene.prescribed import normal_speeds, with_normal_speeds
from skmpm.scene.renumbered import of_bodies, renumbered
from skmpm.scene.report import StepControl
from skmpm.scene.scene import Scene
from skmpm.scene.state import State
from skmpm.values import SceneError

KEEP = "a stage may lack bodies, but keeps the others in their order and the cell, as dataclasses.replace does"


def continued(scene: Scene, state: State, new_scene: Scene) -> State:
    """State of a scene as a start in a new scene of its bodies: `simulate(new_scene, start=continued(...))`.

    Walls, supports, loads, springs, friction, cohesion, gravity, moduli, the `motion` of rigid bodies, and rate and
    stress of a periodic box may differ. Bodies go on with the velocities of the state. A wall with the `point` and
    the `normal` of a wall of the old scene is that wall, and goes on from where it is; any other is new and begins at
    its `point`. Walls and bodies that the new scene lacks, as grains that have left, are removed with their contacts;
    the other bodies keep their order. Supports, loads and springs act on the points where `where(x)` is true at
    t = 0, as always: a load or a spring is that of the bodies that are left, and so is the mass of a driven wall
    that gives none. A `Pressure` that stays has wetted what it had. Time goes on, so functions of time are taken at
    the time of the state.

    Parameters
    ----------
    scene, state : a scene, and the state to go on from
    new_scene : the scene in which it goes on

    Returns
    -------
    the state in the new scene

    Raises
    ------
    SceneError
        if the state does not belong to the old scene, the new scene has other bodies or another cell, a body is rigid
        in only one of them, points have internal variables of another class of material, a body is given another
        velocity or spin, a new wall stands where a body is, or two walls of the new scene are the same one

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> *_, state = skmpm.simulate(scene, dt=1e-3, until=3e-3)
    >>> weightless = skmpm.Scene([body], cell=4e-4)
    >>> start = skmpm.continued(scene, state, weightless)
    >>> *_, state = skmpm.simulate(weightless, dt=1e-3, until=5e-3, start=start)
    >>> round(state.t, 4), round(float(state.v[1].mean()), 5)
    (0.005, -0.02943)
    """
    check_fits(scene, state, "continued")
    check_scene("continued", new_scene)
    bodies = _former_bodies(scene, new_scene)
    _check_bodies(scene, new_scene, bodies)
    former = _former_walls(scene, new_scene)
    support_force, support_moment = _of_supports(scene, state, new_scene, np.isin(scene.owner, bodies))
    contacts = renumbered(scene, new_scene, state.contacts, bodies, former)
    if bodies.size < len(scene.bodies):
        state = of_bodies(scene, new_scene, state, bodies)
    kept = former >= 0
    walls = new_scene.wall_points.copy()
    walls[kept] = state.walls[former[kept]]
    force, velocity = np.zeros_like(walls), new_scene.wall_velocities(state.t)
    force[kept] = state.wall_force[former[kept]]
    going_on = velocity.copy()
    going_on[kept] = state.wall_velocity[former[kept]]
    velocity = with_normal_speeds(new_scene, velocity, normal_speeds(new_scene, going_on))
    new = {i: walls[i] for i in np.flatnonzero(~kept).tolist()}
    check_walls(new_scene, state.x, new, f"at t = {state.t:.6g} s; move the new wall")
    return replace(
        state,
        walls=walls,
        wall_normals=new_scene.normals.T.copy(),
        wall_force=force,
        wall_velocity=velocity,
        support_force=support_force,
        support_moment=support_moment,
        contacts=contacts,
        wetted=_wetted(scene, state, new_scene),
        step_control=StepControl(),
    )


def at_rest(scene: Scene, state: State) -> State:
    """State of a scene with all that forces move at rest; what is prescribed moves as prescribed.

    Deformations, positions, contacts and their forces stay. Velocities of bodies and of driven walls are set to zero,
    and so are the rates of a periodic box that a stress determines; points that supports hold keep the prescribed
    velocity, and bodies move with a box whose rate is prescribed. So velocities of a quasi-static step, which are
    displacements over its length, do not become those of bodies with inertia.

    Parameters
    ----------
    scene, state : a scene and its state

    Returns
    -------
    the state at rest

    Raises
    ------
    SceneError
        if the state does not belong to the scene

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> *_, state = skmpm.simulate(scene, dt=1e-3, until=3e-3)
    >>> still = skmpm.at_rest(scene, state)
    >>> bool(state.v.any()), bool(still.v.any())
    (True, False)
    >>> bool((still.x == state.x).all())
    True
    """
    check_fits(scene, state, "at_rest")
    rate = None if scene.periodic is None else scene.periodic.rate_at(state.t)
    with_box = 0.0 if rate is None else rate @ state.centres[:, state.body]
    walls = scene.wall_velocities(state.t)
    v = np.where(scene.movable[scene.owner], with_box, state.v)
    for b in scene.free_rigid.tolist():
        motion, own = rigid_motion(scene.bodies[b], state.t, f"body {b}"), scene.owner == b
        x, y = state.x[:, own] - state.centres[:, b, None]
        v[:, own] = np.where(np.isnan(motion[:2, None]), v[:, own], motion[:2, None])
        v[:, own] += np.nan_to_num(motion[2]) * np.stack([-y, x])
    for place, velocity in zip(scene.supported, scene.support_velocities(state.t), strict=True):
        v[:, place.points] = np.where(np.isnan(velocity)[:, None], v[:, place.points], velocity[:, None])
    for i, (cosine, sine) in zip(scene.turning.tolist(), support_rotations(scene, state.t).T, strict=True):
        points = scene.supported[i].points
        x, y = support_arms(scene, i, points)
        v[:, points] += cosine * np.stack([x, y]) + sine * np.stack([-y, x])
    return replace(
        state,
        v=v,
        C=np.zeros_like(state.C),
        wall_velocity=with_normal_speeds(scene, walls, np.zeros(scene.driven_walls.size)),
        box_rate=rate,
    )


def _wetted(scene: Scene, state: State, new_scene: Scene) -> Bools:
    """What the pressures of the new scene wet: those of the old one the same, others nothing yet."""
    old, new = (list(each.pressures.values()) for each in (scene, new_scene))
    if state.wetted.shape != (len(old), new_scene.outlines.size):
        return np.zeros((0, 0), dtype=bool)
    dry = np.zeros(new_scene.outlines.size, dtype=bool)
    return np.array([state.wetted[old.index(each)] if each in old else dry for each in new]).reshape(-1, dry.size)


def _of_supports(scene: Scene, state: State, new_scene: Scene, kept: Bools) -> tuple[Array, Array]:
    """Forces (supports, 2) and moments (supports,) on supports of a scene that hold what old ones held.

    `kept` (n,) are the points that the new scene has. A force goes on where a support holds a component of as many
    points as one before, a moment where it turns the same points.
    """
    forces, moments = np.zeros((len(new_scene.supports), 2)), np.zeros(len(new_scene.supports))
    supporting, number = scene.supporting[:, kept], np.cumsum(kept) - 1
    for i, place in enumerate(new_scene.supported):
        for axis, (held, holds) in enumerate(zip(supporting, new_scene.supporting, strict=True)):
            former = np.unique(held[place.points])
            if former.size == 1 and former[0] >= 0 and holds[place.points[0]] == i:
                same = scene.supported[former[0]].points.size == place.points.size
                forces[i, axis] = state.support_force[former[0], axis] if same else 0.0
    for i in new_scene.turning.tolist():
        for old in scene.turning.tolist():
            points = scene.supported[old].points
            if kept[points].all() and np.array_equal(number[points], new_scene.supported[i].points):
                moments[i] = state.support_moment[old]
    return forces, moments


def _former_bodies(scene: Scene, new_scene: Scene) -> Ints:
    """For each body of the new scene its index in the old one, ascending, (bodies,)."""
    if len(new_scene.bodies) >= len(scene.bodies):
        return np.arange(len(scene.bodies))
    former, old = np.empty(len(new_scene.bodies), dtype=np.int64), 0
    for b, body in enumerate(new_scene.bodies):
        while old < len(scene.bodies) and not _same_points(scene.bodies[old], body):
            old += 1
        if old == len(scene.bodies):
            raise SceneError(
                f"continued: body {b} of the new scene is none of the {len(scene.bodies)} bodies of the old one, or"
                f" in another order; {KEEP}"
            )
        former[b], old = old, old + 1
    return former


def _same_points(old: Body, new: Body) -> bool:
    if old.points is new.points:
        return True
    loops = zip_longest(old.points.outline, new.points.outline, fillvalue=())
    both = (old.points.x, new.points.x), (old.points.volume, new.points.volume), *loops
    return all(np.array_equal(before, now) for before, now in both)


def _check_bodies(scene: Scene, new_scene: Scene, former: Ints) -> None:
    """Raise SceneError where bodies of the new scene differ from the old ones, `former` (bodies,), or its cell."""
    if len(new_scene.bodies) > len(scene.bodies):
        raise SceneError(
            f"continued: the new scene has {len(new_scene.bodies)} bodies, the old one {len(scene.bodies)}; {KEEP}"
        )
    if new_scene.cell != scene.cell:
        raise SceneError(f"continued: the new scene has cell = {new_scene.cell}, the old one {scene.cell}; {KEEP}")
    if (new_scene.periodic is None) != (scene.periodic is None):
        which = "new" if scene.periodic is None else "old"
        raise SceneError(f"continued: only the {which} scene has a periodic box; {KEEP}")
    boxes = [(box.width, box.height) for box in (scene.periodic, new_scene.periodic) if box is not None]
    if len(set(boxes)) > 1:
        raise SceneError(
            f"continued: the periodic box of the new scene is {boxes[1]} m at t = 0, that of the old one"
            f" {boxes[0]} m; keep it, or give it a rate"
        )
    memories, new_memories = _memories(scene), _memories(new_scene)
    for b, (i, new) in enumerate(zip(former.tolist(), new_scene.bodies, strict=True)):
        old, same = scene.bodies[i], _same_points(scene.bodies[i], new)
        was, now = (slice(each.offsets[k], each.offsets[k + 1]) for each, k in ((scene, i), (new_scene, b)))
        if not same or not np.array_equal(scene.densities[was], new_scene.densities[now]):
            what = "another density" if same else "other points"
            raise SceneError(f"continued: body {b} of the new scene has {what}; {KEEP}")
        if scene.deformable[i] != new_scene.deformable[b]:
            rigid, other = ("new", "old") if scene.deformable[i] else ("old", "new")
            raise SceneError(
                f"continued: body {b} is Rigid in the {rigid} scene and deformable in the {other} one; {STAYS_RIGID}"
            )
        for name in ("velocity", "spin"):
            if _given_anew(getattr(old, name), getattr(new, name), new.points.x):
                raise SceneError(
                    f"continued: body {b} of the new scene has another {name}, but bodies go on with the velocities"
                    f" of the state; leave its {name} out, and give dataclasses.replace(state, v=..., C=...) others"
                )
        if (memories[was] != new_memories[now]).any():
            raise SceneError(
                f"continued: points of body {b} have internal variables of another material in the new scene;"
                " materials with memory keep their class and their points"
            )


def _given_anew(old: Any, new: Any, x: Array) -> bool:
    """Whether an initial velocity is given, and has other values at points x (2, n) than in the old scene."""
    if new is old:
        return False
    was, now = (each(x.copy()) if callable(each) else np.reshape(each, (-1, 1)) for each in (old, new))
    return bool(np.any(now) and np.any(was != now))


def _memories(scene: Scene) -> NDArray[np.object_]:
    """The class of the material of each point, None where it has no memory, (n,)."""
    kinds = [type(material) if has_memory(material) else None for material in scene.materials]
    return np.array([*kinds, None], dtype=object)[scene.material_index]


def _former_walls(scene: Scene, new_scene: Scene) -> Ints:
    """For each wall of the new scene its index in the old one, by point and normal, -1 for a new wall, (walls,)."""
    old, new = ([np.append(w.point, w.normal).tolist() for w in each.walls] for each in (scene, new_scene))
    former = np.array([old.index(wall) if wall in old else -1 for wall in new], dtype=np.int64)
    known, count = np.unique(former[former >= 0], return_counts=True)
    if (count > 1).any():
        i = int(known[np.argmax(count)])
        twice = np.flatnonzero(former == i).tolist()
        raise SceneError(
            f"continued: walls {twice[0]} and {twice[1]} of the new scene have the point and the normal of wall {i};"
            " give each wall once"
        )
    return former
