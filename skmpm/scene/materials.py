"""The materials of the points, and what bodies of several materials have in their place of a constant."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.material import Material, Rigid, has_memory, initial_state
from skmpm.scene.layout import Layout

Array = NDArray[np.float64]


def material_at(scene: Layout, point: int) -> Material | Rigid:
    """The material of a point."""
    body = scene.bodies[scene.owner[point]]
    local = point - scene.offsets[scene.owner[point]]
    if isinstance(body.material, Rigid):
        return body.material
    every = np.arange(body.points.size)
    found: Material = next(material for material, points in body.parts if (every[points] == local).any())
    return found


def initial_internal(scene: Layout) -> Array:
    """Internal variables of all points at t = 0, (k, n), k as of the material that has most; zero elsewhere."""
    deformable = np.flatnonzero(scene.deformable[scene.owner])
    internal = np.zeros((scene.internal_variables, scene.owner.size))
    for material, points in scene.points_by_material:
        state = initial_state(material)
        internal[: state.shape[0], deformable[points]] = state
    return internal


def plastic_strain(scene: Layout, internal: Array) -> Array:
    """Equivalent plastic strain of the points, (n,), of their `internal` variables (k, n).

    Zero in materials without memory, nan where one with memory does not tell.
    """
    out, deformable = np.zeros(scene.owner.size), np.flatnonzero(scene.deformable[scene.owner])
    for material, points in scene.points_by_material:
        if has_memory(material):
            own, known = deformable[points], getattr(material, "plastic_strain", None)
            state = internal[: initial_state(material).shape[0], own]
            out[own] = np.nan if known is None else known(state)
    return out


def crossing_times(scene: Layout) -> Array:
    """Time in which pressure waves cross the radius of a disc of that area, (bodies,) [s]; inf for rigid ones.

    In a body of several materials the radius is shared between them as the volume is.
    """
    radius = np.sqrt(np.add.reduceat(scene.initial_volumes, scene.offsets[:-1]) / np.pi)
    slowness = np.full(len(scene.bodies), np.inf)
    for i, body in enumerate(scene.bodies):
        volume, total = body.points.volume, body.points.volume.sum()
        each = [np.sqrt(m.density / (m.lame[0] + 2.0 * m.lame[1])) * (volume[p].sum() / total) for m, p in body.parts]
        slowness[i] = sum(each) if each else np.inf
    return np.asarray(radius * slowness)


def surface_compliance(scene: Layout) -> Array:
    """(1 - nu^2) / E at small strain, by body, (bodies,) [1/Pa]; zero for rigid bodies.

    Of a body of several materials it is the mean over its boundary points, where it is touched.
    """
    result = np.zeros(len(scene.bodies))
    for i, body in enumerate(scene.bodies):
        at = np.zeros(body.points.size)
        for material, points in body.parts:
            lam, mu = material.lame
            at[points] = (lam + 2.0 * mu) / (4.0 * mu * (lam + mu))
        boundary = np.concatenate(body.points.outline) if body.points.outline else slice(None)
        result[i] = at[0] if len(body.parts) == 1 else at[boundary].mean()
    return result
