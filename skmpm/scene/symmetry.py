"""Bodies whose material can turn inside their shape without a change of energy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skmpm.material import Material, has_memory, viscosity_of
from skmpm.scene.model import Model
from skmpm.scene.objects import Body

Array = NDArray[np.float64]

ROUND = 1e-3  # deviation of boundary points from a circle, over its radius
SAME_ENERGY = 1e-9  # relative: round-off of energies


def round_bodies(scene: Model) -> NDArray[np.bool_]:
    """Bodies whose boundaries are circles about their centres of mass, (bodies,)."""
    found = np.zeros(len(scene.bodies), dtype=bool)
    boundary, x, volume = scene.outlines, scene.initial_positions, scene.initial_volumes
    for b in np.flatnonzero(scene.outlined).tolist():
        points = slice(scene.offsets[b], scene.offsets[b + 1])
        centre = np.average(x[:, points], axis=1, weights=volume[points])
        own = np.flatnonzero(boundary.body == b)
        radius = np.hypot(*(x[:, boundary.point[own]] - centre[:, None]))
        loops = np.split(radius, np.flatnonzero(boundary.previous[own] >= own)[1:])
        found[b] = all(np.ptp(r) <= ROUND * r.max() for r in loops)
    return found


def indifferent_to_rotation(scene: Model, circular: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Round bodies, isotropic and elastic, that nothing but frictionless contact acts on, (bodies,).

    Bodies in a mask (bodies,) are `circular`. Several materials do not matter if they are concentric rings.
    """
    if scene.frictions.among_bodies.any() or scene.cohesive:
        return np.zeros(len(scene.bodies), dtype=bool)
    isotropic = {id(material): _isotropic(material) for body in scene.bodies for material in body.materials}
    symmetric = [
        bool(body.materials) and all(isotropic[id(m)] for m in body.materials) and _rings(body)
        for body in scene.bodies
    ]
    found = circular & np.array(symmetric)
    ends = [place for ends in scene.sprung for place in ends.sets]
    for place in (*scene.supported, *scene.loaded, *ends):
        found[scene.owner[place.points]] = False
    for segments in scene.pressed:
        found[scene.outlines.body[segments]] = False
    return np.asarray(found)


def _rings(body: Body) -> bool:
    """Whether the materials of a body are rings about its centre of mass, or one."""
    if len(body.parts) == 1:
        return True
    volume, x = body.points.volume, body.points.x
    mass = np.concatenate([material.density * volume[points] for material, points in body.parts])
    position = np.concatenate([x[:, points] for _, points in body.parts], axis=1)
    radius = np.hypot(*(x - np.average(position, axis=1, weights=mass)[:, None]))
    inner, outer = zip(*sorted((radius[p].min(), radius[p].max()) for _, p in body.parts), strict=True)
    return all(low > high for low, high in zip(inner[1:], outer[:-1], strict=True))


def _isotropic(material: Material) -> bool:
    """Whether the energy is a function of F F^T, by its values for one deformation of the material, rotated.

    Flow leaves strains in a body that turn with it.
    """
    if viscosity_of(material) > 0.0 or has_memory(material):
        return False
    F, angle = np.array([[1.2, 0.3], [0.05, 0.9]]), np.linspace(0.0, np.pi, 7)
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    energy = material.energy(np.einsum("ij,jkn->ikn", F, rotation))
    return bool(np.ptp(energy) <= SAME_ENERGY * np.abs(energy).max())
