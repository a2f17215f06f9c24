"""Where pressures act: a fluid that penetrates follows the boundary up to contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from skmpm.arrays import ROUND_OFF, Bools, Ints
from skmpm.observe.traction import contact_pressure, traction
from skmpm.scene import Pressure, Scene, State, check_fits


def wetted(scene: Scene, state: State) -> list[Ints]:
    """Boundary points that each `Pressure` of a scene acted on in the last step.

    Parameters
    ----------
    scene, state : a scene and its state

    Returns
    -------
    for each pressure, in their order in `Scene.loads`, (k,) indices into the arrays of the state, ascending; of a
    pressure that penetrates none before the first step

    Raises
    ------
    SceneError
        if the state does not belong to the scene

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> fluid = skmpm.Pressure(lambda x: x[0] < -0.9e-3, lambda t: 1e3 if t > 1e-4 else 0, penetrates=True)
    >>> plates = [skmpm.Wall((0, -1e-3), (0, 1)), skmpm.Wall((0, 1e-3), (0, -1), velocity=(0, -0.1))]
    >>> scene = skmpm.Scene([body], cell=4e-4, walls=plates, loads=[fluid], friction=0.5)
    >>> state = skmpm.run(scene, dt=1e-4, until=4e-4, scheme=skmpm.Scheme(inertia=False))
    >>> (points,) = skmpm.wetted(scene, state)
    >>> bool(state.x[0, points].max() < 0)  # between the plates it is tight
    True
    """
    check_fits(scene, state, "wetted")
    boundary = scene.outlines
    return [np.unique(boundary.point[np.append(own, boundary.next[own])]) for own in pressed_segments(scene, state)]


def pressed_segments(scene: Scene, state: State) -> list[Ints]:
    """The boundary points at which the segments begin that each pressure acts on."""
    each = zip(_penetrating(scene), scene.pressed, _known(scene, state), strict=True)
    return [np.flatnonzero(wet) if penetrates else own for penetrates, own, wet in each]


def with_fluids(scene: Scene, state: State) -> State:
    """The state with the segments that pressures act on in the next step, where some penetrate."""
    if not any(_penetrating(scene)):
        return state
    wet = np.zeros_like(_known(scene, state))
    each = zip(_penetrating(scene), scene.pressed, scene.pressure_values(state.t), _known(scene, state), strict=True)
    for k, (penetrates, source, value, before) in enumerate(each):
        if penetrates and value > 0.0:
            wet[k, _reached(scene, state, source, value, before)] = True
    return replace(state, wetted=wet)


def _penetrating(scene: Scene) -> list[bool]:
    return [load.penetrates for load in scene.loads if isinstance(load, Pressure)]


def _known(scene: Scene, state: State) -> Bools:
    """The segments that pressures acted on in the last step, (pressures, m)."""
    shape = len(scene.pressed), scene.outlines.size
    return state.wetted if state.wetted.shape == shape else np.zeros(shape, dtype=bool)


def _reached(scene: Scene, state: State, source: Ints, value: float, before: Bools) -> Ints:
    """The segments that a fluid of pressure `value` reaches from others along boundaries; before it those in (m,).

    It stops at points that a support holds, and at those of contact that contact and fluid together press more than
    its own pressure: their sum is continuous at the front, which the pressure of contact alone is not. It leaves none
    by less than the error, and only contacts that close: what got through a leak stays on the other side.
    """
    boundary = scene.outlines
    number = np.zeros(state.x.shape[1], dtype=np.int64)
    number[boundary.point] = np.arange(boundary.size)
    contact, both, error = np.zeros((3, boundary.size))
    for body in np.unique(boundary.body[source]).tolist():
        alone = contact_pressure(scene, state, body)
        at = number[alone.point]
        np.maximum.at(contact, at, alone.pressure)
        all_ = traction(scene, state, body, np.where(before, value, 0.0), scene.cell)
        np.maximum.at(both, at, all_.pressure)
        np.maximum.at(error, at, all_.error)
    wet = before | before[boundary.previous]
    held = (scene.supporting[:, boundary.point] >= 0).any(axis=0)
    passes = ~held & ((contact <= ROUND_OFF * value) | (both - error * wet < value))
    open_ = np.flatnonzero(passes & passes[boundary.next])
    along = sp.coo_array((np.ones(open_.size), (open_, boundary.next[open_])), shape=(boundary.size, boundary.size))
    stretch = connected_components(along, directed=False)[1]
    wet[source] = wet[boundary.next[source]] = True
    return open_[np.isin(stretch[open_], stretch[wet & passes])]
