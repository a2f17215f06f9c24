"""Sheets laid through the points, and the bulk that moves on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skmpm import outline
from skmpm.assembly import Assembly, prepare
from skmpm.grid import lay
from skmpm.implicit import Bulk
from skmpm.material import Rigid, determinant, product
from skmpm.scene import Derived, Scene, State, field_values
from skmpm.scheme import Scheme

Array = NDArray[np.float64]


def anchored(scene: Scene, state: State, scheme: Scheme) -> State:
    """The state with sheets: laid anew through the points when they have deformed beyond `scheme.anchor`."""
    modulus, worn = _ghost_moduli(scene, scheme), _worn(scene, state, scheme)
    derived = state.derived
    if state.displacement.size and derived is not None and not worn and np.array_equal(derived.ghost, modulus):
        return state
    own = scene.deformable[state.body]
    if state.displacement.size == 0 or worn:
        relative = product(state.F, _inverse(state.F_anchor))
        state = replace(
            state,
            C=product(state.C, _inverse(relative)),
            x_anchor=state.x,
            F_anchor=state.F,
            stress_anchor=state.stress,
            displacement=np.zeros(0),
        )
    volume = scene.initial_volumes * determinant(state.F_anchor)
    sheets = lay(
        state.x_anchor[:, own],
        state.body[own],
        scene.cell,
        len(scene.bodies),
        _inward(scene, state.x_anchor)[:, own],
    )
    assembly = prepare(sheets, volume[own], state.mass[own], modulus)
    displacement = state.displacement if state.displacement.size else np.zeros(2 * sheets.nodes)
    return replace(state, displacement=displacement, derived=Derived(assembly, modulus))


def _ghost_moduli(scene: Scene, scheme: Scheme) -> Array:
    """Moduli of the bodies' ghost penalties, (bodies,) [Pa]."""
    modulus = np.zeros(len(scene.bodies))
    for b, body in enumerate(scene.bodies):
        if not isinstance(body.material, Rigid):
            lam, mu = body.material.lame
            modulus[b] = scheme.ghost * min(lam + 2.0 * mu, 10.0 * mu)
    return modulus


def _worn(scene: Scene, state: State, scheme: Scheme) -> bool:
    """Whether the sheets have deformed beyond the scheme's bound since they were laid."""
    if not np.isfinite(scheme.anchor) or state.t == 0.0:
        return False
    if scheme.anchor == 0.0:
        return state.x is not state.x_anchor
    relative = product(state.F, _inverse(state.F_anchor)) - np.eye(2)[:, :, None]
    return float(np.abs(relative).max(initial=0.0)) > scheme.anchor


def _inverse(F: Array) -> Array:
    return np.array([[F[1, 1], -F[0, 1]], [-F[1, 0], F[0, 0]]]) / determinant(F)


def _inward(scene: Scene, x: Array) -> Array:
    """Inward normals of the rim points, zero elsewhere, (2, n)."""
    inward = np.zeros_like(x)
    rim = scene.outlines
    if rim.point.size:
        inward[:, rim.point] = -outline.normals(rim, x[:, rim.point])
    return inward


def derived_of(state: State) -> Derived:
    """What is kept for speed with an anchored state."""
    if state.derived is None:
        raise ValueError("the state has no sheets; pass it through `anchored` first")
    return state.derived


def assembly_of(state: State) -> Assembly:
    """The assembly of an anchored state."""
    return derived_of(state).assembly


def bulk_of(scene: Scene, state: State, *, locking: bool = False) -> Bulk:
    """The deformable bodies' energy, grouped by material; `locking` as in Scheme."""
    own = scene.deformable[state.body]
    body = state.body[own]
    of_body = [b.material for b in scene.bodies]
    kinds = dict.fromkeys(m for m in of_body if not isinstance(m, Rigid))
    groups = [(kind, np.flatnonzero(np.array([m == kind for m in of_body])[body])) for kind in kinds]
    F, stress = state.F_anchor[:, :, own], state.stress_anchor[:, :, own]
    undeformed = bool((np.eye(2)[:, :, None] == F).all())
    known = (None if undeformed else F, stress if stress.any() else None)
    return Bulk(assembly_of(state), groups, *known, locking)


def heavy(scene: Scene) -> bool:
    """Whether there is gravity."""
    return callable(scene.gravity) or bool(np.any(scene.gravity))


def gravity_at(scene: Scene, state: State, t: float) -> Array:
    """Acceleration of the nodes by gravity at time t, (2 nodes,) [m/s2]."""
    assembly = assembly_of(state)
    if not callable(scene.gravity):
        return np.tile(np.asarray(scene.gravity, dtype=float), assembly.sheets.nodes)
    own = scene.deformable[state.body]
    X = scene.initial_positions[:, own]
    g = field_values(f"gravity(X, t) at t = {t:.6g} s", scene.gravity(X, t), X)
    force = assembly.sheets.interpolation.T @ (state.mass[own] * g).T
    return np.asarray(force).ravel() / assembly.mass
