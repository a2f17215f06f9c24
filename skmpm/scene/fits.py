"""Whether a state belongs to a scene."""

from __future__ import annotations

import reprlib

import numpy as np
from scipy.spatial import KDTree

from skmpm.arrays import ROUND_OFF
from skmpm.scene.scene import Scene
from skmpm.scene.state import State
from skmpm.values import SceneError

STAYS_RIGID = "bodies stay what they are: hold a deformable one by a Support, or begin a new run from its points"
_ITS_OWN = "continue with the scene that the state was made from"


def check_scene(name: str, scene: object) -> None:
    """Raise SceneError unless scene is a Scene; `name` is the calling function."""
    if not isinstance(scene, Scene):
        raise SceneError(f"{name}: scene = {reprlib.repr(scene)}; give a Scene, as skmpm.Scene(bodies, cell=1e-4)")


def check_fits(scene: Scene, state: State, name: str) -> None:
    """Raise SceneError if the state, `name` in the message, does not belong to this scene."""
    check_scene(name, scene)
    if not isinstance(state, State):
        raise SceneError(
            f"{name}: expected a State, got {reprlib.repr(state)}; use one, as returned by skmpm.load(path)"
        )
    for field in ("x", "v", "F", "C"):
        if not np.isfinite(getattr(state, field)).all():
            raise SceneError(f"{name}: {field} of the state has values that are not finite; give numbers")
    for what, found, wanted in (
        ("points", state.x.shape[1], scene.initial_positions.shape[1]),
        ("walls", len(state.walls), len(scene.walls)),
        ("supports", len(state.support_force), len(scene.supports)),
        ("internal variables", state.internal.shape[0], scene.internal_variables),
    ):
        if found != wanted:
            raise SceneError(f"{name}: the state has {found} {what}, the scene {wanted}; {_ITS_OWN}")
    edges = [0 if box is None else box.shape[1] for box in (state.box, scene.initial_box)]
    if edges[0] != edges[1]:
        raise SceneError(
            f"{name}: the state is periodic in {edges[0]} directions, the scene in {edges[1]}; {_ITS_OWN}"
        )
    if state.derived is not None and state.derived.assembly.grid.cell != scene.cell:
        of_state = state.derived.assembly.grid.cell
        raise SceneError(
            f"{name}: the grids of the state have cells of {of_state:g} m, those of the scene {scene.cell:g} m;"
            f" {_ITS_OWN}"
        )
    if not np.array_equal(state.body, scene.owner):
        raise SceneError(f"{name}: the state's points belong to other bodies than the scene's; {_ITS_OWN}")
    other = np.flatnonzero(np.abs(state.wall_normals - scene.normals.T).max(axis=1, initial=0.0) > ROUND_OFF)
    if other.size:
        i = int(other[0])
        raise SceneError(
            f"{name}: wall {i} of the state has the normal {state.wall_normals[i]}, that of the scene"
            f" {scene.normals[:, i]}; keep the walls and their order"
        )
    _check_order(scene, state, name)
    if state.derived is not None:
        deformable = np.isin(np.arange(len(scene.bodies)), state.derived.assembly.grid.cell_body)
        changed = np.flatnonzero(deformable != scene.deformable)
        if changed.size:
            was, now = ("deformable", "Rigid") if deformable[changed[0]] else ("Rigid", "deformable")
            raise SceneError(
                f"{name}: body {changed[0]} of the state is {was}, that of the scene {now}; {STAYS_RIGID}"
            )
    wrong = np.flatnonzero(np.abs(state.mass - scene.masses) > ROUND_OFF * state.mass)
    if wrong.size:
        raise SceneError(
            f"{name}: points of body {state.body[wrong[0]]} have other masses in the state than in the scene;"
            " keep the bodies, their materials and their order"
        )


def check_initial_positions(scene: Scene, state: State, name: str) -> None:
    """Raise SceneError if a body of the scene is not where that of the state was at t = 0.

    The state knows that as long as its body grids are those of t = 0, with undeformed and unstressed points.
    """
    undeformed = bool((state.F_anchor == np.eye(2)[:, :, None]).all()) and not state.stress_anchor.any()
    moved = np.hypot(*(state.x_anchor - scene.initial_positions))
    if undeformed and moved.max() > ROUND_OFF * scene.cell:
        b = int(state.body[np.argmax(moved)])
        raise SceneError(
            f"{name}: a point of body {b} of the scene lies {moved.max():.3g} m from where that of the state began;"
            f" {_ITS_OWN}, or begin a run without `start`"
        )


def _check_order(scene: Scene, state: State, name: str) -> None:
    """Raise SceneError if walls with the same normal, or bodies with as many points, are in another order."""
    offset = [np.einsum("iw,wi->w", scene.normals, p) for p in (state.walls, scene.wall_points)]
    same = np.abs(scene.normals[:, :, None] - scene.normals[:, None]).max(axis=0) < ROUND_OFF
    now, then = (np.sign(o[:, None] - o[None]) for o in offset)
    swapped = np.argwhere(same & (now * then < 0.0))
    if swapped.size:
        raise SceneError(
            f"{name}: walls {swapped[0, 0]} and {swapped[0, 1]} have passed each other since t = 0, or their order"
            " differs from that of the state; keep the walls and their order"
        )
    first = scene.offsets[:-1]
    was, is_now = state.x_anchor[:, first], scene.initial_positions[:, first]
    moved = np.flatnonzero(np.hypot(*(was - is_now)) > ROUND_OFF * scene.cell)
    distance, other = (np.asarray(a) for a in KDTree(is_now.T).query(was[:, moved].T))
    traded = np.flatnonzero(distance <= ROUND_OFF * scene.cell)
    if traded.size:
        b = traded[0]
        raise SceneError(
            f"{name}: body {moved[b]} of the state began where body {other[b]} of the scene does; keep the bodies and"
            " their order"
        )
