"""Where pressures act: a fluid that penetrates follows the boundary up to contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from skmpm.arrays import ROUND_OFF, Bools, Ints
from skmpm.observe.traction import contact_pressure, traction
from skmpm.scene import Scene, SceneError, State, check_fits


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
        if the state does not belong to the scene, or has other pressures

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
    boundary, known = scene.outlines, state.wetted.shape
    if any(_penetrating(scene)) and state.wetted.size and known != _shape(scene):
        raise SceneError(
            f"wetted: the state has {known[0]} pressures on {known[1]} segments, the scene {len(scene.pressed)} on"
            f" {boundary.size}; give the scene that the state was made from"
        )
    return [np.unique(boundary.point[np.append(own, boundary.next[own])]) for own in wetted_segments(scene, state)]


def wetted_segments(scene: Scene, state: State) -> list[Ints]:
    """The boundary points at which the segments begin that each pressure acts on."""
    each = zip(_penetrating(scene), scene.pressed, _known(scene, state), strict=True)
    return [np.flatnonzero(wet) if penetrates else own for penetrates, own, wet in each]


def with_fluids(scene: Scene, state: State, t: float) -> State:
    """The state with the segments that pressures act on in a step that takes them at time t, where some penetrate.

    Contacts are judged by the pressures with which the step begins, which are those of the contact forces.

    Raises
    ------
    SceneError
        if the pressure of a fluid that penetrates is negative
    """
    if not any(_penetrating(scene)):
        return state
    wet = np.zeros_like(_known(scene, state))
    values = np.stack([scene.pressure_values(each) for each in (state.t, t)], axis=1)
    each = zip(_penetrating(scene), scene.pressed, values, _known(scene, state), strict=True)
    for k, (penetrates, source, value, before) in enumerate(each):
        if penetrates and value.min() < 0.0:
            raise SceneError(
                f"pressure {k}: a fluid that penetrates has {value.min():.3g} Pa at t = {t:.6g} s; give a pressure of"
                " zero or more, or leave penetrates out: suction enters no contact"
            )
        if penetrates and value.any():
            wet[k, _reached(scene, state, source, float(value[0]), before)] = True
    return replace(state, wetted=wet)


def _penetrating(scene: Scene) -> list[bool]:
    return [pressure.penetrates for pressure in scene.pressures.values()]


def _known(scene: Scene, state: State) -> Bools:
    """The segments that pressures acted on in the last step, (pressures, m)."""
    return state.wetted if state.wetted.shape == _shape(scene) else np.zeros(_shape(scene), dtype=bool)


def _shape(scene: Scene) -> tuple[int, int]:
    return len(scene.pressed), scene.outlines.size


def _reached(scene: Scene, state: State, source: Ints, value: float, before: Bools) -> Ints:
    """The segments that a fluid of pressure `value` reaches from others along boundaries; before it those in (m,).

    It enters points of contact where contact and fluid together press less than its own pressure: their sum is
    continuous at the front, which the pressure of contact alone is not. It leaves them where contact alone presses
    as much: in between it changes nothing, as it takes over what contact bore. It passes no point that a support
    holds. The segments up to the points where it stops are wet, too.
    """
    boundary = scene.outlines
    number = np.zeros(state.x.shape[1], dtype=np.int64)
    number[boundary.point] = np.arange(boundary.size)
    contact, both = np.zeros((2, boundary.size))
    for body in np.unique(boundary.body[source]).tolist():
        alone = contact_pressure(scene, state, body)
        at = number[alone.point]
        np.maximum.at(contact, at, alone.pressure)
        np.maximum.at(both, at, traction(scene, state, body, np.where(before, value, 0.0), scene.cell).pressure)
    wet = before & before[boundary.previous]
    held = (scene.supporting[:, boundary.point] >= 0).any(axis=0)
    passes = ~held & ((contact <= ROUND_OFF * contact.max()) | (both < value) | (wet & (contact < value)))
    open_ = np.flatnonzero(passes & passes[boundary.next])
    along = sp.coo_array((np.ones(open_.size), (open_, boundary.next[open_])), shape=(boundary.size, boundary.size))
    stretch = connected_components(along, directed=False)[1]
    begins = before | before[boundary.previous]
    begins[source] = begins[boundary.next[source]] = True
    reached = passes & np.isin(stretch, stretch[begins & passes])
    return np.flatnonzero(reached | reached[boundary.next])
