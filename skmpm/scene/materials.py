"""The materials of the points, and what bodies of several materials have in their place of a constant."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from skmpm.material import Material, Rigid, has_memory, initial_state
from skmpm.scene.objects import Body

if TYPE_CHECKING:
    from skmpm.scene.scene import Scene

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def points_by_material(scene: Scene) -> tuple[tuple[Material, Ints], ...]:
    """The materials in order of appearance, each with its points among those of deformable bodies."""
    number, place = np.zeros(int(scene.deformable[scene.owner].sum()), dtype=np.int64), dict[Material, int]()
    first = 0
    for body in scene.bodies:
        for material, points in body.parts:
            own = number[first : first + body.points.size]
            own[points] = place.setdefault(material, len(place))
        first += body.points.size if body.parts else 0
    return tuple((material, np.flatnonzero(number == k)) for material, k in place.items())


def material_at(scene: Scene, point: int) -> Material | Rigid:
    """The material of a point."""
    body = scene.bodies[scene.owner[point]]
    local = point - scene.offsets[scene.owner[point]]
    if isinstance(body.material, Rigid):
        return body.material
    every = np.arange(body.points.size)
    found: Material = next(material for material, points in body.parts if (every[points] == local).any())
    return found


def groups_of(body: Body) -> str:
    """The groups of the points of a body of several materials, as text; nothing of others."""
    return "" if len(body.materials) < 2 or body.points.group is None else "\n".join(body.points.group.tolist())


def densities(scene: Scene) -> Array:
    """Densities at all points, (n,) [kg/m3]."""
    density = np.zeros(scene.offsets[-1])
    for body, first, last in zip(scene.bodies, scene.offsets[:-1], scene.offsets[1:], strict=True):
        own = density[first:last]
        if isinstance(body.material, Rigid):
            own[:] = body.material.density
        for material, points in body.parts:
            own[points] = material.density
    return density


def initial_internal(scene: Scene) -> Array:
    """Internal variables of all points at t = 0, (k, n), k as of the material that has most; zero elsewhere."""
    deformable = np.flatnonzero(scene.deformable[scene.owner])
    internal = np.zeros((scene.internal_variables, scene.owner.size))
    for material, points in scene.points_by_material:
        state = initial_state(material)
        internal[: state.shape[0], deformable[points]] = state
    return internal


def plastic_strain(scene: Scene, internal: Array) -> Array:
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


def crossing_times(scene: Scene) -> Array:
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


def surface_compliance(scene: Scene) -> Array:
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
